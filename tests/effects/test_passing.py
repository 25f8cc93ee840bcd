"""A cable does not pass through what is in its way: not in a step, not as its start settles, however thin it is."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from benchmarks.hard.generator import draw
from dlocore import (
    Box,
    Cable,
    Capsule,
    Environment,
    Grasp,
    Move,
    Points,
    Quality,
    Scene,
    Sphere,
    Straight,
    equilibrium,
    predict,
)
from dlocore.kernels.assembly import contact_energy
from dlocore.kernels.contact import passes
from dlocore.problem.discretisation import make_grid
from dlocore.problem.plane import rest_plane
from dlocore.problem.problem import Problem, pose
from dlocore.scene.obstacles import Obstacle
from dlocore.solvers.monitor import Monitor
from dlocore.spline import design_matrix
from dlocore.stability.sideways import is_unstable, slipping_across
from dlocore.statics.statics import start_grid
from tests.effects.test_contact import saddle
from tests.solver.scenes import Floats

RADIUS = 0.0025  # [m] of the cables here


def wire(bending: float = 1e-3) -> Cable:
    return Cable(length=1.0, diameter=2.0 * RADIUS, linear_density=0.05, bending_stiffness=bending)


def bar(x: float, z: float, radius: float) -> Capsule:
    return Capsule(start=(x, -0.3, z), end=(x, 0.3, z), radius=radius)


def turned(r: Floats, x: float, z: float) -> Floats:
    """Return the angle (k,) by which curves r (k, n, 3) turn about the y-axis through (x, z) from end to end."""
    angle = np.unwrap(np.arctan2(r[..., 2] - z, r[..., 0] - x), axis=1)
    return np.asarray(angle[:, -1] - angle[:, 0])


def largest_turn_in_a_step(r: Floats, x: float, z: float) -> float:
    """Return by how much `turned` changes from one curve to the next, at most: 2 pi where they pass through (x, z)."""
    return float(np.abs(np.diff(turned(r, x, z))).max())


# --- in a step ---


def ways(problem: Problem, before: Floats, after: Floats) -> bool:
    """Tell whether a straight cable goes through something from where its ends are `before` to `after` (2, 3) [m]."""
    grid = make_grid(problem, 9)
    along = np.linspace(0.0, 1.0, 9)[:, None]
    states = [(1.0 - along) * ends[0] + along * ends[1] - problem.plane.origin for ends in (before, after)]
    return bool(passes(3, *states, grid.tables.contact, problem.laws[1], grid.tables.contact.w))


SOLIDS: dict[str, Obstacle] = {
    "bar": bar(0.5, 0.0, 0.002),
    "ball": Sphere(center=(0.5, 0.0, 0.0), radius=0.01),
    "plate": Box(center=(0.5, 0.0, 0.0), size=(0.3, 0.3, 0.002)),
}


@pytest.mark.parametrize("solid", SOLIDS)
@settings(deadline=None, max_examples=50)
@given(above=st.floats(0.02, 2.0), below=st.floats(0.02, 2.0), tilt=st.floats(-0.01, 0.01))
def test_a_step_through_a_solid_is_seen_and_one_that_ends_on_it_or_beside_it_is_none(
    solid: str, above: float, below: float, tilt: float
) -> None:
    around = Environment(obstacles=(SOLIDS[solid],))
    scene = Scene(cable=wire(), shape=Straight(start=(0.0, 0.0, 1.0)), environment=around, horizon=1.0)
    problem = pose(scene, {"obstacles": "it goes through them"})
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    up = np.array([0.0, 0.0, 1.0])
    before = ends + (above + np.array([[-tilt], [tilt]])) * up
    assert ways(problem, before, ends - (below + np.array([[tilt], [-tilt]])) * up)
    top = {"bar": 0.002, "ball": 0.01, "plate": 0.001}[solid] + RADIUS
    assert not ways(problem, before, ends + (top - 0.1 * RADIUS) * up)
    assert not ways(problem, ends + top * up, before)
    beside = np.array([0.0, 0.5, 0.0])
    assert not ways(problem, before + beside, ends + beside - below * up)


def carried_past(radius: float) -> Scene:
    """Return a cable that hangs from a gripper, which carries it past a thin bar."""
    path = Move(displacement=(0.8, 0.0, 0.0), duration=2.0)
    return Scene(
        cable=wire(),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, path=path),),
        environment=Environment(drag=0.1, obstacles=(bar(0.5, -0.6, radius),)),
        horizon=2.0,
    )


def test_a_cable_is_not_carried_through_a_thin_bar() -> None:
    # two grids had agreed on a motion through it, to 0.1 % of the length
    prediction = predict(carried_past(0.002))
    assert prediction.status == "converged"
    r = prediction.surface.positions(np.linspace(0.0, 1.0, 201), np.linspace(0.0, 2.0, 201))
    assert largest_turn_in_a_step(r, 0.5, -0.6) < 1.0
    assert np.linalg.norm(r[..., [0, 2]] - [0.5, -0.6], axis=-1).min() > 0.9 * (0.002 + RADIUS)


def test_the_reference_does_not_carry_it_through_either() -> None:
    scene = carried_past(0.002)
    found = [predict(scene), predict(replace(scene, quality=Quality(method="reference", target_error=1e-2)))]
    assert [p.status for p in found] == ["converged"] * 2
    a, b = (p.surface.positions(np.linspace(0.0, 1.0, 65), np.linspace(0.0, 2.0, 33)) for p in found)
    assert np.linalg.norm(a - b, axis=-1).max() <= sum(cast(float, p.accuracy.error_estimate) for p in found)


@pytest.mark.parametrize("z", [-0.3, -0.665])
def test_coarse_steps_swing_through_no_bar_nor_past_it_unseen(z: float) -> None:
    # from the horizontal; what is farther than 0.1 L from the start is there once the motion comes to it
    scene = Scene(
        cable=wire(),
        shape=Straight(),
        grasps=(Grasp(u=0.0),),
        environment=Environment(drag=0.05, obstacles=(bar(0.0, z, 0.002),)),
        horizon=1.0,
        quality=Quality(n_u=9, n_t=13, method="march", keep_grid=True),
    )
    prediction = predict(scene)
    assert next(e.active for e in prediction.effects if e.name == "obstacles")
    level = prediction.level
    assert level is not None
    grid, motion = level.motion.grid, level.motion
    marched = np.einsum("ui,kid->kud", design_matrix(grid.knots, np.linspace(0.0, 1.0, 401)), motion.states)
    world = level.problem.plane.world(marched[..., :3])[: motion.reached + 1]
    with_bar = largest_turn_in_a_step(world, 0.0, z)
    through = predict(replace(scene, effects={"obstacles": "off"})).surface.positions(
        np.linspace(0.0, 1.0, 401), np.linspace(0.0, 1.0, 401)
    )
    assert with_bar < 3.0 < largest_turn_in_a_step(through, 0.0, z)


# --- as a start settles ---


def bridge(half: float, **changes: Any) -> Scene:
    """Return a cable in a parabola above two points 2 `half` apart at the height 0.3 m; it settles."""
    x = np.linspace(-half, half, 41)

    def too_long(rise: float) -> float:
        steps = np.diff(np.column_stack([x, rise * (1.0 - (x / half) ** 2)]), axis=0)
        return float(np.linalg.norm(steps, axis=1).sum()) - 1.0

    rise = brentq(too_long, 0.0, 1.0)
    points = np.column_stack([x, 0.0 * x, 0.3 + rise * (1.0 - (x / half) ** 2)])
    values: dict[str, Any] = {
        "cable": wire(),
        "shape": Points(points=points, settle=True),
        "grasps": (Grasp(u=0.0, hold="point"), Grasp(u=1.0, hold="point")),
        "horizon": 1.0,
    }
    return Scene(**(values | changes))


# bending stiffness, half of the span, and x, z and radius of a bar under the arc: relaxations had taken the cable
# through it, on some grids or on all
BARS = [
    (2.206e-4, 0.3208, -0.1988, 0.1966, 0.007607),
    (1.213e-4, 0.3854, 0.1755, 0.1897, 0.009912),
    (1.343e-4, 0.2913, 0.07864, 0.5367, 0.00767),
    (1.625e-4, 0.3814, 0.1043, 0.2368, 0.005049),
    (8.857e-4, 0.3598, 0.0661, 0.2597, 0.007614),
]


@pytest.mark.parametrize(("bending", "half", "x", "z", "radius"), BARS)
def test_a_start_settles_over_what_is_below_it(bending: float, half: float, x: float, z: float, radius: float) -> None:
    around = Environment(drag=0.1, obstacles=(bar(x, z, radius),))
    scene = bridge(half, cable=wire(bending), environment=around)
    problem = pose(scene)
    assert problem.obstacles
    u = np.linspace(0.0, 1.0, 401)
    for n_u in (9, 13, 28):
        grid = start_grid(problem, n_u, Monitor())
        shape = problem.plane.world((design_matrix(grid.knots, u) @ grid.start)[:, :3])
        assert turned(shape[None], x, z)[0] < 0.0, f"{n_u} control points"
    at_rest = equilibrium(scene).positions(u)
    assert turned(at_rest[None], x, z)[0] < 0.0


def test_a_start_meets_what_it_reaches_only_as_it_settles() -> None:
    # seed 23, scene 10: a hairpin along x over a bar 0.13 L below its legs; it hangs down beyond the bar, and had been
    # let fall past it to below the grips, at x = 0
    scene = replace(draw(23, 10).make(), effects={"self_contact": "off"})
    problem = pose(scene)
    assert problem.obstacles
    for n_u in (28, 61):
        grid = start_grid(problem, n_u, Monitor())
        middle = problem.plane.world((design_matrix(grid.knots, [0.5]) @ grid.start)[:, :3])[0]
        assert middle[0] > 0.08
        assert middle[2] == pytest.approx(-0.435, abs=0.01)


@pytest.mark.parametrize("n_u", [13, 28, 61])
def test_a_start_does_not_sink_through_a_wire_while_contact_is_soft(n_u: int) -> None:
    # all of its weight on a wire: with the contact that bears the weight of a cable on a table it had sunk through
    wire_below = replace(bar(0.0, 0.0, 0.003257), friction=0.3)
    bend, held = 0.003257 + RADIUS + 0.001, 0.5424
    laid_over = saddle(bend, held, 1.0 - held - np.pi * bend)
    scene = Scene(
        cable=wire(4.129e-4),
        shape=Points(points=laid_over, settle=True),
        grasps=(Grasp(u=0.0, hold="point"),),
        environment=Environment(drag=0.1, obstacles=(wire_below,)),
        horizon=1.0,
        effects={"self_contact": "off"},
    )
    problem = pose(scene)
    grid = start_grid(problem, n_u, Monitor())
    end = problem.plane.world((design_matrix(grid.knots, [1.0]) @ grid.start)[:, :3])[0]
    assert end[2] == pytest.approx(-0.396, abs=0.01)  # 1.54 m below the bar where it has sunk through it


def test_what_no_held_point_reaches_is_left_out() -> None:
    far = bar(0.0, -0.4, 0.005)  # 0.75 m below the grips, of which half of the cable reaches 0.37 m
    near = bar(0.0, 0.0, 0.005)
    scene = bridge(0.3208, environment=Environment(obstacles=(far, near)))
    assert pose(scene).obstacles == (near,)
    assert pose(replace(scene, shape=replace(scene.shape, settle=False))).obstacles == ()


def test_nodes_on_something_thin_are_close_enough_for_all_grids_to_rest_at_one_place() -> None:
    # slanting and smooth: nodes a diameter apart held the cable wherever one lay on the bar, up to 8 mm apart
    thin = Capsule(start=(-0.1504, -0.3914, 0.5273), end=(0.0149, 0.3914, 0.5273), radius=0.003036)
    problem = pose(bridge(0.40328, cable=wire(3.056e-3), environment=Environment(drag=0.1, obstacles=(thin,))))
    u = np.linspace(0.0, 1.0, 65)
    shapes = []
    for n_u in (13, 19, 28, 61):
        grid = start_grid(problem, n_u, Monitor())
        shapes.append(design_matrix(grid.knots, u) @ grid.start[:, :3])
    assert max(np.linalg.norm(shape - shapes[-1], axis=1).max() for shape in shapes) < 3e-3


# --- and slips off to the side ---


def over_a_ball(friction: float, **changes: Any) -> Scene:
    ball = Sphere(center=(0.0, 0.0, 0.45), radius=0.02, friction=friction)
    return bridge(0.3208, environment=Environment(drag=0.2, obstacles=(ball,)), **changes)


def test_a_cable_does_not_rest_on_top_of_a_smooth_ball() -> None:
    problem = pose(over_a_ball(0.0))
    grid = start_grid(problem, 28, Monitor())
    assert is_unstable(problem, grid, grid.start, 0.0, grid.history)
    # the term that the ball adds is the second difference of the energy of contact
    normal = np.cross(*rest_plane(problem.scene, problem.start).axes)
    w = np.random.default_rng(1).normal(size=grid.n_u)
    band = slipping_across(problem, grid, grid.start[None])[0]
    quadratic = w @ (band[:, 0] * w) + 2.0 * sum(w[m:] @ (band[:-m, m] * w[:-m]) for m in (1, 2, 3))
    step = 1e-6

    def energy(s: float) -> float:
        moved = grid.start + s * w[:, None] * normal
        return float(contact_energy(problem.axes, moved, grid.tables, *problem.laws))

    difference = (energy(step) - 2.0 * energy(0.0) + energy(-step)) / step**2
    assert quadratic < 0.0
    assert quadratic == pytest.approx(difference, rel=1e-3)


def test_it_hangs_beside_the_ball_and_the_message_says_why() -> None:
    prediction = predict(over_a_ball(0.0))
    assert prediction.status == "converged"
    assert "in its plane the motion is unstable" in prediction.message
    middle = prediction.surface.positions([0.5], [0.0])[0, 0]
    assert middle[2] < 0.0  # 0.3 m below the grips


def test_a_start_that_settles_stands_on_no_edge_though_the_motion_is_no_planar_one() -> None:
    # a heavy arch, clamped upright, whose gripper then moves to the side: it had stood until it did
    path = Move(displacement=(0.0, 0.1, 0.0), duration=1.0)
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=path))
    scene = bridge(0.2259, cable=wire(2e-3), grasps=grasps, environment=Environment(drag=0.2))
    found = [predict(replace(scene, quality=Quality(method=m, target_error=3e-3))) for m in ("march", "reference")]
    starts = [p.surface.positions(np.linspace(0.0, 1.0, 65), [0.0]).reshape(-1, 3) for p in found]
    assert np.abs(starts[0][:, 1]).max() > 0.2
    assert np.linalg.norm(starts[0] - starts[1], axis=1).max() < 3e-3
