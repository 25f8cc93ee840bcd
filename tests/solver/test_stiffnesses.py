"""The stiffnesses of a cable, of which EI alone has to be given: those of a solid round section fill in."""

import math

import pytest

from dlocore import Cable
from tests.solver.scenes import cable

D, E, G = 0.006, 2.0e7, 7.0e6  # [m], [Pa], [Pa]


def of_moduli(**given: float) -> Cable:
    return Cable(length=1.0, diameter=D, linear_density=0.05, **given)


def test_moduli_give_the_stiffnesses_of_a_solid_round_section() -> None:
    found = of_moduli(youngs_modulus=E, shear_modulus=G)
    assert found.bending_stiffness == pytest.approx(E * math.pi * D**4 / 64.0)
    assert found.axial_stiffness == pytest.approx(E * math.pi * D**2 / 4.0)
    assert found.torsional_stiffness == pytest.approx(G * math.pi * D**4 / 32.0)


def test_stiffnesses_that_are_given_are_kept_beside_moduli() -> None:
    given = {"bending_stiffness": 1e-3, "axial_stiffness": 500.0, "torsional_stiffness": 2e-3}
    found = of_moduli(youngs_modulus=E, shear_modulus=G, **given)
    assert {name: getattr(found, name) for name in given} == given


def test_without_moduli_the_others_follow_from_that_of_bending() -> None:
    found = cable(bending_stiffness=1e-3, diameter=0.005)
    assert found.torsional_stiffness == found.bending_stiffness == 1e-3
    assert found.axial_stiffness == found.solid_axial_stiffness == pytest.approx(16.0 * 1e-3 / 0.005**2)
