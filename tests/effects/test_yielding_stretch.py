"""A cable that is pulled yields where its tension reaches what it yields at, and nowhere else, whatever its grid."""

from typing import Any, Literal

import numpy as np
import pytest

from dlocore import Grasp, Move, Prediction, Quality, Scene, Straight, predict
from tests.solver.scenes import WEIGHTLESS, cable

LIMIT, HARDENING, EA = 3e-3, 0.1, 1e3  # strain at which it yields, its hardening, axial stiffness [N]
QUALITIES: dict[str, dict[str, Any]] = {
    "automatic": {},
    "9": {"n_u": 9, "n_t": 33},
    "29": {"n_u": 29, "n_t": 33},
}


def pulled(
    share: float, quality: dict[str, Any], *, hold: Literal["point", "tangent"] = "point", near: float = 0.0
) -> Prediction:
    """Return a cable of 1 m that is pulled beyond a grasp at `near` [m] to a share of the strain it yields at."""
    pull = (1.0 - near) * share * LIMIT
    far = Grasp(u=1.0, hold=hold, path=Move(displacement=(pull, 0.0, 0.0), duration=1.0))
    scene = Scene(
        cable=cable(axial_stiffness=EA, yield_stretch=LIMIT, memory_rate=50.0, hardening=HARDENING),
        shape=Straight(),
        grasps=(Grasp(u=near, hold=hold), far),
        environment=WEIGHTLESS,
        horizon=2.0,
        quality=Quality(**quality),
    )
    found = predict(scene)
    assert found.status == "converged", found.message
    return found


@pytest.mark.parametrize(("hold", "share"), [("point", 0.99), ("tangent", 0.9)])  # which stretches what is between more
@pytest.mark.parametrize("quality", QUALITIES.values(), ids=QUALITIES)
def test_it_does_not_yield_below(hold, share, quality):
    found = pulled(share, quality, hold=hold)
    assert found.material is None
    assert "plasticity" not in {effect.name for effect in found.effects if effect.active}


@pytest.mark.parametrize("quality", QUALITIES.values(), ids=QUALITIES)
def test_it_yields_alike_everywhere_above(quality):
    found = pulled(1.3, quality)
    kept = 0.3 * LIMIT / (1.0 + HARDENING)
    assert found.material is not None
    stretch = found.material.stretch[-1]
    assert np.ptp(stretch) < 3e-3 * kept
    assert stretch[0] == pytest.approx(kept, rel=0.05)  # a hundredth of the strain at most
    assert found.grasps[1].reaction[-1, 0] == pytest.approx(EA * (1.3 * LIMIT - kept), rel=2e-3)


@pytest.mark.parametrize(
    ("hold", "share", "yields"),
    [("point", 0.97, False), ("point", 1.03, True), ("tangent", 0.9, False), ("tangent", 1.03, True)],
)
def test_it_yields_on_one_side_of_a_grasp_as_by_its_tension(hold, share, yields):
    found = pulled(share, {"n_u": 13, "n_t": 33}, hold=hold, near=0.4)
    assert (found.material is not None) == yields


def test_a_cable_that_goes_on_keeps_what_it_yielded():
    found = pulled(1.3, QUALITIES["9"])
    held = (Grasp(u=0.0), Grasp(u=1.0))
    on = Scene(cable=found.scene.cable, shape=found.shape_at(), grasps=held, environment=WEIGHTLESS, horizon=0.5)
    after = predict(on)
    assert after.status == "converged", after.message
    assert after.material is not None
    assert found.material is not None
    np.testing.assert_allclose(after.material.stretch[-1], found.material.stretch[-1][0], rtol=0.03)  # of another grid
    np.testing.assert_allclose(after.grasps[1].reaction[-1], found.grasps[1].reaction[-1], rtol=0, atol=0.01)
