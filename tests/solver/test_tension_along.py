"""The tension along a cable as its axial strain tells, against the forces on it and the reference."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    Environment,
    Grasp,
    Load,
    Move,
    PointMass,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    predict,
)
from tests.solver.scenes import Floats, G

CABLE = Cable.preset("black-electric-cable")  # of 1 m and 1 kg
DOWN = Straight(direction=(0.0, 0.0, -1.0), settle=True)
NOWHERE = Environment(gravity=(0.0, 0.0, 0.0))
GRIDS = {
    "free": Quality(),
    "9": Quality(n_u=9, n_t=13, keep_grid=True),
    "33": Quality(n_u=33, n_t=13, keep_grid=True),
}
PULL = (0.0, 0.0, -20.0)  # [N]


def tension(prediction: Prediction, t: float) -> tuple[Floats, Floats]:
    """Return the places (k,) [m] at which a prediction tells the strain, and the tension there (k,) [N]."""
    return prediction.stretch.u, prediction.scene.cable.axial_stiffness * prediction.stretch.at(t)


def held(hold: str, grid: str, **rest: Any) -> Scene:
    """Return the scene of a cable that is held at its top."""
    grasps = [Grasp(u=0.0, hold=hold)]  # type: ignore[arg-type]
    return Scene(**{"cable": CABLE, "shape": DOWN, "grasps": grasps, "horizon": 1.0, "quality": GRIDS[grid], **rest})


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("hold", ["point", "clamp"])
def test_the_tension_of_a_hanging_cable_is_the_weight_below(hold: str, grid: str) -> None:
    u, found = tension(predict(held(hold, grid)), 1.0)
    assert u[0] == 0.0
    assert u[-1] == 1.0
    np.testing.assert_allclose(found, G * (1.0 - u), atol=1e-6 * G)


@pytest.mark.parametrize("tip", [1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("hold", ["point", "clamp"])
def test_the_tension_is_told_where_a_gripper_holds_just_beside_an_end(hold: Any, tip: float) -> None:
    """A tip of up to half a diameter has no span of its own, and no point at which the tension is known."""
    u, found = tension(predict(replace(held(hold, "free"), grasps=[Grasp(u=tip, hold=hold)])), 1.0)
    inside = u > tip
    np.testing.assert_allclose(found[inside], G * (1.0 - u[inside]), atol=1.1 * tip * G)
    assert np.abs(found).max() < 1.01 * G


@pytest.mark.parametrize("u", [0.0005, 0.9995])
def test_a_cable_that_was_held_just_beside_an_end_goes_on(u: float) -> None:
    path = Move(displacement=(0.0, 0.2, 0.0), duration=1.0)
    scene = Scene(cable=Cable.preset("paper"), shape=Straight(), grasps=[Grasp(u=u, path=path)])
    prediction = predict(scene)
    (size,) = (effect.magnitude for effect in prediction.effects if effect.name == "stretch")
    assert size is not None
    assert size < 3e-3
    shape = prediction.shape_at()
    assert np.abs(np.array(shape.strain)).max() < 3e-3
    assert predict(replace(scene, shape=shape, grasps=[Grasp(u=u)], horizon=0.3)).status == "converged"


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("hold", ["point", "clamp"])
def test_the_tension_of_a_cable_that_is_pulled_at_its_end_is_the_pull(hold: str, grid: str) -> None:
    _, found = tension(predict(held(hold, grid, loads=[Load(u=1.0, force=PULL)], environment=NOWHERE)), 1.0)
    np.testing.assert_allclose(found, 20.0, rtol=1e-6)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("hold", ["point", "clamp"])
def test_the_tension_jumps_where_a_weight_hangs_on_the_cable(hold: str, grid: str) -> None:
    u, found = tension(predict(held(hold, grid, loads=[Load(u=0.5, force=PULL)])), 1.0)
    np.testing.assert_allclose(found, G * (1.0 - u) + 20.0 * np.heaviside(0.5 - u, 0.5), atol=1e-6 * G)


@pytest.mark.parametrize("hold", ["point", "clamp"])
def test_the_tension_jumps_at_the_places_themselves(hold: str) -> None:
    """Between the places at which it was told, on either side, it had been read along a slope of a whole span."""
    cable = replace(CABLE, point_masses=(PointMass(u=0.7, mass=1.0),))
    scene = held(hold, "free", cable=cable, loads=[Load(u=0.4, force=PULL)], horizon=0.1)
    u = np.array([0.38, 0.399, 0.4, 0.401, 0.42, 0.68, 0.699, 0.7, 0.701, 0.72])
    found = CABLE.axial_stiffness * predict(scene).stretch.along(u, [0.1])[0]  # type: ignore[operator]
    expected = G * (1.0 - u) + 20.0 * np.heaviside(0.4 - u, 0.5) + G * np.heaviside(0.7 - u, 0.5)
    np.testing.assert_allclose(found, expected, atol=1e-6 * G)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("hold", ["point", "clamp"])
def test_the_tension_of_a_cable_that_is_pulled_along_itself_accelerates_what_follows(hold: str, grid: str) -> None:
    up = Move(displacement=(0.0, 0.0, 0.5), duration=1.0)
    scene = held(hold, grid, shape=replace(DOWN, settle=False), environment=NOWHERE)
    prediction = predict(replace(scene, grasps=(replace(scene.grasps[0], path=up),)))
    t = prediction.stretch.times[np.argmin(np.abs(prediction.stretch.times - 0.21))]
    acceleration = 0.5 * (60.0 * t - 180.0 * t**2 + 120.0 * t**3)  # of the minimum jerk
    assert acceleration > 2.5
    u, found = tension(prediction, t)
    np.testing.assert_allclose(found, acceleration * (1.0 - u), atol=0.005 * acceleration)


def test_the_tension_of_a_cable_that_swings_between_two_grippers_is_that_of_the_reference() -> None:
    carried = Grasp(u=0.0, path=Move(displacement=(0.3, 0.0, 0.2), duration=0.5))
    scene = Scene(
        cable=CABLE,
        shape=Straight(settle=True),
        grasps=[carried, Grasp(u=1.0)],
        environment=Environment(drag=2.0),
        horizon=0.6,
    )
    u, found = tension(predict(scene), 0.6)
    places, true = tension(predict(replace(scene, quality=Quality(method="reference"))), 0.6)
    assert true.max() > 6.0
    np.testing.assert_allclose(found, np.interp(u, places, true), atol=0.1)


def test_the_reported_stretch_is_that_at_the_top_of_a_hanging_cable() -> None:
    (stretch,) = (effect for effect in predict(held("point", "free")).effects if effect.name == "stretch")
    assert stretch.magnitude == pytest.approx(G / CABLE.axial_stiffness, rel=1e-6)


def test_the_strain_is_read_linearly_between_places_and_times() -> None:
    stretch = predict(held("point", "free")).stretch
    t = 0.5 * (stretch.times[3] + stretch.times[4])
    found = stretch.along(0.5 * (stretch.u[1:] + stretch.u[:-1]), np.array([0.0, t]))
    assert found.shape == (2, len(stretch.u) - 1)
    row = stretch.at(t)
    np.testing.assert_allclose(found[1], 0.5 * (row[1:] + row[:-1]), rtol=1e-12)


@pytest.mark.parametrize("n_u", [19, 34, 41, 62, 90, 129])
@pytest.mark.parametrize("inside", [False, True])
def test_beside_a_held_direction_the_tension_is_what_its_gripper_pulls_with(n_u: int, inside: bool) -> None:
    """On fine grids what the two sides of an end differ by, which is rounding, had been taken for a force."""
    s = np.linspace(0.0, 1.0, 81)
    bow = np.stack([0.8 * s, 0.0 * s, -0.25 * np.sin(np.pi * s)], axis=1)
    bow /= np.linalg.norm(np.diff(bow, axis=0), axis=1).sum()
    grasps = [Grasp(u=0.0), Grasp(u=1.0, hold="tangent"), *([Grasp(u=0.3, hold="tangent")] if inside else [])]
    found = predict(
        Scene(
            cable=Cable.preset("paper"), shape=Points(points=bow, settle=True), grasps=grasps, horizon=0.05,
            quality=Quality(n_u=n_u, n_t=13, keep_grid=True),
        )
    )  # fmt: skip
    along = found.surface([1.0], [0.05], du=1)[0, 0, :3]
    pulls = float(found.grasps[1].reaction[-1] @ along / np.linalg.norm(along))
    tells = found.scene.cable.axial_stiffness * found.stretch.along([1.0], [0.05])[0, 0]  # type: ignore[operator]
    assert tells == pytest.approx(pulls, rel=1e-6)
    if inside:
        middle = found.scene.cable.axial_stiffness * found.stretch.along([0.28, 0.3, 0.32], [0.05])[0]
        assert middle[1] == pytest.approx(0.5 * (middle[0] + middle[2]), abs=0.01)


def test_the_energy_of_stretch_is_that_of_the_tension() -> None:
    """A bar that spins has the tension mu w^2 (L^2/4 - s^2)/2: a millionth of its motion, which the surface hides."""
    spin, x = 6.0, np.linspace(0.0, 1.0, 5)
    rod = Cable(length=1.0, diameter=0.007, linear_density=0.07, bending_stiffness=1.0)
    across = np.column_stack([0.0 * x, spin * (x - 0.5), 0.0 * x])
    shape = Points(points=np.column_stack([x, 0.0 * x, 0.0 * x]), velocity=across)
    quality = Quality(n_u=17, n_t=49, keep_grid=True)
    prediction = predict(Scene(cable=rod, shape=shape, environment=NOWHERE, horizon=1.0, quality=quality))
    t = np.linspace(0.1, 1.0, 19)  # it begins unstretched, and rings until then
    expected = (0.07 * spin**2) ** 2 / (240.0 * rod.axial_stiffness)  # type: ignore[operator]
    np.testing.assert_allclose(prediction.energies(t)["stretch"], expected, rtol=0.01)
    np.testing.assert_allclose(prediction.energies(t)["kinetic"], 0.07 * spin**2 / 24.0, rtol=0.01)


LIMP = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=640.0)


@pytest.mark.parametrize("loads", [(), [Load(u=0.0, force=(1.0, 0.0, 0.0))]], ids=["weight", "gripper pulled"])
@pytest.mark.parametrize("grid", GRIDS)
def test_where_a_level_clamp_bends_a_limp_cable_it_has_no_tension(grid: str, loads: Any) -> None:
    """The weight acts across it there, and along it a little farther on, where it hangs."""
    shape = Straight(settle=True)
    prediction = predict(held("clamp", grid, cable=LIMP, shape=shape, loads=loads, horizon=0.1))
    found = 640.0 * prediction.stretch.along([0.0, 0.2], [0.1])[0]
    weight = LIMP.mass * G
    assert found[0] == pytest.approx(0.0, abs=1e-3 * weight)  # on 9 to 13 control points it was a quarter of the weight
    assert found[1] == pytest.approx(0.8 * weight, abs=0.05 * weight)


def test_an_end_that_is_let_go_loses_its_tension() -> None:
    taut = Straight(direction=(0.0, 0.0, -1.0), settle=True)
    down = Move(displacement=(0.0, 0.0, -0.003), duration=0.1)
    grasps = [Grasp(u=0.0), Grasp(u=1.0, hold="tangent", path=down, release_time=0.1)]
    stretch = predict(held("point", "free", cable=LIMP, shape=taut, grasps=grasps, horizon=0.3)).stretch
    before, after = 640.0 * stretch.along([1.0], [0.1, 0.3])[:, 0]
    assert before > 1.0
    assert after == pytest.approx(0.0, abs=1e-6)


def test_what_a_gripper_carries_beside_the_cable_is_no_tension() -> None:
    cable = replace(CABLE, point_masses=(PointMass(u=0.0, mass=1.0),))
    u, found = tension(predict(held("clamp", "free", cable=cable, horizon=0.1)), 0.1)
    np.testing.assert_allclose(found, G * (1.0 - u), atol=1e-6 * G)


@pytest.mark.parametrize("grid", GRIDS)
def test_the_strain_at_a_clamp_is_told_without_what_axial_damping_adds_to_the_tension(grid: str) -> None:
    up = Move(displacement=(0.0, 0.0, 0.5), duration=1.0)
    damped = replace(CABLE, axial_damping=0.05 * CABLE.axial_stiffness)  # type: ignore[operator]
    scene = held("clamp", grid, cable=damped, shape=replace(DOWN, settle=False), environment=NOWHERE)
    u, found = tension(predict(replace(scene, grasps=(replace(scene.grasps[0], path=up),))), 0.1)
    beside = found[(u > 0.1) & (u < 0.9)]
    line = np.polynomial.Polynomial.fit(u[(u > 0.1) & (u < 0.9)], beside, 1)
    assert line(0.0) > 1.0
    assert found[0] == pytest.approx(line(0.0), rel=0.02)  # the force of the clamp is 60 % larger
