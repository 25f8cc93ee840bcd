"""Twist and clamps against closed forms (docs/model.md): Kirchhoff's rod, link = twist + writhe."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dlocore import (
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Waypoints,
    equilibrium,
    predict,
)
from tests.effects.twisting import EI, GJ, START, STIFF, bowed, spline, total_twist
from tests.solver.scenes import WEIGHTLESS, Floats, arc, cable, march, samples


def turned(about: Floats, angles: Floats) -> Floats:
    """Return unit quaternions (n, 4) w, x, y, z of the rotations by `angles` (n,) [rad] about a unit vector."""
    return Rotation.from_rotvec(angles[:, None] * about).as_quat()[:, [3, 0, 1, 2]]


def spun(rotation: float, **changes: Any) -> Scene:
    """Return a straight cable along x in balance, clamped at both ends, one spun by `rotation` [rad] in 1 s."""
    far = Grasp(u=1.0, hold="clamp", path=Move(displacement=(0.0, 0.0, 0.0), rotation=(rotation, 0, 0), duration=1.0))
    values: dict[str, Any] = {"cable": cable(**STIFF), "grasps": (START, far), "horizon": 1.5, "quality": march(9, 31)}
    values["effects"] = {"inertia": "off"}  # no waves of twist: the sections have a rotary inertia
    return Scene(shape=Straight(), environment=WEIGHTLESS, **(values | changes))


@pytest.mark.parametrize("rotation", [0.5, -2.0, 20 * np.pi])
def test_a_straight_rod_carries_gj_theta_over_l_everywhere(rotation):
    found = predict(spun(rotation))
    assert found.status == "converged", found.message
    assert next(e for e in found.effects if e.name == "twist").active
    u, t = np.linspace(0.0, 1.0, 33), np.array([1.0, 1.25, 1.5])
    theta = found.surface(u, t)[..., 3]
    # the time spline follows a path that ends at 1 s to a part in 1e5; after it and along the cable all is linear
    np.testing.assert_allclose(theta - theta[:, :1], np.tile(rotation * u, (3, 1)), atol=1e-4 * abs(rotation))
    np.testing.assert_allclose(theta[-1] - theta[-1, 0], rotation * u, atol=1e-9 * abs(rotation))
    np.testing.assert_allclose(found.surface(u, [1.5], du=1)[0, :, 3], rotation, rtol=1e-8)
    np.testing.assert_allclose(found.grasps[1].moment[-1], [GJ * rotation, 0, 0], atol=1e-9 * GJ * abs(rotation))
    np.testing.assert_allclose(found.grasps[0].moment[-1], [-GJ * rotation, 0, 0], atol=1e-9 * GJ * abs(rotation))
    straight = found.surface.positions(u, t) - np.column_stack([u, 0 * u, 0 * u])
    assert np.abs(straight).max() < 1e-9  # nothing bends it: rounding


def test_twist_follows_its_gripper_at_every_moment_of_ten_turns_and_back():
    def angle(t: Floats) -> Floats:
        return np.asarray(10 * np.pi * (1 - np.cos(np.pi * t / 2)))  # 0, 10 turns at 2 s, 0 at 4 s

    times = np.linspace(0.0, 4.0, 161)  # it turns by less than pi between two of them
    about_x = turned(np.array([1.0, 0, 0]), angle(times))
    there_and_back = Waypoints(times=times, positions=np.tile([1.0, 0, 0], (161, 1)), orientations=about_x)
    far = Grasp(u=1.0, hold="clamp", path=there_and_back)
    found = predict(spun(0.0, grasps=(START, far), horizon=4.0, quality=march(9, 81)))
    assert found.status == "converged", found.message
    t = samples(found.surface, 2, 65)[1]
    # a time spline of 0.05 s spans follows a period of 4 s to 1e-5 of it; the path's spline is as near at its waypoints
    np.testing.assert_allclose(total_twist(found), angle(t), atol=2e-5 * 20 * np.pi)
    g = found.grasps[1]
    # the steps, 0.01 s, report a moment to a part in 1e4 of the largest
    np.testing.assert_allclose(g.moment[:, 0], GJ * angle(g.times), atol=2e-3 * GJ * 20 * np.pi)
    assert abs(g.moment[-1, 0]) < 1e-6 * GJ * 20 * np.pi


@pytest.mark.parametrize("rotation", [1.0, 20 * np.pi])
def test_equilibrium_stores_half_gj_theta_squared_over_l(rotation):
    found = equilibrium(spun(rotation), at=1.0, n_u=9)
    assert found.status == "converged", found.message
    assert found.energy == pytest.approx(0.5 * GJ * rotation**2, rel=1e-9)
    assert total_twist(found) == pytest.approx(rotation, rel=1e-9)
    np.testing.assert_allclose(found.moments[1], [GJ * rotation, 0, 0], atol=1e-9 * GJ * rotation)
    np.testing.assert_allclose(found.moments[0], -found.moments[1], atol=1e-9 * GJ * rotation)


def test_torsional_damping_resists_the_rate_of_twist():
    # M = GJ theta' + eta theta'˙: at constant speed a constant more, gone when the gripper stops
    eta, rotation = 3e-4, 2.0
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=(rotation, 0, 0), duration=1.0, profile="linear")
    damped = cable(**STIFF, torsional_damping=eta)
    found = predict(spun(0.0, cable=damped, grasps=(START, Grasp(u=1.0, hold="clamp", path=turn))))
    g = found.grasps[1]
    turning = (g.times > 0.2) & (g.times < 0.95)
    expected = GJ * rotation * g.times[turning] + eta * rotation
    np.testing.assert_allclose(g.moment[turning, 0], expected, rtol=1e-4)  # linear in time: backward differences exact
    assert g.moment[-1, 0] == pytest.approx(GJ * rotation, rel=1e-6)


def test_grasps_of_position_and_direction_leave_the_twist_free():
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=(2.0, 0.0, 0.0), duration=1.0)
    found = predict(spun(0.0, grasps=(START, Grasp(u=1.0, hold="tangent", path=turn))))
    u, t = samples(found.surface)
    assert np.abs(found.surface(u, t, du=1)[..., 3]).max() < 1e-12  # nothing holds a twist: exactly none
    assert max(np.abs(g.moment).max() for g in found.grasps) < 1e-12


def test_a_clamp_inside_turns_against_the_twist_of_both_sides():
    rotation, place = 1.2, 0.3
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=(rotation, 0.0, 0.0), duration=1.0)
    grasps = (START, Grasp(u=place, hold="clamp", path=turn), Grasp(u=1.0, hold="clamp"))
    found = predict(spun(0.0, grasps=grasps, quality=march(25, 31)))
    assert found.status == "converged", found.message
    left, right = GJ * rotation / place, GJ * rotation / (1 - place)
    moments = [g.moment[-1, 0] for g in found.grasps]
    np.testing.assert_allclose(moments, [-left, left + right, -right], rtol=0.001)
    theta = found.surface([0.0, 0.15, 0.3, 0.65, 1.0], [1.5])[0, :, 3]
    # linear on each side with a kink at the clamp
    np.testing.assert_allclose(theta - theta[0], rotation * np.array([0.0, 0.5, 1.0, 0.5, 0.0]), atol=0.01 * rotation)


def twisted_straight(twist: float, **changes: Any) -> Scene:
    """Return a straight cable that starts with `twist` [rad] between its clamps."""
    u = np.linspace(0.0, 1.0, 9)
    r = np.column_stack([u, 0 * u, 0 * u])
    shape = spline(u, r, r[-1], r[-1], twist * u)
    values: dict[str, Any] = {"cable": cable(**STIFF), "grasps": (START, Grasp(u=1.0, hold="clamp")), "horizon": 1.0}
    return Scene(shape=shape, environment=WEIGHTLESS, **(values | changes))


@pytest.mark.parametrize("hold", ["clamp", "tangent"])
def test_a_bent_wire_turned_by_its_middle_converges_with_the_square_of_the_span(hold: str):
    # its sections' angle has a kink where the gripper holds it: with a smooth one 19 points were 50 mm off, 62 were 10
    bent = cable(rest_shape="initial")
    move = Move(displacement=(-0.1, 0.1, -0.1), rotation=(0.3, -0.4, 0.2), duration=0.9)
    scene = Scene(
        cable=bent,
        shape=Points(points=arc(1.0, 2.0)),
        grasps=(Grasp(u=0.6, hold=hold, path=move),),
        environment=Environment(drag=0.1),
        effects={"self_contact": "off"},
    )
    found = [predict(replace(scene, quality=march(n_u, 60))) for n_u in (19, 38, 76)]
    u, t = samples(found[0].surface, 65, 33)
    coarse, middle, fine = (prediction.surface.positions(u, t) for prediction in found)
    errors = [np.linalg.norm(x - fine, axis=-1).max() for x in (coarse, middle)]
    assert errors[0] < 6e-3
    assert errors[1] < errors[0] / 4.0


def test_only_the_angle_of_the_sections_has_a_kink():
    # a gripper takes the wire by its middle, turns it against its clamped end and lets go of it
    turn = Move(displacement=(0.0, 0.05, 0.0), rotation=(1.0, 0.2, 0.0), duration=0.3)
    grasps = (START, Grasp(u=0.4, hold="clamp", grasp_time=0.2, release_time=0.6, path=turn))
    wire = cable(bending_stiffness=0.02, rest_shape="initial")
    shape = Points(points=arc(1.0, 0.5))
    found = predict(Scene(cable=wire, shape=shape, grasps=grasps, environment=WEIGHTLESS, quality=march(21, 41)))
    assert found.status == "converged", found.message
    times = np.linspace(0.0, found.surface.horizon, 33)
    before, after = (found.surface([u], times, du=1)[:, 0] for u in (np.nextafter(0.4, 0.0), 0.4))
    assert np.abs(after - before)[:, :3].max() < 1e-9
    assert np.abs(after - before)[:, 3].max() > 0.1


@pytest.mark.parametrize("hold", ["clamp", "tangent"])
@pytest.mark.parametrize("n_u", [13, 21, 41])
def test_sections_turn_smoothly_about_a_double_knot(hold: str, n_u: int):
    # a stiff arc that is turned by its middle hardly bends; mean twist rates leave angles free to oscillate there
    bent = cable(bending_stiffness=0.05, rest_shape="initial")
    move = Move(displacement=(0.0, 0.0, 0.1), rotation=(0.6, 0.5, 0.4), duration=1.0)
    grasps = (Grasp(u=0.4, hold=hold, path=move),)
    shape = Points(points=arc(1.0, 2.0))
    found = predict(Scene(cable=bent, shape=shape, grasps=grasps, environment=WEIGHTLESS, quality=march(n_u, 31)))
    u, t = samples(found.surface, 201, 13)
    theta = found.surface(u, t)[..., 3]
    assert np.ptp(theta, axis=1).max() < 0.05
    stored = found.energies(t)
    assert max(stored["bend"].max(), stored["kinetic"].max()) < 0.1 * 0.5 * 0.05 * 2.0**2


def test_a_cable_may_start_twisted():
    found = predict(twisted_straight(3.0, quality=march(9, 31)))
    assert found.start_energy == pytest.approx(0.5 * GJ * 3.0**2, rel=1e-9)
    np.testing.assert_allclose(total_twist(found), 3.0, rtol=1e-9)  # the clamps hold it
    # Newton's tolerance, 3e-7 L on theta times the radius of gyration, is 2e-4 rad: waves of that size
    np.testing.assert_allclose(found.grasps[1].moment[:, 0], 3.0 * GJ, rtol=1e-3)


def test_a_released_twist_swings_with_the_rotary_inertia_of_a_round_section():
    # waves of speed sqrt(GJ/(mu D^2/8)): from a uniform twist the free end goes to and fro as a triangle
    weak, diameter = 1e-4, 0.02
    rod = cable(bending_stiffness=0.1, torsional_stiffness=weak, diameter=diameter)
    period = 4.0 / np.sqrt(weak / (0.05 * diameter**2 / 8))
    far = Grasp(u=1.0, hold="clamp", release_time=0.25 * period)
    scene = twisted_straight(1.0, cable=rod, grasps=(START, far), horizon=2.25 * period, quality=march(25, 257))
    found = predict(scene)
    assert found.status == "converged", found.message
    t = np.linspace(0.25, 2.25, 161) * period
    theta = found.surface([0.0, 1.0], t)[..., 3]
    swing = np.abs(np.mod(2 * (t / period - 0.25), 2.0) - 1.0) * 2 - 1
    # corners are rounded by the spline and by the march's numerical damping of what it does not resolve
    off = theta[:, 1] - theta[:, 0] - swing
    assert np.sqrt((off**2).mean()) < 0.03
    assert np.abs(off).max() < 0.12


def holonomy(tangents: Floats, director: Floats) -> Floats:
    """Return `director` (3,) transported without twist along unit tangents (n, 3), by the least rotations between."""
    for a, b in pairwise(tangents):
        axis = np.cross(a, b)
        cos = a @ b
        director = cos * director + np.cross(axis, director) + axis * (axis @ director) / (1 + cos)
    return director


def link(found: Prediction, at_u: tuple[float, float], t: Floats) -> Floats:
    """Return the twist [rad] between two grippers at the times t (k,) by geometry alone, continuous from that at t[0].

    The director that the first gripper holds is transported along the tangents to the second gripper; the angle from
    there to the director which the second one holds is the twist of the cable between them.
    """
    paths = [next(g.path for g in found.scene.grasps if g.u == u) for u in at_u]
    turns = [path.rotation_at(t) for path in paths]
    u = np.linspace(*at_u, 2001)
    slopes = found.surface(u, t, du=1)[..., :3]
    tangents = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    theta = found.surface(list(at_u), t[:1])[0, :, 3]
    first = np.cross(tangents[0, 0], np.roll(tangents[0, 0], 1))
    first /= np.linalg.norm(first)
    last = Rotation.from_rotvec((theta[1] - theta[0]) * tangents[0, -1]).apply(holonomy(tangents[0], first))
    angles = []
    for k, row in enumerate(tangents):
        a = first if turns[0] is None else turns[0][k] @ first
        b = last if turns[1] is None else turns[1][k] @ last
        moved = holonomy(row, a)
        angles.append(np.arctan2(np.cross(moved, b) @ row[-1], moved @ b))
    return np.unwrap(angles) + 2 * np.pi * np.round((theta[1] - theta[0] - angles[0]) / (2 * np.pi))


def test_twist_turns_into_a_loop_while_the_link_of_the_grippers_stays():
    # a straight cable with one turn of twist; its ends come together without turning
    scene = Scene(
        cable=cable(torsional_stiffness=GJ),
        shape=bowed(2 * np.pi, 0.01),
        grasps=(START, Grasp(u=1.0, hold="clamp", path=Move(displacement=(-0.7, 0.0, 0.1), duration=4.0))),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.1),
        horizon=6.0,
        quality=march(25, 97),
    )
    found = predict(scene)
    assert found.status == "converged", found.message
    t = samples(found.surface, 2, 65)[1]
    twist = total_twist(found)
    assert twist[0] == pytest.approx(2 * np.pi, rel=1e-6)
    assert abs(twist[-1]) < 0.5 * 2 * np.pi  # most of it has become writhe: a loop
    # positions and twist are fitted in time apart: measured 5e-4 with time spans of 0.06 s
    np.testing.assert_allclose(twist, link(found, (0.0, 1.0), t), atol=3e-3)


def test_twist_is_what_link_and_holonomy_leave_when_grippers_turn_about_any_axis():
    near = Move(displacement=(0.0, 0.1, 0.0), rotation=(0.7, -0.8, 0.5), duration=1.5)
    far = Move(displacement=(-0.4, 0.2, 0.15), rotation=(5.0, 1.0, 2.0), duration=1.5)
    scene = Scene(
        cable=cable(torsional_stiffness=1.5 * GJ),
        shape=Points(points=arc(1.0, 0.8)),
        grasps=(Grasp(u=0.0, hold="clamp", path=near), Grasp(u=1.0, hold="clamp", path=far)),
        environment=Environment(drag=0.1),
        horizon=2.0,
        quality=march(25, 65),
    )
    found = predict(scene)
    assert found.status == "converged", found.message
    t = samples(found.surface, 2, 65)[1]
    # positions and twist are fitted in time apart: measured 1.3e-3 with time spans of 0.03 s
    np.testing.assert_allclose(total_twist(found), link(found, (0.0, 1.0), t), atol=3e-3)
    # statics of a naturally straight, round rod: its twist moment is the same everywhere
    end = found.surface([0.0, 1.0], [2.0], du=1)[0]
    for grasp, slope, side in zip(found.grasps, end, (-1, 1), strict=True):
        along = grasp.moment[-1] @ slope[:3] / np.linalg.norm(slope[:3])
        assert along == pytest.approx(side * 1.5 * GJ * slope[3], rel=1e-3)


def curved_cantilever(radius: float, angle: float, force: float, stiffness: dict[str, float]) -> Floats:
    """Return how the tip of a naturally curved cantilever in the x-y plane moves (3,) [m] under a force along z."""
    length = radius * angle
    r = arc(length, angle, 161)
    last = np.array([np.cos(angle), np.sin(angle), 0.0])
    u = np.linspace(0.0, length, 161)
    scene = Scene(
        cable=cable(length=length, diameter=0.005 * length, rest_shape="initial", **stiffness),
        shape=spline(u, r, np.array([1.0, 0, 0]), last, 0 * u),
        grasps=(START,),
        loads=(Load(u=length, force=(0.0, 0.0, force)),),
        environment=WEIGHTLESS,
        horizon=1.0,
    )
    found = equilibrium(scene, n_u=33)  # finer than its own choice: tips that move by less than its target are compared
    assert found.status == "converged", found.message
    return found.positions(length)[0] - r[-1]


def test_a_quarter_ring_bends_and_twists_out_of_its_plane_as_castigliano_says():
    # P R^3 (pi/4/EI + (3 pi/4 - 2)/GJ), half of it twist where GJ is small
    R, weak = 2 / np.pi, 2e-4
    force = 1e-4 * EI / R**2
    tip = curved_cantilever(R, np.pi / 2, force, {"bending_stiffness": EI, "torsional_stiffness": weak})
    expected = force * R**3 * (np.pi / 4 / EI + (3 * np.pi / 4 - 2) / weak)
    # the next terms are (P R^2/EI)^2; the answer is refined to 1e-4 L, here by far better
    assert tip[2] == pytest.approx(expected, rel=2e-3)


def test_bathes_45_degree_bend_under_600():
    # square section 1 x 1, E 1e7, nu 0: EI E/12, GJ 0.1406 E/2. Bathe and Bolourchi 1979, Simo and Vu-Quoc 1986
    stiffness = {"bending_stiffness": 1e7 / 12, "torsional_stiffness": 0.1406 * 5e6, "axial_stiffness": 1e7}
    tip = curved_cantilever(100.0, np.pi / 4, 600.0, stiffness)
    # published: 53.3 to 53.6 across, 13.4 to 13.7 and 23.3 to 23.9 in the plane
    np.testing.assert_allclose([tip[2], -tip[1], -tip[0]], [53.4, 13.5, 23.5], rtol=0.02)
    # Kirchhoff's equations by shooting, to all digits given; the answer is refined to 1e-4 L = 8 mm
    np.testing.assert_allclose(tip, [-23.8168, -13.7308, 53.6041], atol=8e-3)


TURN = Rotation.from_rotvec([0.3, -0.7, 1.9]).as_matrix()
MIRROR = np.diag([1.0, -1.0, 1.0])
SHIFT = np.array([3.0, -2.0, 0.5])


def wrung(frame: Floats = np.eye(3), shift: Floats = np.zeros(3), *, backwards: bool = False) -> Scene:  # noqa: B008
    """Return a cable wrung by two grippers under weight, seen in another frame, or counted from its other end."""
    axial = np.linalg.det(frame) * frame
    near = Move(displacement=frame @ [0.1, 0.05, 0.2], rotation=axial @ [-1.5, 0.2, 0.4], duration=0.8)
    far = Move(displacement=frame @ [-0.2, 0.1, 0.0], rotation=axial @ [3.0, 0.5, -0.3], duration=0.8)
    turned = np.linspace(0.0, 1.5, 41)
    radius = np.sqrt(1.0 / 1.5**2 - 0.2**2)  # of a helix of length 1
    points = np.column_stack([radius * np.sin(turned), radius * (np.cos(turned) - 1.0), 0.2 * turned])
    places = (1.0, 0.0) if backwards else (0.0, 1.0)
    return Scene(
        cable=cable(torsional_stiffness=2 * GJ, torsional_damping=1e-5, bending_damping=1e-4),
        shape=Points(points=(points[::-1] if backwards else points) @ frame.T + shift),
        grasps=tuple(Grasp(u=u, hold="clamp", path=p) for u, p in zip(places, (near, far), strict=True)),
        environment=Environment(gravity=frame @ [0.0, -3.0, 1.0], drag=0.1),
        quality=march(17, 25),
    )


@pytest.mark.parametrize(("frame", "shift"), [(TURN, SHIFT), (MIRROR, np.zeros(3))], ids=["rigid motion", "mirror"])
def test_a_twisted_motion_moves_with_the_scene(frame, shift):
    a, b = predict(wrung()), predict(wrung(frame, shift))
    assert a.status == b.status == "converged", (a.message, b.message)
    hand = np.linalg.det(frame)
    u, t = samples(a.surface)
    # rounding of 1e-16, amplified by stiff waves and by iterations
    np.testing.assert_allclose(b.surface.positions(u, t), a.surface.positions(u, t) @ frame.T + shift, atol=1e-8)
    assert np.abs(total_twist(a)).max() > 1.0
    np.testing.assert_allclose(total_twist(b), hand * total_twist(a), atol=1e-7)  # a mirror image twists the other way
    for g, h in zip(a.grasps, b.grasps, strict=True):
        np.testing.assert_allclose(h.reaction, g.reaction @ frame.T, atol=1e-6 * np.abs(g.reaction).max())
        np.testing.assert_allclose(h.moment, hand * g.moment @ frame.T, atol=1e-6 * np.abs(g.moment).max())


def test_a_twisted_motion_does_not_depend_on_the_direction_of_the_cable():
    a, b = predict(wrung()), predict(wrung(backwards=True))
    u, t = samples(a.surface)
    np.testing.assert_allclose(b.surface.positions(1.0 - u, t), a.surface.positions(u, t), atol=1e-8)  # rounding
    np.testing.assert_allclose(total_twist(b), total_twist(a), atol=1e-7)  # a right-handed twist is one from both ends


@pytest.mark.parametrize("method", ["march", "reference"])
def test_drag_resists_the_spin_of_the_sections(method):
    # spun steadily at one end, all of the cable spins alike: the gripper gives the torque c D^2/8 omega L
    thick = cable(diameter=0.02, bending_stiffness=1.0, torsional_stiffness=1.0)
    turn = Move(displacement=(0.0, 0.0, 0.0), duration=2.0, rotation=(3.0, 0.0, 0.0), profile="linear")
    quality = Quality(method="reference", target_error=1e-3) if method == "reference" else march(9, 33)
    scene = Scene(
        cable=thick,
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="clamp", path=turn),),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=50.0),
        effects={"twist": "on"},
        quality=quality,
    )
    found = predict(scene).grasps[0]
    late = found.times > 1.0
    expected = 50.0 * 0.02**2 / 8.0 * 1.5
    np.testing.assert_allclose(found.moment[late, 0], expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("quality", "told"),
    [
        (Quality(), True),
        (Quality(n_u=9, n_t=13), True),
        (Quality(n_u=9, n_t=13, method="spacetime"), True),
        (Quality(n_u=25, n_t=201), False),
    ],
)
def test_waves_of_twist_that_grids_do_not_show_are_told_of(quality: Quality, told: bool) -> None:
    # a hose of 20 m whose end is turned by half a turn in 0.2 s; the wave runs to and fro (d'Alembert)
    length, diameter, density, stiffness = 20.0, 0.02, 0.2, 0.08
    hose = cable(
        length=length, diameter=diameter, linear_density=density, bending_stiffness=0.1, torsional_stiffness=stiffness
    )
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=(np.pi, 0.0, 0.0), duration=0.2)
    ends = (Grasp(u=0.0, hold="clamp"), Grasp(u=length, hold="clamp", path=turn))
    found = predict(
        Scene(cable=hose, shape=Straight(), grasps=ends, horizon=1.0, environment=WEIGHTLESS, quality=quality)
    )
    assert found.status == "converged"
    assert any("two grids differ by up to" in note for note in found.notes) == told
    speed = np.sqrt(stiffness / (density * diameter**2 / 8.0))

    def turned_by(t: Floats) -> Floats:
        x = np.clip(t / 0.2, 0.0, 1.0)
        return np.asarray(np.pi * x**3 * (10.0 - 15.0 * x + 6.0 * x * x))

    t = np.linspace(0.0, 1.0, 101)
    way = 0.5 * length
    exact = sum(
        turned_by(t - (way + 2 * n * length) / speed) - turned_by(t - (length + way + 2 * n * length) / speed)
        for n in range(3)
    )
    off = np.abs(found.surface([way], t)[:, 0, 3] - exact).max()
    assert (off > 0.2) if told else (off < 0.1)
