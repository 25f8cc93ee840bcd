"""Stretch: energy density EA/2 e^2 [J/m] of the axial strain e, and its damping (docs/model.md eq. 3, 7 and 7a).

e = |r'| - 1 (paper eq. 8, first row, has the energy). The tension is N = EA (e - e_0) + eta_e e_t [N], where the
stress-free strain e_0 is zero unless the cable has yielded.

The default of eta_e [N s] is docs/model.md eq. 7a. Waves of stretch are a thousand times as fast as those of bending.
Without damping they would continue to ring after every jump and carry the cable along, in a way that only time steps as
short as their period could follow.
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
    """Axial damping eta_e [N s], on the rate of the axial strain."""

    name: ClassVar[str] = "stretch"
    site: ClassVar[Site] = "axial"
    axial_damping: float

    def parameters(self) -> tuple[float, ...]:
        """Return (eta_e,)."""
        return (self.axial_damping,)


@law
def tension(EA: float, strain: float) -> tuple[float, float]:
    """Return N = EA e and dN/de = EA, where `strain` is the elastic strain."""
    return EA * strain, EA
