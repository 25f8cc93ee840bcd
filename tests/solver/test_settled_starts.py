"""Starts that settle: Newton's method alone against a line search, and one grid's start from another's."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from benchmarks.hard.generator import draw
from benchmarks.random_reference import PATIENT
from benchmarks.random_reference import compare as compare_with_reference
from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, SceneError, equilibrium, predict
from dlocore.accuracy import refinement
from dlocore.kernels.relax import descend, relax
from dlocore.kernels.tension import COLUMNS
from dlocore.levels.level import Level, Size
from dlocore.levels.whole_march import march_level
from dlocore.problem.discretisation import applied_forces, make_grid
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, hold
from dlocore.problem.problem import Problem, pose
from dlocore.solvers.monitor import Monitor
from dlocore.spline import design_matrix
from dlocore.statics import statics
from dlocore.statics.regrid import begin_on, starts_folded
from dlocore.statics.settling import settle
from dlocore.statics.statics import settles_elsewhere, start_grid
from tests.solver.scenes import WEIGHTLESS, Floats, arc, cable
from tests.solver.test_handling import spanned_between_two
from tests.solver.test_two_grippers import hanging


def shape_of(problem: Problem, grid: Grid) -> Floats:
    """Return 65 points along the start of a grid (65, 2 or 3) [m]."""
    u = np.linspace(0.0, problem.scene.cable.length, 65)
    return design_matrix(grid.knots, u) @ grid.start[:, : problem.plane.dimensions]


def apart(problem: Problem, a: Grid, b: Grid) -> float:
    """Return the largest distance between two starts, of the cable's length."""
    away = np.linalg.norm(shape_of(problem, a) - shape_of(problem, b), axis=1)
    return float(away.max()) / problem.scene.cable.length


def relaxed(problem: Problem, springs: float, *, plain: bool) -> tuple[Floats, float]:
    """Return control points (17, nc) of the given start after one relaxation, and its last update [m]."""
    grid = make_grid(problem, 17)
    starts: Starts = {}
    grasps = list(problem.scene.grasps)
    close_grasps(problem, grid, grasps, starts, None)
    q = grid.start.copy()
    held = hold(problem, grid, grasps, np.zeros(1), starts, q)
    applied = applied_forces(problem, grid, np.zeros(1))[0]
    active, parameters = problem.law_table()
    if plain:
        history = grid.past()._replace(tension=np.zeros((len(grid.tables.axial.w), COLUMNS)))
        update, _ = descend(
            problem.axes, q, springs, applied, grid.tables, active, parameters, history, held.elimination,
            held.offsets[0], 0.0, 1e-12, 1e-10,
        )  # fmt: skip
    else:
        update, _ = relax(
            problem.axes, q, grid.start, springs, applied, grid.tables, active, parameters, grid.past(),
            held.elimination, held.offsets[0], 1e-12, 200,
        )  # fmt: skip
    return q, update


@pytest.mark.parametrize("hold", ["point", "tangent", "clamp"])
def test_newtons_method_alone_finds_what_the_line_search_finds(hold):
    problem = pose(hanging(hold))
    plain, update = relaxed(problem, 20.0, plain=True)
    searched, _ = relaxed(problem, 20.0, plain=False)
    assert update <= 1e-10
    # both end with updates below 1e-10 m, whose tangents are as good
    np.testing.assert_allclose(plain, searched, atol=1e-9)


def test_newtons_method_alone_leaves_all_as_it_was_where_no_tangent_is_positive():
    pushed = Points(points=arc(1.0, 0.01)[:, [0, 2, 1]])
    heavy = Environment(gravity=(-300.0, 0.0, 0.0))  # along the cable, from its far end to the one that is held
    scene = Scene(cable=cable(), shape=pushed, grasps=(Grasp(u=0.0, hold="tangent"),), environment=heavy, horizon=1.0)
    problem = pose(scene)
    q, update = relaxed(problem, 1e-6, plain=True)
    assert update == np.inf
    np.testing.assert_array_equal(q, make_grid(problem, 17).start)


SETTLED = {
    "plane": "cable carried high above a table",
    "space": "two grippers carry a hanging cable",
    "clamps": "clamped hanging cable with one end moved",
    "load": "long cable with a hanging load",
    "three grasps": "heavy electric cable held at three places",
    "tangents": "white wire between two grippers in space",
}


@pytest.mark.parametrize("name", SETTLED.values(), ids=SETTLED)
def test_a_start_settled_from_that_of_another_grid_is_the_one_settled_from_the_given_shape(name):
    problem = pose(catalogue()[name])
    coarse = start_grid(problem, 13, Monitor())
    own, handed = start_grid(problem, 22, Monitor()), start_grid(problem, 22, Monitor(), coarse)
    assert begin_on(problem, make_grid(problem, 22), coarse) is not None
    assert apart(problem, coarse, own) > 1e-7  # the grids differ, or nothing is shown
    # rest is found to 1e-8 of the length; the frames of sections are carried another way, to the same
    assert apart(problem, handed, own) < 1e-7


def test_a_start_settles_in_the_equilibrium_of_the_grid_it_is_handed_on_from():
    bow = arc(1.0, 2.0)[:, [0, 2, 1]]
    grasps = (Grasp(u=0.0), Grasp(u=1.0))
    scene = Scene(
        cable=cable(), shape=Points(points=bow, settle=True), grasps=grasps, environment=WEIGHTLESS, horizon=1.0
    )
    problem = pose(scene)
    up = start_grid(problem, 13, Monitor())
    ends = up.start[[0, -1]]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    rise = (up.start - ends[0]) - np.outer((up.start - ends[0]) @ along, along)
    down = replace(up, start=up.start - 2.0 * rise)
    own, handed = start_grid(problem, 22, Monitor()), start_grid(problem, 22, Monitor(), down)
    assert apart(problem, own, up) < 1e-3  # what 13 control points err by
    assert apart(problem, handed, down) < 1e-3
    assert apart(problem, handed, own) > 0.2


def test_a_start_that_coarse_grids_fold_is_not_handed_on_and_settles_from_more_control_points():
    # a stiff loop hung from a point straightens and hangs; on 10 control points alone it stays folded within a span
    problem = pose(draw(4, 182).make())
    grid = make_grid(problem, 10)
    found = settle(problem, grid, 0.0, Monitor())
    folded = grid.changed(start=found.q, history=found.history)
    own = start_grid(problem, 28, Monitor())
    assert found.rest == "settled"
    assert starts_folded(folded)
    assert apart(problem, folded, own) > 0.2
    assert apart(problem, start_grid(problem, 28, Monitor(), folded), own) < 1e-3
    assert apart(problem, start_grid(problem, 10, Monitor()), own) < 1e-3


def test_a_stiff_loop_that_has_two_equilibria_has_one_start_on_all_grids():
    # seed 5, scene 160: it stood between its grippers on some grids, and hung on others
    prediction = predict(draw(5, 160).make())
    assert prediction.status == "converged", prediction.message


@pytest.mark.parametrize("n_u", [9, 13, 22, 41])
@pytest.mark.parametrize("moved", [0.0, 1e-3, 2e-2])
def test_a_stiff_wire_that_may_turn_about_itself_settles_on_any_grid_from_any_start_near(n_u, moved):
    scene = replace(spanned_between_two(), effects={"twist": "on"})
    points = np.asarray(scene.shape.points)  # type: ignore[union-attr]
    nearby = points + moved * np.sin(np.outer(np.arange(len(points)), [0.11, 0.07, 0.05]))
    problem = pose(replace(scene, shape=Points(points=nearby, settle=True)))
    grid = start_grid(problem, n_u, Monitor())  # a SceneError where it finds no rest
    bow = shape_of(problem, grid)
    assert grid.largest_strain(grid.start[None]) < 1e-6  # its forces are some EI/L^2 = 0.02 N, EA is 1e7 N
    if n_u >= 22:
        exact = shape_of(problem, start_grid(problem, 65, Monitor()))
        # it may lie at any angle about the line between its grippers: distances to one of them are the same
        for end in (6, 51):
            reach, known = (np.linalg.norm(x - x[end], axis=1) for x in (bow, exact))
            np.testing.assert_allclose(reach, known, atol=2e-3 * problem.scene.cable.length)


def test_a_cable_that_hardly_stretches_settles_as_one_that_stretches_more():
    # EA L^2/EI = 1e9 and 1e5: what the cable bends is the same but for its strain, some 1e-6 and 1e-2
    shapes = []
    for axial in (1e6, 1e3):
        wire = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=axial)
        problem = pose(replace(hanging("point"), cable=wire))
        shapes.append((problem, start_grid(problem, 28, Monitor())))
    (problem, stiff), (_, soft) = shapes
    assert apart(problem, stiff, soft) < 1e-3  # its weight of 0.5 N strains the softer one by 5e-4


def test_a_start_that_finds_no_rest_on_few_control_points_settles_from_more():
    scene = draw(7, 200).make()  # 27 m that fall to hang from a point beside one end
    problem = pose(scene)
    coarse, fine = (start_grid(problem, n_u, Monitor()) for n_u in (9, 19))
    assert coarse.n_u == 9
    assert apart(problem, coarse, fine) < 1e-3


def test_a_start_that_rests_on_few_control_points_alone_is_begun_anew_on_more():
    # a stiff cusp between two grippers: 9 control points rest in the plane that they can't leave, 13 find no rest
    scene = draw(71, 639).make()
    length, u, t = scene.cable.length, np.linspace(0.0, scene.cable.length, 33), np.linspace(0.0, 2.8, 17)
    found, finer = (
        predict(replace(scene, quality=Quality(target_error=target * length)), deadline=60.0)
        for target in (5.4e-3, 1e-3)
    )
    assert (found.status, finer.status) == ("converged", "converged")
    assert found.accuracy.error_estimate is not None
    away = np.linalg.norm(found.surface.positions(u, t) - finer.surface.positions(u, t), axis=-1).max()
    assert away < found.accuracy.error_estimate


def test_an_answer_whose_start_finds_no_rest_on_a_finer_grid_is_given_and_says_so(monkeypatch: pytest.MonkeyPatch):
    def on_few_only(problem: Problem, size: Size, *given: object, **named: object) -> Level:
        if size.n_u > 13:
            raise SceneError("shape.settle", True, "false", "The start did not come to rest")
        return march_level(problem, size, *given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(refinement, "march_level", on_few_only)
    found = predict(replace(hanging("point"), quality=Quality(target_error=1e-6)))
    assert found.status == "stalled"
    assert "did not come to rest" in found.message


@pytest.mark.parametrize(("seed", "index"), [(14, 274), (21, 35), (22, 36)])
def test_a_wound_start_settles_downhill_to_the_equilibrium_of_the_reference(seed: int, index: int):
    # loops and a stiff S between grips that let them turn: relaxations had jumped to an arc, up to 0.6 L elsewhere
    found = compare_with_reference(seed, index, PATIENT)
    assert found is not None
    assert found.is_told
    assert found.apart < 2e-3


def test_a_start_does_not_fall_through_what_it_lies_on():
    found = compare_with_reference(22, 87, PATIENT)  # over a capsule, under which long steps downhill had taken it
    assert found is not None
    assert found.apart < 5e-3


def test_few_control_points_do_not_choose_the_equilibrium():
    # wavy points between two grippers that push: on 9 control points it bulged to the left, on all others to the right,
    # and the second grid, settled from the first, agreed with it; the error was a quarter of the length at 0.6 % told
    scene = draw(34, 24493).make()
    u = np.linspace(0.0, scene.cable.length, 33)
    starts = [
        predict(replace(scene, quality=quality), keep_grid=True).surface.positions(u, [0.0])[0]
        for quality in (Quality(n_u=9, n_t=19), Quality(n_u=41, n_t=19), scene.quality)
    ]
    few, found = (np.linalg.norm(start - starts[1], axis=1).max() / scene.cable.length for start in starts[::2])
    assert few > 0.1
    assert found < 0.01


def snake(lean: float, **changes: Any) -> Scene:
    """Return an S between two points that let it turn, without weight, that leans to a side by a part of its height."""
    s = np.linspace(0.0, 1.0, 81)
    points = np.column_stack([0.6 * s, 0.15 * (np.sin(2.0 * np.pi * s) + lean * np.sin(np.pi * s)), 0.0 * s])
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    move = Move(displacement=(0.05, 0.0, 0.0), duration=1.0)
    return Scene(
        cable=Cable(length=length, diameter=0.005, linear_density=0.05, bending_stiffness=0.01),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.0), Grasp(u=length, path=move)),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.2),
        effects={"twist": "off"},
        **changes,
    )


def test_a_start_that_may_settle_to_either_side_is_no_success():
    # it had been, on the side to which rounding, or the grid, took it: 111:278 was 0.78 L elsewhere with one knot more
    found = predict(snake(0.0))
    assert found.status == "stalled"
    assert "the scene does not determine its motion" in found.message
    assert found.accuracy.error_parts["start"] > 0.2
    given = predict(snake(0.0, quality=Quality(n_u=17, n_t=25, method="march", keep_grid=True)))
    assert given.status == "converged"
    assert "the scene does not determine its motion" in given.message


@pytest.mark.parametrize("at", [0.0, 1.0])
def test_an_equilibrium_that_is_one_of_two_tells_so(at: float):
    # where rounding leaves it between the two it is tipped, and says that
    told = ("which of several equilibria it comes to is not determined", "another side may be as likely")
    assert any(words in equilibrium(snake(0.0), at=at).message for words in told)
    assert not any(words in equilibrium(snake(0.05), at=at).message for words in told)


@pytest.mark.parametrize("lean", [0.05, -0.05])
def test_a_start_that_leans_settles_to_its_side(lean: float):
    found = predict(snake(lean))
    assert found.status == "converged", found.message
    bulge = found.surface.positions(np.linspace(0.0, found.scene.cable.length, 33), 0.0)[0][:, 1]
    assert np.sign(bulge[np.abs(bulge).argmax()]) == np.sign(lean)


def test_whether_a_start_tells_its_side_is_only_asked_where_it_went_far(monkeypatch: pytest.MonkeyPatch):
    asked: list[object] = []
    monkeypatch.setattr(statics, "bent", lambda problem, grid, seed: asked.append(problem) or 0.0 * grid.start)
    bent_by_itself = snake(0.0)
    for scene, times in ((bent_by_itself, 2), (replace(bent_by_itself, shape=rest_of(bent_by_itself)), 0)):
        asked.clear()
        problem = pose(scene)
        assert settles_elsewhere(problem, start_grid(problem, 13, Monitor()), Monitor()) == 0.0
        assert len(asked) == times


def rest_of(scene: Scene) -> Points:
    """Return the shape in which a scene's start settles, to settle from once more."""
    u = np.linspace(0.0, scene.cable.length, 81)
    return Points(points=equilibrium(scene).positions(u), settle=True)
