"""Point masses: against closed forms, the laws of mechanics and a solver that shares no code (docs/model.md eq. 9a)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.hard.images import mirrored, other_units, reversed_cable, seen, turned
from dlocore import (
    Cable,
    Cylinder,
    Environment,
    Grasp,
    Move,
    PointMass,
    Points,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Still,
    Straight,
    Table,
    equilibrium,
    plan,
    predict,
    sensitivities,
)

G = 9.81
MU, LENGTH = 0.05, 1.0
CONNECTOR = (PointMass(u=LENGTH, mass=0.03),)


def cable(masses: tuple[PointMass, ...] = CONNECTOR, **changes: float) -> Cable:
    values = {"length": LENGTH, "diameter": 0.005, "linear_density": MU, "bending_stiffness": 1e-3} | changes
    return Cable(**values, point_masses=masses)


def converged(scene: Scene) -> Prediction:
    found = predict(scene)
    assert found.status == "converged", found.message
    return found


def apart(a: Prediction, b: Prediction) -> float:
    u, t = np.linspace(0.0, a.surface.length, 41), np.linspace(0.0, a.surface.horizon, 33)
    return float(np.linalg.norm(a.surface.positions(u, t) - b.surface.positions(u, t), axis=-1).max())


def test_a_cantilever_bends_under_a_mass_at_its_end_as_beam_theory_says() -> None:
    EI, m = 4.0, 0.1
    beam = cable((PointMass(u=LENGTH, mass=m),), bending_stiffness=EI)
    clamp = (Grasp(u=0.0, hold="clamp", path=Still()),)
    found = equilibrium(Scene(cable=beam, shape=Straight(), grasps=clamp, horizon=1.0))
    sag = G * (m * LENGTH**3 / (3.0 * EI) + MU * LENGTH**4 / (8.0 * EI))
    assert -found.positions([LENGTH])[0, 2] == pytest.approx(sag, rel=0.02)  # of small bends; it is 10 % of the length


def test_a_cantilever_swings_with_a_mass_at_its_end_as_beam_theory_says() -> None:
    EI, m = 1.0, 0.05
    ratio = m / (MU * LENGTH)

    def characteristic(k: float) -> float:
        c, s, ch, sh = math.cos(k), math.sin(k), math.cosh(k), math.sinh(k)
        return 1.0 + c * ch + ratio * k * (c * sh - s * ch)

    root = brentq(characteristic, 0.5, 1.8)
    period = 2.0 * math.pi / (root**2 * math.sqrt(EI / (MU * LENGTH**4)))
    beam = cable((PointMass(u=LENGTH, mass=m),), bending_stiffness=EI)
    # it is let go straight, and swings about how it would hang; a small gravity for small bends
    scene = Scene(
        cable=beam,
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="clamp", path=Still()),),
        environment=Environment(gravity=(0.0, 0.0, -0.5)),
        horizon=3.0 * period,
        quality=Quality(target_error=2e-4),
    )
    t = np.linspace(0.0, 3.0 * period, 3001)
    z = converged(scene).surface.positions([LENGTH], t)[:, 0, 2]
    middle = z - z.mean()
    crossings = t[:-1][(middle[:-1] < 0) != (middle[1:] < 0)]
    assert 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1) == pytest.approx(period, rel=0.01)


def test_what_hangs_is_carried_by_the_gripper_and_pulls_in_the_cable() -> None:
    masses = (PointMass(u=0.4, mass=0.02), PointMass(u=LENGTH, mass=0.03))
    hangs = Scene(
        cable=cable(masses),
        shape=Straight(direction=(0.0, 0.0, -1.0), settle=True),
        grasps=(Grasp(u=0.0, path=Still()),),
        horizon=0.5,
    )
    found = converged(hangs)
    whole = (MU * LENGTH + 0.05) * G
    np.testing.assert_allclose(found.grasps[0].reaction[:, 2], whole, rtol=1e-6)
    tension = hangs.cable.axial_stiffness * found.stretch.along(np.array([0.2, 0.7]), np.array([0.25]))[0]
    expected = [whole - MU * 0.2 * G, (MU * 0.3 + 0.03) * G]
    np.testing.assert_allclose(tension, expected, rtol=0.01)


def test_a_mass_in_the_gripper_weighs_on_the_gripper_alone() -> None:
    still = Scene(
        cable=cable(()),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.3, 0.0, 0.2), duration=0.8)),),
        quality=Quality(n_u=13, n_t=25, method="march"),
    )
    without, heavy = converged(still), converged(replace(still, cable=cable((PointMass(u=0.0, mass=0.5),))))
    assert apart(without, heavy) < 1e-7
    t = without.grasps[0].times[2:-2]
    np.testing.assert_array_equal(heavy.grasps[0].times[2:-2], t)
    acceleration = without.surface([0.0], t, dt=2)[:, 0, :3]
    more = (heavy.grasps[0].reaction - without.grasps[0].reaction)[2:-2]
    expected = 0.5 * (acceleration + np.array([0.0, 0.0, G]))
    assert np.abs(more - expected).max() < 0.02 * np.abs(expected).max()  # the spline's acceleration is a linear one


@pytest.mark.parametrize("twist", ["auto", "on"])  # smooth motions without are a call of their own
def test_a_gripper_that_sets_out_at_once_feels_the_mass_from_the_first(twist) -> None:
    sets_out = Scene(
        cable=cable(()),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.3, 0.1, 0.2), duration=0.8, profile="cubic")),),
        effects={"twist": twist},
        quality=Quality(n_u=13, n_t=25, method="march"),
    )
    without = converged(sets_out)
    heavy = converged(replace(sets_out, cable=cable((PointMass(u=0.0, mass=0.5),))))
    more = heavy.grasps[0].reaction[0] - without.grasps[0].reaction[0]
    first = 6.0 * np.array([0.3, 0.1, 0.2]) / 0.8**2  # of 3 s^2 - 2 s^3
    np.testing.assert_allclose(more, 0.5 * (first + np.array([0.0, 0.0, G])), rtol=0.01)


def test_what_falls_falls_together() -> None:
    masses = (PointMass(u=0.2, mass=0.1), PointMass(u=0.9, mass=0.03))
    falls = Scene(cable=cable(masses), shape=Straight(), horizon=0.4)
    found = converged(falls)
    t = np.linspace(0.0, 0.4, 9)
    fallen = found.surface.positions(np.linspace(0.0, LENGTH, 11), t)[..., 2]
    np.testing.assert_allclose(fallen, np.broadcast_to(-0.5 * G * t[:, None] ** 2, fallen.shape), atol=1e-6)


def test_no_energy_comes_from_nothing() -> None:
    swings = Scene(
        cable=cable((PointMass(u=0.5, mass=0.02), *CONNECTOR), bending_stiffness=1e-2),
        shape=Straight(),
        grasps=(Grasp(u=0.0, path=Still()),),
        horizon=1.0,
        quality=Quality(target_error=1e-3),
    )
    found = converged(swings)
    t = np.linspace(0.0, 1.0, 41)
    parts = found.energies(t)
    total = sum(parts.values())
    most = parts["kinetic"].max()
    assert most > 0.3  # [J]: of 0.6 that all of it may fall to
    assert total.max() < 0.01 * most
    assert total.min() > -0.05 * most  # what waves of stretch and steps take


def hanging() -> Scene:
    return Scene(
        cable=cable((PointMass(u=0.6, mass=0.02), *CONNECTOR)),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, hold="clamp", path=Move(displacement=(0.3, 0.1, 0.0), duration=0.7)),),
        environment=Environment(drag=0.05),
        horizon=1.2,
    )


def lying() -> Scene:
    return Scene(
        cable=cable((PointMass(u=0.5, mass=0.05), *CONNECTOR)),
        shape=Straight(),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.1, 0.3, 0.0), duration=1.0)),),
        environment=Environment(table=Table(friction=0.4)),
    )


def carried() -> Scene:
    u = np.linspace(0.0, 1.0, 21)[:, None]
    arch = np.hstack([0.6 * u, 0.0 * u, -0.6 * np.sin(np.pi * u) * 0.6])
    return Scene(
        cable=cable((PointMass(u=0.5, mass=0.04),)),
        shape=Points(points=arch, settle=True),
        grasps=(
            Grasp(u=0.0, path=Still()),
            Grasp(u=LENGTH, path=Move(displacement=(-0.1, 0.2, 0.1), duration=0.8)),
        ),
        environment=Environment(drag=0.05),
        horizon=1.0,
    )


def over_a_peg() -> Scene:
    peg = Cylinder(center=(0.45, 0.0, -0.2), axis=(0.0, 1.0, 0.0), radius=0.05, height=0.4)
    return Scene(
        cable=cable(CONNECTOR, bending_stiffness=3e-3, bending_damping=1e-4),
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="clamp", path=Still()),),
        environment=Environment(drag=0.1, obstacles=(peg,)),
        horizon=0.6,
    )


SCENES = {f.__name__: f for f in (hanging, lying, carried, over_a_peg)}


@pytest.mark.parametrize("make", SCENES.values(), ids=SCENES)
def test_motions_are_those_of_the_reference(make) -> None:
    scene = replace(make(), quality=Quality(target_error=3e-3))
    found = converged(scene)
    reference = converged(replace(scene, quality=Quality(method="reference", target_error=3e-3)))
    assert apart(found, reference) < found.accuracy.error_estimate + reference.accuracy.error_estimate
    bare = predict(replace(scene, cable=replace(scene.cable, point_masses=())))
    assert apart(found, bare) > 3.0 * apart(found, reference)  # else the masses would not show


def test_the_least_squares_goes_as_the_march() -> None:
    scene = replace(lying(), environment=Environment(drag=0.1, table=Table()))
    grid = Quality(n_u=13, n_t=33, method="march", keep_grid=True)
    march, other = (
        converged(replace(scene, quality=replace(grid, method=method))) for method in ("march", "spacetime")
    )
    assert other.accuracy.method == "spacetime"
    assert apart(march, other) < 5e-3


@pytest.mark.parametrize(
    "image",
    [turned(1.1, np.array([3.0, -2.0, 0.5])), mirrored(), reversed_cable(), other_units(4.0, 2.0, 7.0)],
    ids=["turned", "mirror", "reversed", "units"],
)
def test_a_motion_is_the_same_seen_differently(image) -> None:
    scene = replace(hanging(), quality=Quality(n_u=13, n_t=25, method="march", estimate=False))
    here, there = predict(scene), predict(seen(scene, image))
    u, t = np.linspace(0.0, LENGTH, 41), np.linspace(0.0, here.surface.horizon, 17)
    assert np.abs(image.back(there.surface, u, t, LENGTH) - here.surface.positions(u, t)).max() < 1e-6


def test_a_mass_lies_as_deep_in_the_table_as_the_cable_and_weighs_on_it() -> None:
    dropped = Scene(
        cable=cable((PointMass(u=0.7, mass=0.02), *CONNECTOR), bending_stiffness=3e-3),
        shape=Straight(start=(0.0, 0.0, 0.05)),
        grasps=(Grasp(u=0.0, path=Still()),),
        environment=Environment(drag=1.0, table=Table()),
        horizon=1.5,
    )
    found = converged(dropped)
    z = found.surface.positions(np.linspace(0.6, LENGTH, 41), [1.5])[0, :, 2]  # beyond, it hangs from the gripper
    assert np.abs(z).max() < 0.02 * 0.005 / 5.0
    (table,) = found.contacts
    carried = table.force[-1, 2] + found.grasps[0].reaction[-1, 2]
    assert carried == pytest.approx(dropped.weight, rel=0.01)


def test_friction_holds_what_a_heavy_end_weighs() -> None:
    # drawn along itself the cable needs mu times all its weight
    drawn = Scene(
        cable=cable((PointMass(u=LENGTH, mass=0.2),)),
        shape=Straight(),
        grasps=(Grasp(u=0.0, path=Move(displacement=(-0.3, 0.0, 0.0), duration=6.0, profile="linear")),),
        environment=Environment(table=Table(friction=0.4)),
    )
    found = converged(drawn)
    late = found.grasps[0].times > 3.0
    expected = 0.4 * drawn.weight
    assert -found.grasps[0].reaction[late, 0].mean() == pytest.approx(expected, rel=0.02)


def test_the_derivative_by_a_mass_is_that_of_differences() -> None:
    scene = replace(hanging(), quality=Quality(n_u=17, n_t=49, method="march"))
    found = predict(scene)
    derivative = sensitivities(found, wrt=["cable.point_masses[1].mass"])
    u, t = np.array([0.5, 1.0]), np.array([0.6, 1.2])
    step = 3e-4

    def moved(by: float) -> np.ndarray:
        masses = (scene.cable.point_masses[0], replace(CONNECTOR[0], mass=0.03 + by))
        return predict(replace(scene, cable=replace(scene.cable, point_masses=masses))).surface.positions(u, t)

    differences = (moved(step) - moved(-step)) / (2.0 * step)
    own = derivative(u, t)[0]
    np.testing.assert_allclose(own, differences, atol=0.02 * np.abs(differences).max())


@pytest.mark.parametrize(
    ("masses", "field"),
    [
        ([{"u": 1.5, "mass": 0.1}], r"point_masses\[0\]\.u"),
        ([{"u": -0.1, "mass": 0.1}], "u"),
        ([{"u": 0.5, "mass": -0.1}], "mass"),
        ([{"u": 0.5, "mass": float("nan")}], "mass"),
        ([{"u": 0.5, "mass": 0.1}] * 33, "point_masses"),
    ],
)
def test_masses_that_can_not_be_are_refused(masses, field) -> None:
    with pytest.raises(SceneError, match=f"^{field}: got"):
        cable(tuple(PointMass(**one) for one in masses))
    with pytest.raises(SceneError, match=r"^point_masses\[0\]: got"):
        Cable.preset("paper", point_masses=[0.1])


def test_a_mass_of_nothing_changes_nothing_but_a_knot() -> None:
    scene = replace(hanging(), quality=Quality(target_error=1e-3))
    none = converged(replace(scene, cable=cable(())))
    light = converged(replace(scene, cable=cable((PointMass(u=0.37, mass=0.0),))))
    assert apart(none, light) < none.accuracy.error_estimate + light.accuracy.error_estimate


def test_masses_in_one_place_are_one() -> None:
    scene = replace(hanging(), quality=Quality(n_u=13, n_t=25, method="march", estimate=False))
    two = predict(replace(scene, cable=cable((PointMass(u=1.0, mass=0.01), PointMass(u=1.0, mass=0.02)))))
    one = predict(replace(scene, cable=cable((PointMass(u=1.0, mass=0.03),))))
    assert apart(one, two) < 1e-9


def test_a_motion_that_is_slow_for_a_cable_is_not_for_one_with_a_heavy_end() -> None:
    def inertia(masses: tuple[PointMass, ...]) -> bool:
        slow = Scene(
            cable=cable(masses, bending_stiffness=1e-2),
            shape=Straight(),
            grasps=(Grasp(u=0.0, hold="clamp", path=Move(displacement=(0.0, 0.1, 0.0), duration=150.0)),),
            environment=Environment(drag=0.05, table=Table()),
        )
        return next(effect.active for effect in plan(slow).effects if effect.name == "inertia")

    assert not inertia(())
    assert inertia((PointMass(u=LENGTH, mass=0.5),))


def test_a_table_bears_what_lies_on_it() -> None:
    scene = replace(lying(), quality=Quality(n_u=13, n_t=25, method="march", estimate=False))
    (table,) = predict(scene).contacts
    np.testing.assert_allclose(table.force[:, 2], scene.weight, rtol=1e-12)
    assert scene.weight == pytest.approx((MU * LENGTH + 0.08) * G)
