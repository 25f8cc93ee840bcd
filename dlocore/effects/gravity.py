"""Weight: force per unit length mu g [N/m], part of the applied forces F of docs/model.md eq. 10.

mu is the linear density [kg/m], to which point masses add (docs/model.md eq. 9a), and g the acceleration of gravity
[m/s^2].
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.base import Effect, Site


@dataclass(frozen=True)
class Gravity(Effect):
    """Linear density mu [kg/m] and acceleration g (3,) [m/s^2]."""

    name: ClassVar[str] = "gravity"
    site: ClassVar[Site] = "field"
    linear_density: float
    gravity: NDArray[np.float64]

    def weight(self) -> NDArray[np.float64]:
        """Return the weight per unit length mu g (3,) [N/m]."""
        return self.linear_density * self.gravity
