"""What an identification says as JSON and as a page."""

from typing import Any

import numpy as np

from app.reports.identification import document_of_identification
from dlocore.identify import identify
from dlocore.recordings import Recording


def lying(**facts: Any) -> Recording:
    """Return a recording of a cable that hangs still along -y, from its first marker."""
    markers = np.zeros((40, 6, 2))
    markers[:, :, 1] = -0.1 * np.arange(6)
    given: dict[str, Any] = {"held": (0,), "linear_density": 0.05, "gravity": (0.0, -9.81, 0.0)} | facts
    return Recording(times=np.arange(40) * 0.02, markers=markers, **given)


def test_the_environment_has_the_gravity_of_the_recording() -> None:
    found = identify([lying()], names=("drag",))
    assert document_of_identification(found)["environment"]["gravity"] == [0.0, -9.81, 0.0]
    np.testing.assert_array_equal(np.asarray(found.environment.gravity), [0.0, -9.81, 0.0])
