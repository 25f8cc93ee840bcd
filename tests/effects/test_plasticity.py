"""The strain memory of paper eq. 9, with hardening, against its ordinary differential equation (docs/model.md).

Bending is prescribed: both ends are held in position and direction on the circular arc of the asked turn, so that the
curvature is the same everywhere and known. Of the strain e a section remembers e_0 = z/(1 + H):

    z˙ = k (1 + H) (e - z -+ e_M) where e - z is beyond +- e_M, else 0.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dlocore import (
    ControlPoints,
    Environment,
    Grasp,
    Move,
    Prediction,
    Scene,
    Straight,
    Waypoints,
    equilibrium,
    predict,
)
from tests.solver.scenes import WEIGHTLESS, Floats, cable, march

EI = 1e-3  # [N m^2]
LIMIT = 1.0  # kappa_M [1/m], of the yield strain below in a cable of 5 mm
YIELDS = {"yield_strain": LIMIT * 0.005 / 2, "memory_rate": 8.0, "hardening": 0.1}
HELD = Grasp(u=0.0, hold="clamp")
Turn = Callable[[Floats], Floats]


def ramps(times: list[float], angles: list[float]) -> Turn:
    """Return an angle over time [rad] that goes from one of `angles` to the next as a minimum-jerk motion."""

    def turn(t: Floats) -> Floats:
        total = np.full(np.shape(t), angles[0])
        for (a, b), (start, end) in zip(pairwise(angles), pairwise(times), strict=True):
            x = np.clip((np.asarray(t) - start) / (end - start), 0.0, 1.0)
            total = total + (b - a) * x**3 * (10 - 15 * x + 6 * x**2)
        return total

    return turn


def rolling(turn: Turn, duration: float, count: int = 801) -> Waypoints:
    """Return the motion of the far end of a 1 m cable from the origin along x that is bent by turn(t) to an arc."""
    t = np.linspace(0.0, duration, count)
    angle = turn(t)
    half = angle / 2
    chord = np.sinc(half / np.pi)
    ends = np.column_stack([chord * np.cos(half), chord * np.sin(half), 0 * t])
    quaternions = np.column_stack([np.cos(half), 0 * t, 0 * t, np.sin(half)])
    return Waypoints(times=t, positions=ends, orientations=quaternions)


def bending(turn: Turn, duration: float, *, release: float | None = None, **changes: Any) -> Scene:
    """Return a straight cable that is bent to arcs of turn(t) [rad] by its far end, quasi-statically."""
    values: dict[str, Any] = {
        "cable": cable(**YIELDS),
        "shape": Straight(),
        "environment": WEIGHTLESS,
        "effects": {"inertia": "off"},
        "quality": march(17, 81),
        "horizon": duration,
    }
    far = Grasp(u=1.0, hold="tangent", path=rolling(turn, duration), release_time=release)
    return Scene(grasps=(replace(HELD, hold="tangent"), far), **(values | changes))


def remembered(
    strain: Callable[[float], float], times: Floats, *, limit: float, rate: float, hardening: float
) -> Floats:
    """Return e_0 at `times` (k,) of sections strained by strain(t), from none at times[0]; (k,)."""

    def flow(t: float, z: Floats) -> Floats:
        off = strain(t) - z
        return rate * (1 + hardening) * (off - np.clip(off, -limit, limit))

    done = solve_ivp(flow, times[[0, -1]], [0.0], method="LSODA", t_eval=times, rtol=1e-9, atol=1e-11, max_step=0.01)
    return done.y[0] / (1 + hardening)


def bend_memory(found: Prediction) -> tuple[Floats, Floats]:
    """Return the times (m,) [s] and the curvatures (m, k) [1/m] that a cable bent in a plane remembers."""
    assert found.material is not None
    memory = found.material.memory[..., :2]
    m, k = np.unravel_index(np.argmax(np.linalg.norm(memory, axis=-1)), memory.shape[:2])
    sense = memory[m, k] / max(np.linalg.norm(memory[m, k]), 1e-300)
    np.testing.assert_allclose(memory, (memory @ sense)[..., None] * sense, atol=1e-6)  # all in one plane
    return found.material.times, memory @ sense


def test_a_bend_held_long_is_remembered_but_for_the_yield_curvature():
    # z grows until kappa - z = kappa_M: kappa_0 = (kappa - kappa_M)/(1 + H)
    for hardening in (0.1, 0.5):
        yields = YIELDS | {"hardening": hardening}
        found = predict(bending(ramps([0.0, 1.0], [0.0, 2.5]), 3.0, cable=cable(**yields)))
        assert found.status == "converged", found.message
        assert next(e for e in found.effects if e.name == "plasticity").active
        expected = (2.5 - LIMIT) / (1 + hardening)
        _, memory = bend_memory(found)
        # exp(-k (1 + H) 2 s) = 2e-8 is left; the arc of the spline is one to 1e-3 in its curvature
        np.testing.assert_allclose(memory[-1], expected, rtol=5e-3)
        moment = EI * (2.5 - expected)
        np.testing.assert_allclose(found.grasps[1].moment[-1], [0, 0, moment], atol=5e-3 * moment)


@pytest.mark.parametrize("hardening", [0.1, 0.5])
def test_memory_follows_its_law_through_loading_unloading_and_reloading(hardening):
    turn = ramps([0.0, 0.8, 1.2, 2.0, 2.4, 3.2], [0.0, 2.5, 2.5, -1.5, -1.5, 2.0])
    yields = YIELDS | {"hardening": hardening}
    found = predict(bending(turn, 4.0, cable=cable(**yields)))
    assert found.status == "converged", found.message
    times, memory = bend_memory(found)
    law = remembered(lambda t: float(turn(np.array(t))), times, limit=LIMIT, rate=8.0, hardening=hardening)
    assert law.max() > 0.9
    assert law.min() < -0.3  # yields both ways
    # steps of 0.01 s, over which the curvature is taken as linear; the spline's own curvature varies by 0.3 % along it
    np.testing.assert_allclose(memory.mean(axis=1), law, atol=0.004 * LIMIT)
    np.testing.assert_allclose(memory, np.tile(law[:, None], memory.shape[1]), atol=0.015 * LIMIT)
    g = found.grasps[1]
    at = remembered(lambda t: float(turn(np.array(t))), g.times, limit=LIMIT, rate=8.0, hardening=hardening)
    np.testing.assert_allclose(g.moment[:, 2], EI * (turn(g.times) - at), atol=0.01 * EI * LIMIT)


def test_a_linear_ramp_is_remembered_as_the_closed_form():
    # beyond the limit at t_1 = kappa_M/c, a = k (1 + H): z = c (t - t_1 - (1 - exp(-a (t - t_1)))/a)
    speed, hardening, rate = 2.0, 0.1, 8.0
    found = predict(bending(lambda t: speed * t, 1.5))
    times, memory = bend_memory(found)
    a, since = rate * (1 + hardening), np.maximum(times - LIMIT / speed, 0.0)
    law = speed * (since - (1 - np.exp(-a * since)) / a) / (1 + hardening)
    # the waypoints' spline starts at rest: the end is off the arc for the first hundredth of a second
    np.testing.assert_allclose(memory, np.tile(law[:, None], memory.shape[1]), atol=0.01 * LIMIT)


def test_below_the_yield_curvature_nothing_is_remembered_and_nothing_changes():
    turn = ramps([0.0, 1.0, 2.0], [0.0, 0.95 * LIMIT, -0.95 * LIMIT])
    plastic = predict(bending(turn, 2.5, effects={"inertia": "off", "plasticity": "on"}))
    elastic = predict(bending(turn, 2.5, cable=cable()))
    if plastic.material is not None:
        assert not plastic.material.memory.any()
    # the same equations, but for what Newton's method is known to leave of them, and rounding
    left = sum(found.level.motion.update for found in (plastic, elastic) if found.level is not None)
    np.testing.assert_allclose(
        plastic.surface.control_points, elastic.surface.control_points, rtol=0, atol=left + 1e-12
    )
    assert elastic.material is None


def test_work_of_the_grippers_over_a_cycle_is_what_yielding_dissipates():
    # stored: EI/2 (kappa - kappa_0)^2 + EI H/2 kappa_0^2; dissipated: EI (kappa - z) kappa_0˙, never negative
    turn = ramps([0.0, 0.8, 1.6, 2.4], [0.0, 2.5, -2.0, 0.0])
    found = predict(bending(turn, 3.0, quality=march(9, 161)))
    g, path = found.grasps[1], found.scene.grasps[1].path
    t = np.linspace(0.0, 3.0, 3001)
    moved, angle = path.at(t, np.zeros(3)), turn(t)
    force = np.array([np.interp(t, g.times, g.reaction[:, d]) for d in range(3)]).T
    moment = np.interp(t, g.times, g.moment[:, 2])
    power = np.einsum("td,td->t", force, np.gradient(moved, t, axis=0)) + moment * np.gradient(angle, t)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    law = remembered(lambda s: float(turn(np.array(s))), t, limit=LIMIT, rate=8.0, hardening=0.1)
    stored = 0.5 * EI * ((angle - law) ** 2 + 0.1 * law**2)
    dissipated = work - stored
    scale = work[-1]
    assert scale > 0
    expected = EI * np.concatenate([[0.0], np.cumsum(np.diff(law) * (angle - 1.1 * law)[1:])])
    np.testing.assert_allclose(dissipated, expected, atol=0.02 * scale)
    assert np.diff(dissipated).min() > -1e-3 * scale  # a step's share: never negative but for reported moments


def test_a_moving_cable_never_gives_back_more_than_the_grippers_put_in():
    turn = ramps([0.0, 0.4, 0.8, 1.2], [0.0, 2.5, -2.0, 0.0])
    found = predict(bending(turn, 1.5, effects={}, quality=march(13, 161)))
    assert found.status == "converged", found.message
    g, path = found.grasps[1], found.scene.grasps[1].path
    t = g.times
    power = np.einsum("td,td->t", g.reaction, np.gradient(path.at(t, np.zeros(3)), t, axis=0))
    power += g.moment[:, 2] * np.gradient(turn(t), t)
    work = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(t)))
    u = np.linspace(0.0, 1.0, 201)
    kinetic = 0.5 * 0.05 * (found.surface(u, [1.5], dt=1)[0, :, :3] ** 2).sum(axis=1).mean()
    memory = bend_memory(found)[1][-1]
    # straight again but for its vibration: at least the moment EI kappa_0 of the memory is stored
    stored = 0.5 * EI * float((memory**2).mean())
    assert work > kinetic + stored


RESIDUAL = (2.5 - LIMIT) / 1.1  # curvature [1/m] that is left of 2.5/m held long


def bent_and_released(**changes: Any) -> Prediction:
    """Return a cable that was bent by 2.5 rad for 2 s, unbent until it pushed no more, and let go by its far end."""
    turn = ramps([0.0, 1.0, 3.0, 4.0], [0.0, 2.5, 2.5, RESIDUAL])
    # a drag that lets it come to rest at a rate of 12.4 EI/(c L^4) = 6/s
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=2e-3)
    found = predict(bending(turn, 6.0, release=4.0, environment=around, quality=march(17, 121), **changes))
    assert found.status == "converged", found.message
    return found


def test_after_release_the_cable_keeps_the_curvature_it_remembers():
    found = bent_and_released()
    u = np.linspace(0.1, 0.9, 25)
    # the free end has no moment: kappa = kappa_0; 17 control points hold an arc to 1 % of its curvature
    np.testing.assert_allclose(found.surface.curvature(u, [6.0])[0], RESIDUAL, rtol=0.015)
    times, memory = bend_memory(found)
    after = memory[times > 4.0]
    # springing back by less than twice kappa_M does not yield
    np.testing.assert_allclose(after, np.tile(after[:1], (len(after), 1)), atol=1e-6)
    elastic = bent_and_released(cable=cable())
    assert elastic.surface.curvature(u, [6.0]).max() < 1e-3 * RESIDUAL


def curvature_of(shape: ControlPoints, **grasps: Any) -> Floats:
    """Return the curvature [1/m] at rest of a cable that nothing strains, held at one place."""
    scene = Scene(cable=cable(**YIELDS), shape=shape, environment=WEIGHTLESS, horizon=1.0, grasps=(Grasp(**grasps),))
    found = equilibrium(scene, n_u=17)
    u = np.linspace(0.1, 0.9, 25)
    r = found.positions(np.linspace(0.0, 1.0, 401))
    step = 1.0 / 400
    second = np.linalg.norm(np.diff(r, 2, axis=0), axis=1) / step**2
    return np.interp(u, np.linspace(0.0, 1.0, 401)[1:-1], second)


def test_a_second_motion_begins_with_the_memory_of_the_first():
    first = bent_and_released()
    shape = first.shape_at()
    assert shape.material is not None
    for grasp in ({"u": 0.0, "hold": "tangent"}, {"u": 0.6, "hold": "tangent"}, {"u": 1.0, "hold": "clamp"}):
        np.testing.assert_allclose(curvature_of(shape, **grasp), RESIDUAL, rtol=0.02)
    # grasped elsewhere and moved without load it stays what it is
    lift = Move(displacement=(0.1, 0.2, 0.3), duration=2.0)
    scene = Scene(
        cable=cable(**YIELDS),
        shape=shape,
        grasps=(Grasp(u=0.4, hold="clamp", path=lift),),
        environment=WEIGHTLESS,
        effects={"inertia": "off"},
        quality=march(17, 31),
    )
    second = predict(scene)
    assert second.start_energy < 1e-3 * 0.5 * EI * RESIDUAL**2  # at rest in its new form
    before, after = (second.surface.positions(np.linspace(0.0, 1.0, 33), [t])[0] for t in (0.0, 2.0))
    np.testing.assert_allclose(after, before + np.array([0.1, 0.2, 0.3]), atol=2e-3)
    assert second.material is not None
    kept = np.linalg.norm(second.material.memory[-1, :, :2], axis=-1)
    np.testing.assert_allclose(kept, RESIDUAL, rtol=0.03)  # that of the ends' own points, read between the first's
    # without memory the same start stores the whole bend
    forgetful = predict(replace(scene, shape=replace(shape, material=None), cable=cable()), keep_grid=True)
    assert forgetful.start_energy == pytest.approx(0.5 * EI * RESIDUAL**2, rel=0.04)


def test_a_third_motion_begins_with_the_memories_of_both():
    # bent by 2.5, let go; then bent on to 3.2: as in one motion without the pause
    turn = ramps([0.0, 1.0, 3.0, 4.0], [0.0, 2.5, 2.5, 3.2])
    whole = predict(bending(turn, 6.0))
    first = predict(bending(turn, 3.0))
    later = Grasp(u=1.0, hold="tangent", path=_later(turn, 3.0, 6.0))
    second = predict(replace(bending(turn, 3.0), shape=first.shape_at(), grasps=(replace(HELD, hold="tangent"), later)))
    assert whole.material is not None
    assert second.material is not None
    once, twice = (np.linalg.norm(p.material.memory[-1, :, :2], axis=-1) for p in (whole, second))  # type: ignore[union-attr]
    np.testing.assert_allclose(twice, np.interp(second.material.u, whole.material.u, once), rtol=0.01)
    np.testing.assert_allclose(once, (3.2 - LIMIT) / 1.1, rtol=0.01)


def _later(turn: Turn, start: float, end: float) -> Waypoints:
    """Return the path of `rolling` from `start` on, its clock set back."""
    return rolling(lambda t: turn(np.asarray(t) + start), end - start)


def turned_scene(scene: Scene, frame: Floats) -> Scene:
    """Return a scene of `bending` seen in another frame."""
    turn = Rotation.from_matrix(frame)
    grasps = []
    for g in scene.grasps:
        if isinstance(g.path, Waypoints):
            q = Rotation.from_quat(np.asarray(g.path.orientations)[:, [1, 2, 3, 0]])
            there = (turn * q * turn.inv()).as_quat()[:, [3, 0, 1, 2]]
            path = Waypoints(times=g.path.times, positions=np.asarray(g.path.positions) @ frame.T, orientations=there)
            grasps.append(replace(g, path=path))
        else:
            grasps.append(g)
    return replace(scene, grasps=tuple(grasps), shape=Straight(direction=frame @ [1.0, 0.0, 0.0]))


VERTICAL = Rotation.from_rotvec([np.pi / 2, 0, 0]).as_matrix()
TILTED = Rotation.from_rotvec([0.7, -0.4, 0.5]).as_matrix()


@pytest.mark.parametrize("frame", [VERTICAL, TILTED], ids=["vertical", "tilted"])
def test_a_bend_in_any_plane_is_remembered_alike(frame):
    # clamped: a cable held in position and direction only would rather spin half a turn than yield the other way
    turn = ramps([0.0, 0.8, 1.6], [0.0, 2.5, -1.5])
    flat = bending(turn, 2.0)
    flat = replace(flat, grasps=tuple(replace(g, hold="clamp") for g in flat.grasps))
    spatial = turned_scene(flat, frame)
    # a weight of 1e-9 of the bending forces across the plane makes it a motion in space
    across = frame @ [0.0, 0.0, 1e-8]
    spatial = replace(spatial, environment=Environment(gravity=across))
    a, b = predict(flat), predict(spatial)
    assert a.status == b.status == "converged", (a.message, b.message)
    assert b.accuracy.dimensions == 3
    u = np.linspace(0.0, 1.0, 33)
    t = np.linspace(0.0, 2.0, 17)
    np.testing.assert_allclose(b.surface.positions(u, t), a.surface.positions(u, t) @ frame.T, atol=1e-4)
    (times, one), (_, other) = bend_memory(a), bend_memory(b)
    np.testing.assert_allclose(other, one, atol=2e-3 * LIMIT)  # other steps of Newton's iterations in space
    assert len(times) == len(one)


def test_turning_a_clamp_turns_the_remembered_bend_with_the_sections():
    shape = bent_and_released().shape_at()
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=(np.pi / 2, 0.0, 0.0), duration=2.0)
    scene = Scene(
        cable=cable(**YIELDS),
        shape=shape,
        grasps=(Grasp(u=0.0, hold="clamp", path=turn),),
        environment=WEIGHTLESS,
        horizon=2.5,
    )
    found = equilibrium(scene, at=2.0, n_u=17)
    assert found.status == "converged", found.message
    u = np.linspace(0.0, 1.0, 33)
    start = equilibrium(scene, at=0.0, n_u=17).positions(u)
    about_x = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0]).as_matrix()
    # a free cable turns with the only thing that holds it, as a rigid body
    np.testing.assert_allclose(found.positions(u), start @ about_x.T, atol=1e-3)
    assert np.ptp(start[:, 1]) > 0.3  # it is bent indeed
    moved = predict(replace(scene, effects={"inertia": "off"}, quality=march(17, 31)))
    np.testing.assert_allclose(moved.surface.positions(u, [2.5])[0], start @ about_x.T, atol=5e-3)


def test_twist_is_remembered_as_the_same_law():
    limit, rotation, GJ = 2.0, 5.0, 2e-3
    yields = {"yield_twist": limit * 0.005 / 2, "memory_rate": 8.0, "hardening": 0.1}
    rod = cable(bending_stiffness=0.5, torsional_stiffness=GJ, **yields)
    spin = Move(displacement=(0.0, 0.0, 0.0), rotation=(rotation, 0.0, 0.0), duration=1.0)
    far = Grasp(u=1.0, hold="clamp", path=spin, release_time=3.0)
    scene = Scene(
        cable=rod,
        shape=Straight(),
        grasps=(HELD, far),
        environment=WEIGHTLESS,
        horizon=4.0,
        quality=march(9, 81),
        effects={"inertia": "off"},
    )
    found = predict(scene)
    assert found.status == "converged", found.message
    kept = (rotation - limit) / 1.1
    g = found.grasps[1]
    held = (g.times > 2.5) & (g.times < 2.99)
    np.testing.assert_allclose(g.moment[held, 0], GJ * (rotation - kept), rtol=1e-3)  # exp(-8.8 x 1.5) is left
    assert found.material is not None
    np.testing.assert_allclose(found.material.memory[-1, :, 2], kept, rtol=1e-3)
    theta = found.surface([0.0, 1.0], [4.0])[0, :, 3]
    assert theta[1] - theta[0] == pytest.approx(kept, rel=1e-3)  # what stays after release


def stretched() -> tuple[Prediction, float]:
    """Return a cable pulled by 4 per mille for long, and the stress-free strain that it then has by the law."""
    limit, pull = 1e-3, 4e-3
    yields = {"yield_stretch": limit, "memory_rate": 8.0, "hardening": 0.1}
    far = Grasp(u=1.0, path=Move(displacement=(pull, 0.0, 0.0), duration=1.0))
    scene = Scene(
        cable=cable(axial_stiffness=1e3, **yields),
        shape=Straight(),
        grasps=(Grasp(u=0.0), far),
        environment=WEIGHTLESS,
        horizon=3.0,
        effects={"inertia": "off"},
        quality=march(5, 81),
    )
    return predict(scene), (pull - limit) / 1.1


def test_stretch_yields_by_the_same_law():
    found, kept = stretched()
    np.testing.assert_allclose(found.grasps[1].reaction[-1], [1e3 * (4e-3 - kept), 0, 0], atol=1e-3)  # of 1.27 N
    g = found.grasps[1]
    pull = ramps([0.0, 1.0], [0.0, 4e-3])
    fine = np.linspace(0.0, 3.0, 601)
    law = remembered(lambda t: float(pull(np.array(t))), fine, limit=1e-3, rate=8.0, hardening=0.1)
    at = np.interp(g.times, fine, 1e3 * (pull(fine) - law))
    np.testing.assert_allclose(g.reaction[:, 0], at, atol=5e-3)  # of 1.8 N: what a step's extrapolation leaves


def test_a_remembered_stretch_is_told():
    found, kept = stretched()
    assert found.material is not None
    np.testing.assert_allclose(found.material.stretch[-1], kept, rtol=1e-3)  # exp(-8.8 x 2) is left
