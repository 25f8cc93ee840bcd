"""A stretched cable whose end is held by its direction, with unit length: what that costs is in the estimate."""

import pytest

from dlocore import Cable, Grasp, Prediction, Quality, Scene, Straight, predict
from dlocore.scene.scene import Hold, Method

WEIGHT = 0.5 * 9.81  # [N] of a metre


def hung(hold: Hold, axial_stiffness: float, quality: Quality, u: float = 0.0) -> Scene:
    cable = Cable(
        length=1.0, diameter=0.01, linear_density=0.5, bending_stiffness=1e-3, axial_stiffness=axial_stiffness
    )
    down = Straight(direction=(0.0, 0.0, -1.0 if u == 0.0 else 1.0), settle=True)
    return Scene(cable=cable, shape=down, grasps=[Grasp(u=u, hold=hold)], horizon=0.5, quality=quality)


def error(found: Prediction) -> float:
    """Return how far the free end is from where it hangs in equilibrium [m]."""
    u = found.scene.grasps[0].u
    free, held = found.surface.positions([1.0 - u, u], [0.5])[0, :, 2]
    return abs(held - free - 1.0 - 0.5 * WEIGHT / found.scene.cable.axial_stiffness)


@pytest.mark.parametrize("method", ["march", "spacetime"])
@pytest.mark.parametrize("hold", ["tangent", "clamp"])
@pytest.mark.parametrize("n_u", [9, 13, 28, 62])
def test_the_estimate_of_a_given_grid_is_its_error(n_u: int, hold: Hold, method: Method) -> None:
    found = predict(hung(hold, 100.0, Quality(n_u=n_u, n_t=13, method=method, keep_grid=True)))
    assert found.status == "converged"
    assert found.accuracy.error_estimate == pytest.approx(error(found), rel=0.35)
    assert type(found.accuracy.error_parts["grid"]) is float


@pytest.mark.parametrize("u", [0.0, 1.0])
@pytest.mark.parametrize(("axial_stiffness", "target"), [(40.0, 1e-3), (40.0, 2e-4), (100.0, 1e-4)])
def test_a_target_is_met(axial_stiffness: float, target: float, u: float) -> None:
    """0.29 mm were off for a target of 0.2 mm, and 0.12 for one of 0.1."""
    found = predict(hung("tangent", axial_stiffness, Quality(target_error=target), u))
    assert found.status == "converged"
    assert error(found) < target
    assert found.accuracy.error_estimate == pytest.approx(error(found), rel=0.25)


def test_where_a_point_alone_is_held_or_hardly_stretches_nothing_is_added() -> None:
    soft, stiff = (predict(hung(hold, EA, Quality())) for hold, EA in (("point", 40.0), ("clamp", 1e6)))
    assert soft.level.held_back == stiff.level.held_back == 0.0
