"""Stretch: energy density EA/2 e^2 [J/m] of the axial strain e = |r'| - 1 (paper eq. 8, first row)."""

from dataclasses import dataclass
from typing import ClassVar

from dlocore.effects.base import Effect, Site
from dlocore.kernels.compile import law


@dataclass(frozen=True)
class Stretch(Effect):
    """Axial stiffness EA [N]."""

    name: ClassVar[str] = "stretch"
    site: ClassVar[Site] = "axial"
    axial_stiffness: float

    def parameters(self) -> tuple[float, ...]:
        """Return (EA,)."""
        return (self.axial_stiffness,)


@law
def tension(EA: float, strain: float) -> tuple[float, float]:
    """Return N = EA e and dN/de = EA."""
    return EA * strain, EA
