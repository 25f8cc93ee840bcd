"""The truth against which errors are measured: a march refined until it no longer changes, or the reference."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.parts import Status
from dlocore.front import predict
from dlocore.prediction import Prediction
from dlocore.scene.scene import Quality, Scene
from dlocore.study.timing import clock

Floats = NDArray[np.float64]

SAMPLES = (101, 33)  # along the cable and in time, at which surfaces are compared
GRIDS = ((33, 65), (49, 97), (65, 129), (97, 193), (129, 257), (129, 385), (129, 513))  # (n_u, n_t)
TOLERANCE = 2e-4  # of the length: the error of the reference used as truth, if nothing else is requested
STILL = 2e-5  # of the length: a refinement that moves the motion by less is the last


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """A converged motion.

    Attributes:
        positions: (n_t, n_u, 3) [m], evenly spaced in time and along the cable.
        moved: how far the last refinement moved it, or its own estimated error [m].
        n_u, n_t: the finest grid.
        status: of the finest solve.
    """

    positions: Floats
    moved: float
    n_u: int
    n_t: int
    status: Status


def positions_of(prediction: Prediction) -> Floats:
    """Return the surface of a prediction at the points where surfaces are compared (n_t, n_u, 3) [m]."""
    return np.ascontiguousarray(prediction.surface.sample(*SAMPLES)[2][..., :3])


def finest_march(
    scene: Scene,
    *,
    still: float = STILL,
    patience: float = np.inf,
    cancelled: Callable[[], bool] | None = None,
) -> Truth:
    """March on finer and finer grids until a refinement moves the motion by less than `still` of the length.

    Args:
        scene: the scene; its quality is ignored.
        still: where to stop, as a fraction of the cable's length.
        patience: no finer grid once the marches have taken this long [s].
        cancelled: called within the solves; if it returns True they stop.

    Raises:
        SceneError: the scene can't be solved.
        Cancelled: `cancelled` returned True.
    """
    began = clock()
    before: Floats | None = None
    moved = np.inf
    for n_u, n_t in GRIDS:
        quality = Quality(n_u=n_u, n_t=n_t, method="march", estimate=False)
        prediction = predict(replace(scene, quality=quality), cancelled=cancelled, keep_grid=True)
        positions = positions_of(prediction)
        if before is not None:
            moved = float(np.linalg.norm(positions - before, axis=-1).max())
        if moved < still * scene.cable.length and prediction.status == "converged":
            break
        if clock() - began > patience:
            break
        before = positions
    return Truth(positions=positions, moved=moved, n_u=n_u, n_t=n_t, status=prediction.status)


def step_by_step(scene: Scene, *, cancelled: Callable[[], bool] | None = None) -> Truth:
    """Simulate a scene step by step, refined until the reference's own estimated error is below TOLERANCE.

    Args:
        scene: the scene; its quality is ignored.
        cancelled: called within the solve; if it returns True it stops.

    Raises:
        SceneError: the scene can't be solved, or has an effect that the reference does not cover.
        Cancelled: `cancelled` returned True.
    """
    quality = Quality(method="reference", target_error=max(TOLERANCE * scene.cable.length, 1e-6))
    return as_truth(predict(replace(scene, quality=quality), cancelled=cancelled))


def as_truth(prediction: Prediction) -> Truth:
    """Return a prediction as the truth, with its own estimated error as the error of the truth."""
    accuracy = prediction.accuracy
    return Truth(
        positions=positions_of(prediction),
        moved=np.inf if accuracy.error_estimate is None else accuracy.error_estimate,
        n_u=accuracy.n_u,
        n_t=accuracy.n_t,
        status=prediction.status,
    )


def largest_error(prediction: Prediction, truth: Truth) -> float:
    """Return the largest distance of a prediction from the truth, over the cable and time [m]."""
    return float(np.linalg.norm(positions_of(prediction) - truth.positions, axis=-1).max())
