"""Starts that settle on something rough: they slide until friction holds them, as the reference's do."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Points, Prediction, Quality, Scene, Sphere, Table, predict
from tests.solver.scenes import Floats, apart, cable

U = np.linspace(0.0, 1.0, 65)


def wave(height: float) -> Floats:
    """Return points along a wave on a table."""
    x = np.linspace(0.0, 1.0, 121)
    return np.column_stack([x, height * np.sin(3.0 * np.pi * x), 0.0 * x])


def lying(points: Floats, mu: float, stiffness: float, **changes: object) -> Scene:
    """Return a cable of 1 m that settles along points on a table, held at one end, for a second."""
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return Scene(
        cable=cable(bending_stiffness=stiffness, **changes),
        shape=Points(points=points / length, settle=True),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=Environment(drag=0.05, table=Table(friction=mu)),
        horizon=1.0,
    )


def start(prediction: Prediction) -> Floats:
    assert prediction.status == "converged", prediction.message
    return prediction.surface.positions(U, [0.0])[0]


def farthest(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(a - b, axis=1).max())


def given(scene: Scene) -> Floats:
    return start(predict(replace(scene, shape=replace(scene.shape, settle=False))))


def test_a_limp_cable_lies_as_it_was_laid_where_the_table_is_rough() -> None:
    limp = lying(wave(0.1), 0.5, 1e-5)
    assert farthest(start(predict(limp)), given(limp)) < 1e-3
    smooth = lying(wave(0.1), 0.0, 1e-5)
    assert farthest(start(predict(smooth)), given(smooth)) > 0.1  # there nothing keeps it from straightening


@pytest.mark.parametrize("stiffness", [1e-3, 1e-2])
@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_a_springy_cable_slides_to_where_the_reference_slides(mu: float, stiffness: float) -> None:
    scene = lying(wave(0.1), mu, stiffness)
    found = start(predict(scene))
    assert farthest(found, given(scene)) > 5e-3
    reference = start(predict(replace(scene, quality=Quality(method="reference", target_error=2e-3))))
    assert farthest(found, reference) < 3e-3  # what friction holds depends a little on the way there


def test_it_rests_where_it_has_settled() -> None:
    prediction = predict(lying(wave(0.1), 0.4, 1e-2))
    t = np.linspace(0.0, 1.0, 21)
    moved = prediction.surface.positions(U, t) - prediction.surface.positions(U, [0.0])
    assert np.abs(moved).max() < 1e-3


def test_what_the_sections_remember_stays_as_they_slide() -> None:
    # bent far beyond its yield strain where it lies: it keeps its stress-free shape until the motion begins
    bent = lying(wave(0.1), 0.4, 1e-2, yield_strain=1e-3, memory_rate=100.0)
    elastic = lying(wave(0.1), 0.4, 1e-2)
    assert farthest(start(predict(bent)), start(predict(elastic))) < 1e-3


def test_a_cable_laid_over_a_rough_ball_hangs_as_the_reference_has_it() -> None:
    ball = Sphere(center=(0.0, 0.0, -0.1025), radius=0.1, friction=0.3)
    a = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 33)
    over = np.column_stack([0.1025 * np.sin(a), 0.0 * a, 0.1025 * np.cos(a) - 0.1025])
    down = np.linspace(0.02, 0.3, 15)[:, None] * [0.0, 0.0, -1.0]
    points = np.vstack([(over[0] + down)[::-1], over, over[-1] + down])
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    scene = Scene(
        cable=Cable(length=length, diameter=0.005, linear_density=0.05, bending_stiffness=1e-4),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.5 * length),),
        environment=Environment(drag=0.5, obstacles=(ball,)),
        horizon=0.3,
        effects={"self_contact": "off"},
    )
    found = predict(scene)
    reference = predict(replace(scene, quality=Quality(method="reference", target_error=2e-3)))
    assert found.status == reference.status == "converged"
    assert apart(found.surface, reference.surface)[0].max() < 2e-3
