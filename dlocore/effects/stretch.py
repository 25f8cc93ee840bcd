"""Stretch: energy density EA/2 e^2 [J/m] of the axial strain e = |r'| - 1 (paper eq. 8, first row), and what damps it.

Waves of stretch are a thousand times as fast as those of bending. Undamped they ring on after every jump, and carry the
cable with them in a way that only steps as short as theirs could follow. The tension eta_e e_t on the rate of the axial
strain lets them die out (docs/model.md eq. 7a).
"""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site


@dataclass(frozen=True)
class Stretch(Effect):
    """Axial stiffness EA [N]."""

    name: ClassVar[str] = "stretch"
    site: ClassVar[Site] = "axial"
    axial_stiffness: float

    def parameters(self) -> tuple[float, ...]:
        """Return (EA,)."""
        return (self.axial_stiffness,)


@dataclass(frozen=True)
class StretchDamping(Effect):
    """Axial damping eta_e [N s] on the rate of the axial strain."""

    name: ClassVar[str] = "stretch"
    site: ClassVar[Site] = "axial"
    axial_damping: float

    def parameters(self) -> tuple[float, ...]:
        """Return (eta_e,)."""
        return (self.axial_damping,)


@law
def tension(EA: float, strain: float) -> tuple[float, float]:
    """Return N = EA e and dN/de = EA."""
    return EA * strain, EA
