"""A motion that is its own mirror image is told of where a cable that is a little lopsided would go elsewhere."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore import Cable, Environment, Grasp, Move, Points, Scene, Straight, Table, predict

Floats = NDArray[np.float64]

LYING = Environment(drag=0.2, table=Table())
NOTE = "its own mirror image, which is unstable"


def arch() -> Floats:
    """Return points along an arc that turns by two radians."""
    turn = np.linspace(1.0, -1.0, 401)
    middle = 0.5 * (turn[1:] + turn[:-1])
    x, y = (np.concatenate([[0.0], np.cumsum(f(middle))]) / 400 for f in (np.cos, np.sin))
    return np.column_stack([x, y, 0.0 * x])[::10]


def pushed_through(hold: Any, at: float = 0.5) -> Scene:
    """Return an arch between two grasps that a third one, in its middle or beside it, takes to its other side."""
    points = arch()
    down = Move(displacement=(0.0, -1.6 * points[:, 1].max(), 0.0), duration=1.5)
    grasps = (Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold), Grasp(u=at, path=down))
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2)
    shape = Points(points=points, settle=True)
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=LYING, horizon=2.0)


def test_an_arch_that_turns_freely_at_its_ends_could_tip_to_either_side() -> None:
    prediction = predict(pushed_through("point"))
    assert prediction.status == "converged", prediction.message
    assert NOTE in prediction.message


def test_so_it_could_where_it_is_let_go_at_last() -> None:
    scene = pushed_through("point")
    *ends, middle = scene.grasps
    let_go = replace(scene, grasps=(*ends, replace(middle, release_time=1.95)))  # few steps would do for what is left
    prediction = predict(let_go)
    assert prediction.status == "converged", prediction.message
    assert prediction.level is not None
    assert prediction.level.motion.steps > prediction.level.motion.asked
    assert NOTE in prediction.message


def test_it_does_tip_where_it_is_lopsided() -> None:
    symmetric = pushed_through("point")
    u = np.linspace(0.0, 1.0, 41)[:, None]
    tipped = replace(symmetric.shape, points=arch() + 1e-3 * np.sin(2.0 * np.pi * u) * [0.0, 1.0, 0.0])
    prediction = predict(replace(symmetric, shape=tipped))
    at = np.linspace(0.0, 1.0, 65)
    away = prediction.surface.positions(at, 2.0) - predict(symmetric).surface.positions(at, 2.0)
    assert np.linalg.norm(away, axis=-1).max() > 0.1
    assert NOTE not in prediction.message


@pytest.mark.parametrize(
    "scene",
    [
        pushed_through("tangent"),
        pushed_through("point", 0.45),
        Scene(
            cable=Cable.preset("paper"),
            shape=Straight(),
            grasps=(Grasp(u=0.5, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6)),),
            environment=LYING,
        ),
        Scene(cable=Cable.preset("paper"), shape=Straight(), environment=LYING, horizon=1.0),
    ],
    ids=["directions held", "beside the middle", "drawn by its middle", "at rest"],
)
def test_what_is_stable_or_not_symmetric_is_not_told_of(scene: Scene) -> None:
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    assert NOTE not in prediction.message
