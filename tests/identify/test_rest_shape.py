"""The stress-free shape that is found, as scenes take it."""

from dataclasses import replace

import numpy as np
import pytest

from app.reports.identification import document_of_identification
from app.schemas.cable import CableModel
from app.schemas.convert import cable_of
from benchmarks.simulated_recordings import CABLE, DRAG, Tracking, simulated
from dlocore import PointMass, SceneError
from dlocore.identify import Candidate, Replay, Resolution, identify
from dlocore.identify.frames import rest_points
from dlocore.identify.span import Span
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.scene.scene import ControlPoints, Scene

CLEAN = Tracking(noise=0.0, held=0.0, outliers=0.0, lost=0.0)
BENDS = np.array([[1.0, 0.3], [0.5, -0.2], [0.0, 0.4], [-0.3, 1.0], [0.2, 0.1]])


def natural(scene: Scene) -> np.ndarray:
    """Return the stress-free bends (points, 2) [1/m] of the sections of a scene."""
    problem = pose(scene)
    return make_grid(problem, Resolution().n_u).past().memory[:, :2]


def test_a_scene_has_the_bends_that_were_found() -> None:
    recording = simulated(3, 1.0, cable=CABLE, environment=DRAG, tracking=CLEAN)
    outer, inner = np.asarray(recording.markers)[0, [[0, -1], [1, -2]]]
    leaves = (inner - outer) * np.array([[1.0], [-1.0]])  # as the first frame has it
    replay = Replay(recording, Resolution(), leaves / np.linalg.norm(leaves, axis=1)[:, None])
    scene = replay.scene(Candidate(cable=CABLE, environment=DRAG, rest_curvature=BENDS, twist=True))
    shape, span = scene.shape, Span(replay.span.length, replay.span.u, 0.0, replay.span.length)
    assert isinstance(shape, ControlPoints)
    bare = replace(shape, material=None, control_points=np.asarray(shape.control_points)[:, :3])
    points = rest_points(BENDS, span, replay.references[0])
    given = replace(scene, shape=bare, cable=replace(scene.cable, rest_shape=points))
    assert np.abs(natural(scene)).max() > 0.9
    # 13 control points round the corners of the bends, of up to a whole 1/m
    np.testing.assert_allclose(natural(given), natural(scene), atol=0.1)


def test_the_rest_shape_is_straight_in_the_grippers() -> None:
    span = Span(0.8, np.array([-0.1, 0.9]), 0.1, 1.0)
    points = rest_points(np.array([[2.0, 0.0], [2.0, 0.0]]), span, np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(points[20], [0.0, 0.0, -0.1], atol=1e-12)  # of 200 steps and the span's ends
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(1.0)
    # an arc of 0.8 m and a radius of 0.5 m, from the straight part on, and straight again
    np.testing.assert_allclose(points[-1] - points[-2], 0.005 * np.array([np.sin(1.6), 0.0, -np.cos(1.6)]), atol=1e-9)


def test_the_cable_that_is_found_is_as_long_and_as_bent_as_it_was_found() -> None:
    recording = replace(
        simulated(3, 1.0, cable=CABLE, environment=DRAG), point_masses=(PointMass(u=0.5, mass=1e-6),)
    )  # fmt: skip
    start = Candidate(cable=CABLE, environment=DRAG, rest_curvature=BENDS, twist=True, length_ratio=1.02)
    found = identify([recording], names=("drag",), start=start, iterations=1, resolution=Resolution(n_u=9))
    assert found.cable.length == pytest.approx(1.02)
    points = np.asarray(found.cable.rest_shape, dtype=float)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(1.02)
    again = cable_of(CableModel.model_validate(document_of_identification(found)["cable"]))
    assert again.length == found.cable.length
    np.testing.assert_array_equal(np.asarray(again.rest_shape), points)


def test_a_connector_at_the_end_stays_there_where_another_length_is_found() -> None:
    cable = replace(CABLE, point_masses=(PointMass(u=0.5, mass=1e-6), PointMass(u=1.0, mass=1e-6)))
    recording = simulated(3, 1.0, cable=CABLE, environment=DRAG)
    start = Candidate(cable=cable, environment=DRAG, length_ratio=0.98)
    found = identify([recording], names=("drag",), start=start, iterations=1, resolution=Resolution(n_u=9))
    assert [one.u for one in found.cable.point_masses] == [pytest.approx(0.49), pytest.approx(0.98)]


def test_bends_without_stress_are_sought_and_not_given() -> None:
    bent = replace(CABLE, rest_shape=[[0.1 * i, 0.01 * i * i, 0.0] for i in range(11)])
    for cable, start in ((bent, None), (None, Candidate(cable=bent, environment=DRAG))):
        with pytest.raises(SceneError, match="rest_curvature") as error:
            identify([simulated(6, 0.5)], cable, start=start)
        assert error.value.field == "cable.rest_shape"
