"""Starts given by control points of a curve: the cable lies along it at its own length."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline, make_interp_spline

from dlocore import (
    ControlPoints,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Straight,
    predict,
)
from dlocore.problem.discretisation import axial_strain, make_grid
from dlocore.problem.notes import scene_notes
from dlocore.problem.problem import pose
from dlocore.scene.scene import Shape
from dlocore.shape.shape import start_curve
from dlocore.spline import uniform_knots
from tests.solver.scenes import Floats, cable

U = np.linspace(0.0, 1.0, 201)
BEGIN, ALONG = np.array([3.0, -2.0, 1.0]), np.array([0.6, 0.0, 0.8])
AROUND = [0.0, 0.3, 0.7, 1.0]  # a straight cable's would be at thirds
LINES = {"around thirds": AROUND, **{str(n): np.linspace(0.0, 1.0, n) for n in (4, 5, 9, 20)}}
GIVEN = Quality(n_u=13, n_t=17, method="march", estimate=False)
ARCH = np.array([[0, 0, 0], [0.23, 0.1, 0], [0.46, 0.1, 0], [0.7, 0.1, 0], [0.93, 0, 0]])


def line(x: Floats) -> ControlPoints:
    return ControlPoints(control_points=BEGIN + np.outer(x, ALONG))


def moved(shape: Shape) -> Scene:
    """Return the scene of a cable of 1 m whose end a gripper moves sideways, without weight."""
    clamp = Grasp(u=0.0, hold="clamp", path=Move(displacement=(0.1, 0.2, 0.0), duration=1.0))
    environment = Environment(gravity=(0.0, 0.0, 0.0), drag=0.1)
    return Scene(cable=cable(), shape=shape, grasps=(clamp,), environment=environment)


def apart(one: Prediction, other: Prediction) -> float:
    times = np.linspace(0.0, 1.0, 9)
    return float(np.linalg.norm(one.surface.positions(U, times) - other.surface.positions(U, times), axis=-1).max())


@pytest.mark.parametrize("x", LINES.values(), ids=LINES)
def test_control_points_on_a_line_are_a_straight_cable_however_they_are_spaced(x: Floats) -> None:
    curve = start_curve(line(x), 1.0)
    np.testing.assert_allclose(curve(U), BEGIN + np.outer(U, ALONG), atol=1e-7)
    np.testing.assert_allclose(curve(U, 1), np.tile(ALONG, (len(U), 1)), atol=1e-6)


@pytest.mark.parametrize("x", LINES.values(), ids=LINES)
def test_control_points_on_a_line_move_as_a_straight_cable(x: Floats) -> None:
    found, straight = (
        predict(moved(shape)) for shape in (ControlPoints(control_points=np.outer(x, [1, 0, 0])), Straight())
    )
    assert found.status == straight.status == "converged"
    assert found.accuracy.n_u == straight.accuracy.n_u
    assert apart(found, straight) < 1e-6
    assert found.energies([0.0])["stretch"][0] < 1e-12


def test_a_mild_arch_moves_as_the_cable_that_is_seen_along_it() -> None:
    found = predict(moved(ControlPoints(control_points=ARCH)))
    curve = BSpline(uniform_knots(5, 1.0), ARCH, 3)
    other = predict(moved(Points(points=curve(np.linspace(0.0, 1.0, 400)))))
    assert found.status == "converged"
    assert len(found.iterations) == len(other.iterations)  # it was 60 s, and no answer
    assert apart(found, other) < 1e-4


def test_control_points_of_an_arc_that_are_spaced_unevenly_are_that_arc() -> None:
    x = np.linspace(0.0, 1.0, 25)
    angle = 2.0 * (x + 0.3 * np.sin(np.pi * x) ** 2)
    spline = make_interp_spline(x, 0.5 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * x]), k=3)
    curve = start_curve(ControlPoints(control_points=spline.c, knots=spline.t), 1.0)
    exact = 0.5 * np.column_stack([np.sin(2.0 * U), 1.0 - np.cos(2.0 * U), 0.0 * U])
    assert np.linalg.norm(spline(U) - exact, axis=1).max() > 0.2
    np.testing.assert_allclose(curve(U), exact, atol=5e-5)  # as the spline that goes through its points
    assert curve.slid > 0.2


@pytest.mark.parametrize("points", [ARCH, np.outer([0.0, 0.3333, 0.6667, 1.0], [1.0, 0.0, 0.0])], ids=["arch", "line"])
@pytest.mark.parametrize("n_u", [9, 28, 93])
def test_every_grid_has_the_same_cable_without_stretch(points: Floats, n_u: int) -> None:
    # relaxed by a spring that grows with the grid, an arch keeps more strain on every finer one, up to 5 %
    grid = make_grid(pose(moved(ControlPoints(control_points=points))), n_u)
    assert np.abs(axial_strain(grid.tables, grid.start)).max() < 2e-5


def test_angle_and_velocity_go_along_with_the_places_of_the_curve() -> None:
    rows = np.linspace([0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.5], 9)
    curve = start_curve(ControlPoints(control_points=rows, velocity=2.0 * rows + [0.0, 1.0, 0.0, 0.0]), 1.0)
    assert curve.theta is not None
    assert curve.velocity is not None
    assert curve.theta_rate is not None
    np.testing.assert_allclose(curve.theta(U)[:, 0], 0.5 * U, atol=1e-6)
    np.testing.assert_allclose(curve.theta_rate(U)[:, 0], U, atol=1e-6)
    np.testing.assert_allclose(curve.velocity(U), np.column_stack([2.0 * U, 1.0 + 0.0 * U, 0.0 * U]), atol=1e-6)


def test_an_angle_that_turns_in_every_span_is_kept() -> None:
    x = np.linspace(0.0, 1.0, 301)
    rows = np.column_stack([x + 0.01 * np.sin(2.0 * np.pi * x), 0.0 * x, 0.0 * x, np.sin(200.0 * x)])
    given = BSpline(uniform_knots(len(x), 1.0), rows, 3)(np.linspace(0.0, 1.0, 2001))
    curve = start_curve(ControlPoints(control_points=rows), 1.0)
    assert curve.theta is not None
    np.testing.assert_allclose(curve.theta(given[:, 0])[:, 0], given[:, 3], atol=5e-3)


def test_a_twisted_line_moves_alike_however_its_control_points_are_spaced() -> None:
    turned = [ControlPoints(control_points=np.outer(x, [1.0, 0.0, 0.0, 0.5])) for x in (LINES["4"], LINES["5"])]
    scenes = [replace(moved(shape), quality=GIVEN) for shape in turned]
    one, other = (predict(scene) for scene in scenes)
    assert apart(one, other) < 1e-6


def test_a_start_in_material_coordinates_is_taken_as_it_is() -> None:
    rows = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 5)
    curve = start_curve(ControlPoints(control_points=rows, strain=np.zeros(5)), 1.0)
    assert np.array_equal(curve.control_points, rows)
    assert curve.slid == 0.0


@pytest.mark.parametrize(
    "points",
    [
        np.outer([0.0, 0.7, 0.35, 0.23, 0.58], [1.0, 0.0, 0.0]),
        np.outer([0.0, 0.6, 0.3, 0.2, 0.1, -0.2], [1.0, 0.0, 0.0]),
    ],
    ids=["there and back again", "back"],
)
def test_control_points_that_turn_back_are_refused_by_name(points: Floats) -> None:
    length = float(
        np.abs(np.diff(BSpline(uniform_knots(len(points), 1.0), points, 3)(np.linspace(0, 1, 9999)), axis=0)).sum()
    )
    with pytest.raises(SceneError, match="turns too sharply about u = 0") as error:
        start_curve(ControlPoints(control_points=points), length)
    assert error.value.field == "shape.control_points"


def test_places_that_move_along_the_curve_are_told_of() -> None:
    (note,) = scene_notes(moved(line(LINES["5"])))
    assert "moves its places, also those that grippers hold, by up to 48 mm. If" in note
    assert "give `strain` as zeros" in note
    assert scene_notes(moved(line(LINES["4"]))) == []
    along, scaled = scene_notes(moved(ControlPoints(control_points=ARCH)))
    assert "by up to 52 mm" in along
    assert "the control points of the shape are 0.9599 m long and the cable 1 m" in scaled
