"""Where a grid has knots of its own: tips beyond what is held, and sharp bends of the start."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.curves import FINE, arc, bend, corner, hairpin, helix
from benchmarks.hard.generator import draw
from benchmarks.hard.judge import compare
from benchmarks.robot_scenes import random_scene
from dlocore import (
    Grasp,
    Points,
    Quality,
    Scene,
    predict,
)
from dlocore.accuracy.budget import Means
from dlocore.accuracy.refinement import _Climb
from dlocore.levels.level import Size
from dlocore.levels.whole_march import is_folded, march_level
from dlocore.problem.discretisation import corners
from dlocore.problem.features import find_features
from dlocore.problem.problem import pose
from dlocore.shape.shape import start_curve
from dlocore.solvers.march import STRONGLY_DAMPED
from dlocore.solvers.monitor import Monitor
from tests.solver.scenes import apart, cable, kinked, march


def thinner(scene: Scene) -> Scene:
    """Return a scene whose cable is thinner than any tip of it is long."""
    return replace(scene, cable=replace(scene.cable, diameter=5e-4 * scene.cable.length))


def folding_tip() -> Scene:
    """Return a cable whose tip, 0.3 mm of a metre beyond a grasp at which the velocity jumps, folds straight back."""
    scene = thinner(draw(11, 369).make())
    return replace(scene, effects={**scene.effects, "twist": "off"})  # with it the cable leaves its plane, unfolded


def test_a_tip_that_folds_beyond_a_grasp_is_straight_in_the_end():
    # it folded on up to 708 control points, in too few steps
    scene = folding_tip()
    found = predict(scene)
    assert found.status == "converged", found.message
    least, most = found.level.motion.slopes
    assert least > 0.4
    assert most < 1.6
    assert found.accuracy.n_u < 708
    assert compare(found, scene, 60.0)["error"] * scene.cable.length < found.accuracy.error_estimate


def test_where_grids_agree_on_a_fold_it_is_held_straight_by_watching_its_length():
    problem, size = pose(folding_tip()), Size(472, 60, 640)
    level = march_level(problem, size, Monitor(), STRONGLY_DAMPED, free_knots=True)
    assert is_folded(level)
    climb = _Climb(problem=problem, means=Means(Monitor(), None, np.inf), target=8e-3, enough=8e-3, number=9)
    climb.changes.note("both", replace(level, change=1e-3), level)
    climb.estimate, climb.rho = climb.changes.estimate(level), STRONGLY_DAMPED
    found = climb._unfolded(level, size)
    assert found is not None
    assert found.status == "converged"
    assert not is_folded(found.level)
    assert found.level.note == "watched at more points"
    assert sum(found.errors.values()) > climb.estimate  # by how far it is from the other


# 5561 is led along a noisy path, which takes more steps than a grid of 28 control points has
@pytest.mark.parametrize(("seed", "index", "most"), [(17, 3138, 28), (17, 5561, 62), (17, 4069, 28), (11, 369, 28)])
def test_a_tip_shorter_than_half_a_diameter_has_no_span_that_could_fold(seed: int, index: int, most: int):
    scene = draw(seed, index).make()
    (grasp,) = scene.grasps
    assert 0.0 < grasp.u < 0.5 * scene.cable.diameter
    found = predict(scene)
    assert found.status == "converged", found.message
    assert found.accuracy.n_u <= most
    assert grasp.u not in found.surface.knots_u
    problem, motion = found.level.problem, found.level.motion
    held = problem.world(motion.grid.at(motion.states, grasp.u))[:, :3]
    np.testing.assert_allclose(held, grasp.path.at(motion.times, held[0]), atol=1e-9 * scene.cable.length)
    assert compare(found, scene, 60.0)["error"] * scene.cable.length < found.accuracy.error_estimate


@pytest.mark.parametrize("index", [999, 1790, 6556, 15402])
def test_a_tip_beyond_a_held_direction_is_not_stretched_either(index: int):
    scene = draw(28, index).make()
    (grasp,) = scene.grasps
    length = scene.cable.length
    assert grasp.hold != "point"
    assert 0.0 < grasp.u < min(0.5 * scene.cable.diameter, 2e-4 * length)
    found = predict(scene)
    assert found.status == "converged", found.message
    assert "stretches" not in found.message
    surface, motion = found.surface, found.level.motion
    assert grasp.u not in surface.knots_u
    slope = np.linalg.norm(surface(np.linspace(0.0, 0.1 * length, 41), motion.times, du=1)[..., :3], axis=-1)
    assert np.abs(slope - 1.0).max() < 0.05
    problem = found.level.problem
    held = problem.world(motion.grid.at(motion.states, grasp.u))[:, :3]
    np.testing.assert_allclose(held, grasp.path.at(motion.times, held[0]), atol=1e-9 * length)


def test_what_a_tip_beyond_a_held_direction_costs_is_little_of_the_target():
    # 1.2e-3 of the length: without a span of its own it took the cable 1.4 mm elsewhere, at an estimate of 0.3 mm
    scene = random_scene(147)
    length = scene.cable.length
    (grasp,) = scene.grasps
    exact = predict(replace(scene, quality=Quality(target_error=2e-4 * length)))
    for target, has_span in ((1e-3, True), (2e-2, False)):
        found = predict(replace(scene, quality=Quality(target_error=target * length)))
        assert found.status == "converged"
        assert (grasp.u in found.surface.knots_u) == has_span
        assert apart(found.surface, exact.surface).max() < 2.0 * found.accuracy.error_estimate


def test_a_tip_that_is_part_of_more_has_its_span():
    line = np.linspace(0.0, 1.0, 5)[:, None] * [1.0, 0.0, 0.0]
    wire = cable(diameter=0.01)
    for grasps, inside in (
        ((Grasp(u=1e-3),), 0),
        ((Grasp(u=1.5e-4, hold="tangent"),), 0),
        ((Grasp(u=1e-3, hold="tangent"),), 1),  # which bends what lies beyond, and is as stiff as that
        ((Grasp(u=0.0), Grasp(u=1e-3)), 1),  # that hold a direction together
        ((Grasp(u=1e-3), Grasp(u=0.05)), 2),
        ((Grasp(u=1e-3), Grasp(u=0.999)), 0),
    ):
        features = find_features(Scene(cable=wire, shape=Points(points=line), grasps=grasps, horizon=1.0))
        assert ((features.u > 0.0) & (features.u < 1.0)).sum() == inside


def test_a_sharp_bend_is_the_same_on_coarse_and_fine_grids():
    coarse, fine = predict(kinked(march(49, 33))), predict(kinked(march(97, 65)))
    # 1.4 mm; with knots spread evenly, where the bend is another one on each grid, 55 mm
    assert apart(coarse.surface, fine.surface).max() < 3e-3
    assert predict(kinked(march(5, 9))).surface.positions(0.5, 0.0).shape == (1, 1, 3)  # too few for knots at it


@pytest.mark.parametrize(
    ("points", "found"),
    [
        (corner(1.0, 2.0, 0.4, "flat"), [0.4]),
        (corner(1.0, 0.5, 0.4, "flat"), []),
        (bend(1.0, 1.6, 0.03, 0.4), [0.4]),
        (bend(1.0, 1.6, 0.06, 0.4), [0.38, 0.42]),  # a third of its width to either side
        (bend(1.0, 1.6, 0.03, 0.4) + 2e-4 * np.random.default_rng(1).standard_normal((FINE + 1, 3)), [0.4]),
        (hairpin(1.0, 0.2, "flat"), []),
        (arc(1.0, 6.0, "flat"), []),
        (helix(1.0, 10.0, 0.3), []),
    ],
    ids=["corner", "blunt corner", "bend", "wide bend", "noisy bend", "hairpin", "arc", "helix"],
)
def test_only_a_bend_sharper_than_the_rest_of_the_cable_is_a_corner(points, found):
    u = corners(start_curve(Points(points=points), 1.0), 1.0)
    np.testing.assert_allclose(u, found, atol=0.01)  # the points are a hundredth of the length apart
