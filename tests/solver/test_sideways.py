"""Planar motions that a disturbance out of their plane would grow in are solved in space, and others are not."""

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.hard.generator import draw
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Sphere,
    Straight,
    equilibrium,
    predict,
)
from dlocore.kernels.across import stiffness_across
from dlocore.kernels.assembly import NO_RATES, History, assemble
from dlocore.kernels.growth import AT_ONCE, LOOKS, looked_at
from dlocore.kernels.tension import COLUMNS
from dlocore.levels.level import Level, distance, run_level
from dlocore.levels.whole_march import sided
from dlocore.problem.buckling import UNSTABLE
from dlocore.problem.discretisation import make_grid, room_for
from dlocore.problem.plane import Plane
from dlocore.problem.problem import Problem, pose, stiffer
from dlocore.solvers.monitor import Monitor
from dlocore.stability.determined import DOUBTFUL
from dlocore.stability.sideways import is_unstable, pose_as_shown

Floats = NDArray[np.float64]

HEAVY = Environment(drag=0.1)
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0), drag=0.3)


def arch(angle: float, upward: bool) -> Floats:
    """Return points along an arc in the x-z plane whose ends are inclined by an angle [rad]."""
    turn = np.linspace(angle, -angle, 401) * (1.0 if upward else -1.0)
    middle = 0.5 * (turn[1:] + turn[:-1])
    x, z = (np.concatenate([[0.0], np.cumsum(f(middle))]) / 400 for f in (np.cos, np.sin))
    return np.column_stack([x, 0.0 * x, z])[::10]


def between(angle: float, upward: bool, hold: Any, around: Environment, closer: float, **changes: Any) -> Scene:
    """Return a cable between two grippers that come closer by a share of their distance."""
    points = arch(angle, upward)
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=changes.pop("stiffness", 1e-2))
    path = Move(displacement=(-closer * points[-1, 0], 0.0, 0.0), duration=2.0)
    grasps = (Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=path))
    shape = Points(points=points, settle=changes.pop("settle", False))
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=around, horizon=3.0, **changes)


def out_of_plane(p: Prediction) -> float:
    u, t = np.linspace(0.0, 1.0, 65), np.linspace(0.0, p.surface.horizon, 33)
    return float(np.abs(p.surface.positions(u, t)[..., 1]).max())


FALLS = between(1.0, True, "point", HEAVY, 0.0, stiffness=0.1)


@pytest.fixture(scope="module")
def fallen() -> Prediction:
    return predict(FALLS)


def test_an_arch_that_turns_freely_about_its_ends_falls_over(fallen: Prediction) -> None:
    assert fallen.status == "converged", fallen.message
    assert fallen.accuracy.dimensions == 3
    assert "in its plane the motion is unstable" in fallen.accuracy.dimensions_reason
    assert "in its plane the motion is unstable" in fallen.message
    assert "mirror image" in fallen.message
    assert out_of_plane(fallen) > 0.2


@pytest.mark.parametrize("noise", [1e-8, 1e-6])
def test_coordinates_that_are_flat_but_for_rounding_are_no_side_to_fall_to(noise: float, fallen: Prediction) -> None:
    # of single precision, say: it had stood within micrometres of its plane, and was called converged
    rng = np.random.default_rng(1)
    points = cast(Points, FALLS.shape).points
    rough = replace(FALLS, shape=Points(points=points + noise * rng.normal(size=np.shape(points))))
    tilted = replace(FALLS, environment=replace(HEAVY, gravity=(0.0, 9.81 * noise, -9.81)))
    for scene in (rough, tilted):
        found = predict(scene)
        assert found.status == "converged", found.message
        assert "in its plane the motion is unstable" in found.message
        u, t = np.linspace(0.0, 1.0, 33), np.linspace(0.0, FALLS.horizon, 33)
        apart = np.linalg.norm(fallen.surface.positions(u, t) - found.surface.positions(u, t), axis=-1).max()
        assert apart < 5e-3
        assert pose_as_shown(scene, {}, found.surface.control_points).start.aside > 0.0


@pytest.mark.parametrize("noise", [1e-8, 1e-6])
def test_what_hangs_in_a_plane_but_for_rounding_has_no_bow(noise: float) -> None:
    hangs = between(1.0, False, "point", HEAVY, 0.3, stiffness=1e-3)
    tilted = replace(hangs, environment=replace(HEAVY, gravity=(0.0, 9.81 * noise, -9.81)))
    found = predict(tilted)
    assert found.status == "converged", found.message
    assert found.accuracy.dimensions == 3
    assert "unstable" not in found.message
    assert pose_as_shown(tilted, {}, found.surface.control_points).start.aside == 0.0


@pytest.mark.parametrize("touches", [False, True])
def test_a_motion_is_posed_anew_with_the_bow_that_its_start_shows(touches: bool) -> None:
    far = Sphere(center=(0.5, 0.0, -0.9), radius=0.05)  # in the plane, and in space for it
    scene = (
        replace(FALLS, environment=replace(HEAVY, obstacles=(far,)), effects={"obstacles": "on"}) if touches else FALLS
    )
    prediction = predict(scene)
    shown = pose_as_shown(scene, {}, prediction.surface.control_points)
    level = cast(Level, prediction.level)
    assert level.posed.start.aside > 0.0
    assert shown.start.aside == level.posed.start.aside
    hangs = between(1.0, False, "point", HEAVY, 0.3, stiffness=1e-3)
    assert pose_as_shown(hangs, {}, predict(hangs).surface.control_points).start.aside == 0.0


@pytest.mark.parametrize(("closer", "leaves"), [(0.5, False), (0.9, True)])
def test_a_column_leaves_the_plane_of_its_bow_only_where_that_is_unstable(closer: float, leaves: bool) -> None:
    # straight, a disturbance to any side grows as much as its bow, and turns the plane it buckles in by as little
    around = replace(WEIGHTLESS, drag=0.05)
    grasps = [
        Grasp(u=u, hold="tangent", path=Move(displacement=(d, 0.0, 0.0), duration=3.0))
        for u, d in ((0.0, 0.0), (1.0, -closer))
    ]
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2)
    scene = Scene(
        cable=cable, shape=Straight(), grasps=tuple(grasps), environment=around, effects={"self_contact": "off"}
    )
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    assert prediction.accuracy.dimensions == 3  # it might have left it
    u, t = np.linspace(0.0, 1.0, 65), np.linspace(0.0, 3.0, 33)
    y, z = (np.abs(prediction.surface.positions(u, t)[..., d]).max() for d in (1, 2))
    assert y > 0.3
    assert (z > 0.1) if leaves else (z < 1.1e-3 * y)
    shown = pose_as_shown(scene, {}, prediction.surface.control_points)
    assert shown.start.aside == cast(Level, prediction.level).posed.start.aside > 0.0


@pytest.mark.parametrize("duration", [5.0, 120.0])
def test_a_cable_that_stands_falls_out_of_its_plane_however_slowly_its_foot_is_carried(duration: float) -> None:
    """94:1642: it has fallen long before the second of some evenly spaced looks at a motion of minutes."""
    foot = Grasp(u=0.0, hold="tangent", path=Move(displacement=(0.05, 0.0, 0.0), duration=duration))
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2)
    shape = Straight(direction=(0.0, 0.0, 1.0))
    found = predict(Scene(cable=cable, shape=shape, grasps=(foot,), environment=replace(HEAVY, drag=0.3)))
    assert found.status == "converged", found.message
    assert UNSTABLE in found.message
    assert np.abs(found.surface.positions([1.0], [2.5, duration])[:, 0, 1]).max() > 0.1


def test_scene_99_719_leaves_its_plane_on_coarse_grids_too() -> None:
    """A rod that is straight to 63 um is pushed along itself: it buckles within six of 155 steps."""
    scene = draw(99, 719).make()
    u, t = np.linspace(0.0, scene.cable.length, 33), np.linspace(0.0, scene.horizon or 0.0, 17)
    coarse, fine = (
        predict(replace(scene, quality=Quality(target_error=share * scene.cable.length))) for share in (6.5e-3, 2e-3)
    )
    for found in (coarse, fine):
        assert found.status == "converged", found.message
        assert UNSTABLE in found.message
    apart = coarse.surface.positions(u, t) - fine.surface.positions(u, t)
    assert np.linalg.norm(apart, axis=-1).max() < 6.5e-3 * scene.cable.length


@pytest.mark.parametrize("last", [0, 5, 440, 1000, 30_000])
def test_a_motion_is_looked_at_six_times_and_however_long_it_is_every_so_many_steps(last: int) -> None:
    at = looked_at(last, LOOKS)
    assert (at[0], at[-1]) == (0, last)
    assert len(at) == max(LOOKS, math.ceil(last / AT_ONCE)) + 1
    assert np.ptp(np.diff(at)) <= 1
    assert np.diff(at).max() <= AT_ONCE


def test_its_equilibrium_hangs() -> None:
    assert equilibrium(FALLS).positions([0.5])[0, 2] < -0.2
    assert equilibrium(replace(FALLS, shape=replace(FALLS.shape, settle=True)), n_u=17).positions([0.5])[0, 2] < -0.2


def test_a_settled_start_is_the_stable_one() -> None:
    prediction = predict(replace(FALLS, shape=replace(FALLS.shape, settle=True)))
    assert prediction.status == "converged", prediction.message
    assert prediction.surface.positions([0.5], 0.0)[0, 0, 2] < -0.2


@pytest.mark.parametrize(
    "scene",
    [
        between(1.0, False, "point", HEAVY, 0.3, stiffness=1e-3),
        between(1.0, False, "clamp", HEAVY, 0.6, stiffness=0.1),
        between(1.0, True, "clamp", HEAVY, 0.0, stiffness=0.1),
        between(0.3, True, "clamp", WEIGHTLESS, 0.4),
        between(0.3, True, "tangent", WEIGHTLESS, 0.2),
        between(0.3, True, "point", WEIGHTLESS, 0.3),  # turns about its ends for nothing: neutral
        replace(between(1.0, False, "point", HEAVY, 0.0), grasps=()),
    ],
    ids=["hangs", "hangs stiffly", "clamped arch", "clamped", "tangents held", "neutral", "thrown"],
)
def test_a_stable_motion_stays_planar(scene: Scene) -> None:
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    assert prediction.accuracy.dimensions == 2
    assert "unstable" not in prediction.message


def test_an_elastica_whose_directions_are_held_leaves_its_plane_when_it_is_compressed_far() -> None:
    # hardly damped, it snaps on its way, up to 36 mm elsewhere where a micrometre disturbs it before that
    prediction = predict(between(0.3, True, "tangent", replace(WEIGHTLESS, drag=1.0), 0.8))
    assert prediction.status == "converged", prediction.message
    assert prediction.accuracy.dimensions == 3
    assert out_of_plane(prediction) > 0.05


def test_what_a_micrometre_moves_by_little_is_part_of_the_error_and_more_than_the_target_no_success() -> None:
    def snaps(closer: float, target: float) -> Scene:
        scene = between(0.3, True, "tangent", replace(WEIGHTLESS, drag=0.7), closer)
        return replace(scene, quality=Quality(target_error=target))

    told = "bending the start by a millionth of the length, 1 um, changes the motion by up to 1.3 mm"
    found = predict(snaps(0.8, 2e-3))
    assert found.status == "converged", found.message
    assert f"But {told}." in found.message
    assert DOUBTFUL < found.accuracy.error_parts["start"] < 2 * DOUBTFUL
    assert found.accuracy.error_estimate == pytest.approx(sum(found.accuracy.error_parts.values()))
    again = predict(snaps(0.8001, 2e-3), like=found)
    assert "On the grid of a motion" in again.message
    assert f"But {told}." in again.message
    assert again.accuracy.error_parts["start"] == pytest.approx(found.accuracy.error_parts["start"], rel=0.1)
    strict = predict(snaps(0.8, 1e-3))
    assert strict.status == "stalled"
    assert "does not determine its motion" in strict.message


@pytest.mark.parametrize("hold", ["tangent", "clamp"])
@pytest.mark.parametrize("closer", [0.3, 0.5, 0.7, 0.9])
def test_what_it_says_of_a_state_is_what_a_disturbed_motion_does(hold: str, closer: float) -> None:
    scene = between(0.3, True, hold, replace(WEIGHTLESS, drag=1.0), closer)
    planar = predict(replace(scene, horizon=4.0, quality=Quality(n_u=25, n_t=61, method="march", keep_grid=True)))
    level = cast(Level, planar.level)
    grid = level.motion.grid
    says = is_unstable(level.problem, grid, level.motion.states[-1], 4.0, grid.history)
    u = np.linspace(0.0, np.pi, 41)
    bent = scene.shape.points + np.outer(1e-4 * (np.sin(u) ** 2 + np.sin(u) * np.sin(2.0 * u)), [0.0, 1.0, 0.0])  # type: ignore[union-attr]
    quality = Quality(n_u=25, n_t=121, method="march", keep_grid=True)
    spatial = predict(replace(scene, shape=Points(points=bent), horizon=16.0, quality=quality))
    u, late = np.linspace(0.0, 1.0, 65), spatial.surface.positions(np.linspace(0.0, 1.0, 65), [4.0, 16.0])
    before, after = np.abs(late[..., 1]).max(axis=1)
    assert says == (after > max(3.0 * before, 1e-3) or before > 1e-2)


@pytest.mark.parametrize("stiffness", [1.0, 100.0])
def test_what_a_start_is_pushed_out_of_the_table_by_bends_no_stress_free_shape(stiffness: float) -> None:
    # its point is held at the height of the table, beside which it is pushed out by micrometres: 0.2/m of bends
    scene = draw(102, 21).make()
    problem = stiffer(pose(scene, {"side": "it leaves the table"}), stiffness)
    assert problem.contact is not None
    assert problem.twist is not None
    grid = make_grid(problem, 28)
    assert np.abs(grid.start[:, 2]).max() > 1e-6
    across = np.abs(grid.history.memory[:, [1, 4]]).max()
    along = np.abs(grid.history.memory[:, [0, 3]]).max()
    assert along == pytest.approx(0.4783, abs=1e-3)
    assert across < 1e-9 * along


def test_how_a_wire_turns_over_on_a_table_does_not_hang_on_the_stiffness_of_contact() -> None:
    found = predict(draw(102, 21).make())
    level = cast(Level, found.level)
    softer, harder = (
        run_level(stiffer(level.posed, ratio), *level.size, Monitor(), free_knots=True) for ratio in (1.0, 100.0)
    )
    assert distance(softer, harder) < 1e-3  # it was 0.022


def test_the_stiffness_is_the_tangent_of_the_forces_in_space() -> None:
    prediction = predict(
        replace(
            between(1.0, False, "point", HEAVY, 0.3), quality=Quality(n_u=13, n_t=25, method="march", keep_grid=True)
        )
    )
    level = cast(Level, prediction.level)
    problem, grid, q = level.problem, level.motion.grid, level.motion.states[-1]
    cable = problem.scene.cable
    band = stiffness_across(
        q[None], grid.tables, cast(float, cable.bending_stiffness), cast(float, cable.axial_stiffness)
    )[0]
    space = _in_space(problem)
    n = len(q)
    flat = np.zeros((n, 3))
    flat[:, :2] = q
    for j in range(n):
        forces = []
        for side in (1e-6, -1e-6):
            x = flat.copy()
            x[j, 2] = side
            forces.append(_forces(space, x, grid.tables))
        column = (forces[0] - forces[1])[:, 2] / 2e-6
        expected = [band[min(i, j), abs(i - j)] if abs(i - j) < 4 else 0.0 for i in range(n)]
        assert column == pytest.approx(np.array(expected), abs=1e-6 * np.abs(band).max())


def _in_space(problem: Problem) -> Problem:
    axes = np.vstack([problem.plane.axes, np.cross(*problem.plane.axes)])
    return replace(problem, plane=Plane(axes, problem.plane.origin, ""))


def _forces(problem: Problem, x: Floats, tables: Any) -> Floats:
    points, stretched = len(tables.curvature.w), len(tables.axial.w)
    past = (
        np.zeros((stretched, 3)),
        np.zeros((0, 6)),
        np.zeros((0, 2)),
        np.zeros(0),
        np.zeros((0, COLUMNS)),
        np.zeros(room_for(3, points)),
    )
    history = History(np.zeros((points, 6)), np.zeros((0, 9)), *past)
    f, K = np.empty((len(x), 3)), np.empty((3 * len(x), 12))
    active, parameters = problem.law_table()
    assemble((0, 1, 2), x, np.zeros_like(x), tables, active, parameters, history, NO_RATES, (0.0, 0.0, 0.0), f, K)
    return f


def test_a_given_grid_keeps_to_its_plane_and_says_so() -> None:
    prediction = predict(replace(FALLS, quality=Quality(n_u=17, n_t=33, method="march", keep_grid=True)))
    assert prediction.accuracy.dimensions == 2
    assert "in its plane the motion is unstable" in prediction.message


def test_the_reference_leaves_the_plane_too() -> None:
    scene = replace(FALLS, horizon=1.0)
    ours = predict(replace(scene, quality=Quality(target_error=2e-3)))
    theirs = predict(replace(scene, quality=Quality(method="reference", target_error=5e-3)))
    assert theirs.accuracy.dimensions == 3
    away = ours.surface.sample()[2][..., :3] - theirs.surface.sample()[2][..., :3]
    assert np.linalg.norm(away, axis=-1).max() < 1e-2


def test_a_motion_that_yields_is_taken_out_of_its_plane_where_a_disturbance_grows_in_it() -> None:
    # it yields as it falls to both sides of a gripper; of the elastic motion a disturbance grows more
    scene = replace(draw(24, 204).make(), quality=Quality(), effects={"self_contact": "off"})
    assert sided(pose(scene), Monitor()).plane.dimensions == 3
    found = predict(scene)
    assert "plasticity" in cast(Level, found.level).posed.called_for
    assert UNSTABLE in found.message
    begin, u = cast(Straight, scene.shape), np.linspace(0.0, 1.0, 201)
    bent = begin.start + np.outer(u, begin.direction) + np.outer(1e-4 * np.cos(np.pi * u) ** 2, [0.0, 1.0, 0.0])  # type: ignore[arg-type, operator]
    off = predict(replace(scene, shape=Points(points=bent)))
    assert UNSTABLE not in off.message  # in space by itself
    y = off.surface.positions([0.0, 1.0], np.linspace(0.0, off.surface.horizon, 33))[..., 1]
    assert np.abs(y).max() > 10.0 * np.abs(y[0]).max() > 0.0
