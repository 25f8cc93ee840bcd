"""The part of a cable that is replayed, and what hangs on it."""

from typing import Any

import numpy as np
import pytest

from dlocore import Cable, Environment, PointMass
from dlocore.identify import Candidate, Replay, Resolution
from dlocore.identify.rest import Rest
from dlocore.identify.span import Span
from dlocore.recordings import Recording

U = np.linspace(0.0, 1.0, 17)
CLAMPED: dict[str, Any] = {"held": (0, 1, -2, -1), "u": [0.0, 0.05, *U[2:-2], 0.95, 1.0]}


def held(**facts: Any) -> Recording:
    """Return a recording of a cable of 1 m that hangs still along -z."""
    u = np.asarray(facts.get("u", U))
    markers = np.zeros((20, len(u), 3))
    markers[..., 2] = -u
    return Recording(times=0.01 * np.arange(20), markers=markers, **({"u": U, "length": 1.0} | facts))


def cable(*masses: tuple[float, float], length: float = 1.0) -> Cable:
    return Cable(
        length=length, diameter=0.005, linear_density=0.04, bending_stiffness=1e-2, axial_stiffness=500.0,
        point_masses=tuple(PointMass(u=u, mass=mass) for u, mass in masses),
    )  # fmt: skip


def masses(of: Cable) -> list[tuple[float, float]]:
    return [(one.u, one.mass) for one in of.point_masses]


def test_point_masses_lie_where_they_lay_on_the_whole_cable() -> None:
    span = Span.of(held(**CLAMPED))
    on = span.of_cable(cable((0.02, 1.0), (0.05, 2.0), (0.5, 3.0), (0.95, 4.0), (1.0, 5.0)))
    assert on.length == pytest.approx(0.9)
    # those between the markers of a gripper are in its jaws
    assert masses(on) == [(0.0, 2.0), (pytest.approx(0.45), 3.0), (pytest.approx(0.9), 4.0)]


def test_point_masses_of_a_longer_cable_lie_farther_along_it() -> None:
    span = Span.of(held(held=(0, 1), u=CLAMPED["u"])).scaled(1.1)
    assert masses(span.of_cable(cable((0.5, 3.0), (1.0, 5.0)))) == [
        (pytest.approx(1.1 * 0.45), 3.0),
        (pytest.approx(1.1 * 0.95), 5.0),
    ]


def test_a_point_mass_at_the_end_of_a_guess_that_is_longer_is_at_the_end() -> None:
    span = Span.of(held(held=(0,)))
    assert masses(span.of_cable(cable((0.6, 3.0), (1.2, 5.0), length=1.2))) == [(0.5, 3.0), (1.0, 5.0)]


@pytest.mark.parametrize("static", [False, True])
def test_scenes_of_a_clamped_cable_have_its_connector_at_its_free_end(static: bool) -> None:
    recording = held(held=(0, 1), u=CLAMPED["u"], static=static)
    candidate = Candidate(cable=cable((1.0, 0.02)), environment=Environment())
    if static:
        scene = Rest(recording, Resolution()).scene(candidate, 0)
    else:
        scene = Replay(recording, Resolution()).scene(candidate)
    assert masses(scene.cable) == [(pytest.approx(0.95), 0.02)]
