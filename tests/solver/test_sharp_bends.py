"""Bends beside grippers that are sharper than the surface shows are told of, others are not."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.targets import between_clamps
from dlocore import Grasp, Prediction, Quality, Scene, predict
from tests.solver.scenes import march


def between(bending: float, **changes: float) -> Scene:
    scene = between_clamps(bending, "carried", "as given")
    return replace(scene, cable=replace(scene.cable, **changes))


def solved(scene: Scene, n_u: int) -> Prediction:
    return predict(replace(scene, quality=replace(march(n_u, 49), keep_grid=True)))


def told(prediction: Prediction) -> tuple[float, float] | None:
    """Return the curvatures [1/m] that a note tells, by the moment and of the surface."""
    notes = [note for note in prediction.notes if "more sharply than the surface shows" in note]
    if not notes:
        return None
    (note,) = notes
    by_moment, shown = note.split("surface shows: with ")[1].split(" and ")
    return float(by_moment.split(" /m")[0]), float(shown.split(" /m")[0])


def test_the_curvature_lies_between_those_of_the_moment_and_of_the_surface() -> None:
    scene = between(1e-5)
    both = [told(solved(scene, n_u)) for n_u in (13, 19, 28)]
    fine = solved(scene, 129)
    assert told(fine) is None
    u, t = np.linspace(0.0, 1.0, 2001), np.linspace(0.0, fine.surface.horizon, 101)
    truth = float(fine.surface.curvature(u, t).max())
    for one, finer in zip(both, [*both[1:], (truth, truth)], strict=True):
        assert one is not None
        assert finer is not None
        assert one[1] < 0.75 * one[0]
        assert one[1] < finer[1] <= truth
        assert one[0] > 0.98 * finer[0]


def test_the_default_quality_is_told_what_it_hides() -> None:
    coarse = told(predict(replace(between(1e-5), quality=Quality())))
    limp = told(predict(replace(between(1e-6), quality=Quality())))
    assert coarse == pytest.approx((41.0, 19.0), rel=0.02)  # as docs/api.md says
    assert limp == pytest.approx((264.0, 20.0), rel=0.02)
    assert told(solved(between(1e-6), 129)) == pytest.approx((116.0, 80.0), rel=0.01)
    fine = solved(between(1e-5), 129)
    shown = fine.surface.curvature(np.linspace(0.0, 1.0, 2001), np.linspace(0.0, fine.surface.horizon, 201)).max()
    by_moment = max(np.linalg.norm(grasp.moment, axis=1).max() for grasp in fine.grasps) / 1e-5
    assert 38.0 < shown < by_moment < 40.5


@pytest.mark.parametrize("bending", [1e-3, 1e-2])
def test_what_a_grid_shows_is_not_told_of(bending: float) -> None:
    assert told(predict(replace(between(bending), quality=Quality()))) is None


def test_a_cable_whose_moment_does_not_tell_its_curvature_is_not_told_of() -> None:
    scene = between(1e-5, yield_strain=0.02, memory_rate=5.0)
    plastic = predict(replace(scene, quality=replace(march(19, 25), keep_grid=True)))
    assert any(effect.name == "plasticity" and effect.active for effect in plastic.effects)
    assert told(plastic) is None
    bent = between(1e-5, rest_shape="initial")
    assert told(solved(bent, 19)) is None


def test_the_moment_of_damping_tells_no_curvature() -> None:
    moving = between(1e-5, bending_damping=3e-5)
    prediction = solved(moving, 19)
    sizes = np.linalg.norm([grasp.moment for grasp in prediction.grasps], axis=2) / 1e-5
    u, t = np.linspace(0.0, 1.0, 401), np.linspace(0.0, prediction.surface.horizon, 101)
    assert sizes.max() > 1.5 * prediction.surface.curvature(u, t).max()
    assert told(prediction) is None
    still = tuple(Grasp(u=grasp.u, hold=grasp.hold) for grasp in moving.grasps)
    resting = replace(moving, shape=replace(moving.shape, settle=True), grasps=still, horizon=1.0)
    assert told(solved(resting, 19)) is not None  # nothing is damped


def test_wide_bends_are_not_told_of() -> None:
    thin = between(1e-5, diameter=5e-5)
    assert told(solved(between(1e-5), 19)) is not None
    assert told(solved(thin, 19)) is None
