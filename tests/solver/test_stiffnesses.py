"""The stiffnesses of a cable, of which EI alone has to be given: those of a solid round section fill in."""

import math
from dataclasses import replace

import pytest

from dlocore import Cable, SceneError
from tests.solver.scenes import cable

D, E, G = 0.006, 2.0e7, 7.0e6  # [m], [Pa], [Pa]


def of_moduli(**given: float) -> Cable:
    return Cable(length=1.0, diameter=D, linear_density=0.05, **given)


def test_moduli_give_the_stiffnesses_of_a_solid_round_section() -> None:
    found = of_moduli(youngs_modulus=E, shear_modulus=G)
    assert found.bending_stiffness == pytest.approx(E * math.pi * D**4 / 64.0)
    assert found.axial_stiffness == pytest.approx(E * math.pi * D**2 / 4.0)
    assert found.torsional_stiffness == pytest.approx(G * math.pi * D**4 / 32.0)


def test_a_modulus_gives_what_is_not_given_beside_it() -> None:
    bent = of_moduli(youngs_modulus=E, bending_stiffness=1e-3, torsional_stiffness=2e-3)
    assert (bent.bending_stiffness, bent.torsional_stiffness) == (1e-3, 2e-3)
    assert bent.axial_stiffness == pytest.approx(E * math.pi * D**2 / 4.0)
    pulled = of_moduli(youngs_modulus=E, axial_stiffness=500.0)
    assert pulled.axial_stiffness == 500.0
    assert pulled.bending_stiffness == pytest.approx(E * math.pi * D**4 / 64.0)


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"youngs_modulus": E, "bending_stiffness": 1e-3, "axial_stiffness": 500.0}, "youngs_modulus"),
        ({"youngs_modulus": E, "shear_modulus": G, "torsional_stiffness": 2e-3}, "shear_modulus"),
    ],
)
def test_a_modulus_that_would_change_nothing_is_refused(given: dict[str, float], field: str) -> None:
    with pytest.raises(SceneError, match="Both are given") as error:
        of_moduli(**given)
    assert error.value.field == field


def test_moduli_are_converted_so_a_part_of_the_cable_can_be_replaced() -> None:
    found = of_moduli(youngs_modulus=E, shear_modulus=G)
    longer = replace(found, length=2.0)
    assert (longer.bending_stiffness, longer.torsional_stiffness) == (
        found.bending_stiffness,
        found.torsional_stiffness,
    )
    with pytest.raises(SceneError, match="youngs_modulus"):
        replace(found, youngs_modulus=2.0 * E)
    stiffer = replace(found, youngs_modulus=2.0 * E, bending_stiffness=None, axial_stiffness=None)
    assert stiffer.bending_stiffness == pytest.approx(2.0 * found.bending_stiffness)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("bending_stiffness", "N m^2"),
        ("axial_stiffness", "N"),
        ("torsional_stiffness", "N m^2"),
        ("youngs_modulus", "Pa"),
        ("shear_modulus", "Pa"),
    ],
)
def test_one_that_is_out_of_range_is_refused_with_its_unit(name: str, unit: str) -> None:
    with pytest.raises(SceneError) as error:
        of_moduli(**{name: 0.0})
    assert error.value.field == name
    assert error.value.allowed.endswith(f" [{unit}]")


def test_a_modulus_replaces_the_stiffnesses_of_a_preset() -> None:
    preset, bare = Cable.preset("paper"), of_moduli(youngs_modulus=E, shear_modulus=G)
    found = Cable.preset("paper", youngs_modulus=E, diameter=D)
    assert (found.bending_stiffness, found.axial_stiffness) == (bare.bending_stiffness, bare.axial_stiffness)
    assert found.torsional_stiffness == preset.torsional_stiffness
    found = Cable.preset("paper", shear_modulus=G, diameter=D)
    assert found.torsional_stiffness == bare.torsional_stiffness
    assert (found.bending_stiffness, found.axial_stiffness) == (preset.bending_stiffness, preset.axial_stiffness)
    found = Cable.preset("paper", youngs_modulus=E, bending_stiffness=1e-3, diameter=D)
    assert (found.bending_stiffness, found.axial_stiffness) == (1e-3, bare.axial_stiffness)


def test_without_moduli_the_others_follow_from_that_of_bending() -> None:
    found = cable(bending_stiffness=1e-3, diameter=0.005)
    assert found.torsional_stiffness == found.bending_stiffness == 1e-3
    assert found.axial_stiffness == found.solid_axial_stiffness == pytest.approx(16.0 * 1e-3 / 0.005**2)
