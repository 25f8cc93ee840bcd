"""A cable settles as if it did not yield; where at rest it would, an equilibrium and a motion from it say so.

So does an equilibrium in which the cable is stretched by more than few bear.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, Straight, equilibrium, predict

TOLD = "yielding is left out as the cable settles"
CLAMPED = Grasp(u=0.0, hold="clamp")


def cable(**changes: Any) -> Cable:
    values = {"length": 0.5, "diameter": 0.004, "linear_density": 0.05, "bending_stiffness": 2e-2, "memory_rate": 50.0}
    return Cable(**(values | changes))


def cantilever(yield_strain: float, **changes: Any) -> Scene:
    """Return a cable that is clamped at one end and bends by up to 2.86/m under its weight."""
    return Scene(cable=cable(yield_strain=yield_strain), shape=Straight(), grasps=(CLAMPED,), horizon=0.1, **changes)


@pytest.mark.parametrize("twist", ["off", "on"])
def test_an_equilibrium_tells_that_it_bends_a_cable_by_more_than_it_yields_at(twist: str) -> None:
    found = equilibrium(cantilever(0.004, effects={"twist": twist}), n_u=25)
    assert f"{TOLD}: at rest it is bent by 2.8" in found.message
    assert "yields at 2/m" in found.message
    assert TOLD not in equilibrium(cantilever(0.006, effects={"twist": twist}), n_u=25).message


def test_it_tells_of_twist() -> None:
    turned = Grasp(u=0.5, hold="clamp", path=Move(displacement=(0.0, 0.0, 0.0), rotation=(2.0, 0.0, 0.0), duration=1.0))
    scene = Scene(
        cable=cable(yield_twist=0.004),
        shape=Straight(),
        grasps=(CLAMPED, turned),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        horizon=1.0,
    )
    assert f"{TOLD}: at rest it is twisted by 4 rad/m, but it yields at 2 rad/m" in equilibrium(scene, at=1.0).message
    assert TOLD not in equilibrium(scene, at=0.4).message


def test_it_tells_of_stretch() -> None:
    down = Straight(direction=(0.0, 0.0, -1.0))
    hangs = Scene(
        cable=cable(yield_stretch=0.002, axial_stiffness=50.0), shape=down, grasps=(Grasp(u=0.0),), horizon=1.0
    )
    assert f"{TOLD}: at rest it is stretched by 0.0048" in equilibrium(hangs, n_u=17).message
    firm = replace(hangs, cable=cable(yield_stretch=0.006, axial_stiffness=50.0))
    assert TOLD not in equilibrium(firm, n_u=17).message


def test_a_cable_that_is_bent_without_stress_does_not_yield() -> None:
    angle = np.linspace(0.0, 3.0, 33)
    points = np.column_stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle]) / 6.0
    scene = Scene(
        cable=cable(yield_strain=0.004, rest_shape="initial"),
        shape=Points(points=points),
        grasps=(CLAMPED,),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        horizon=1.0,
    )
    assert TOLD not in equilibrium(scene, n_u=25).message


def test_a_motion_from_such_a_rest_tells() -> None:
    settled = cantilever(0.004, quality=Quality(n_u=17, n_t=13, method="march", estimate=False))
    settled = replace(settled, shape=Straight(settle=True))
    assert any(TOLD in note for note in predict(settled).notes)
    assert not any(TOLD in note for note in predict(replace(settled, cable=cable(yield_strain=0.006))).notes)
    assert not any(TOLD in note for note in predict(replace(settled, shape=Straight())).notes)


# --- cables that are stretched by more than few bear ---

DOWN = Straight(direction=(0.0, 0.0, -1.0))


def elastic(**changes: Any) -> Cable:
    return cable(memory_rate=None, **changes)


@pytest.mark.parametrize(
    ("far", "status", "words"),
    [
        (0.001, "converged", "Two grids agree"),
        (0.02, "converged", "the equilibrium strains the cable by up to 10% along itself, with the 2e+04 N of a solid"),
        (0.2, "stalled", "strained along itself by 101%, which no cable can follow. Bring the grasps no farther apart"),
    ],
)
def test_an_equilibrium_tells_that_grippers_stretch_the_cable(far: float, status: str, words: str) -> None:
    # the second closes where the cable hangs from the first, 0.2 m below, and takes it on
    on = Grasp(u=0.3, grasp_time=1.0, path=Move(displacement=(0.0, 0.0, -far), duration=1.0))
    found = equilibrium(Scene(cable=elastic(), shape=DOWN, grasps=(Grasp(u=0.1), on), horizon=2.0), at=2.0)
    assert found.status == status
    assert words in found.message
    assert ("strain" in found.message) == (far > 0.01)


def test_it_tells_that_its_own_weight_does() -> None:
    soft = Scene(cable=elastic(axial_stiffness=1.0), shape=DOWN, grasps=(Grasp(u=0.0),), horizon=1.0)
    torn = equilibrium(soft, n_u=17)
    assert torn.status == "stalled"
    assert "which no cable can follow. Its axial stiffness is 1 N: give it more, or less mass" in torn.message
    assert "by up to" not in torn.message
    firmer = equilibrium(replace(soft, cable=elastic(axial_stiffness=3.0)), n_u=17)
    assert firmer.status == "converged"
    assert (
        "the equilibrium strains the cable by up to 9% along itself." in firmer.message
    )  # 8.2 %, and beside the grasp
