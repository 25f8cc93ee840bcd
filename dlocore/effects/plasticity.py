"""Plasticity: the paper's strain memory (paper eq. 9) with a little kinematic hardening (docs/model.md eq. 20).

eps is the strain (axial strain [-], curvature [1/m] or twist rate [rad/m]), z the strain about which the section is
elastic, eps_0 the memory (stress-free strain) and eps_n its natural value:

    z_t = k (1 + H) (|eps - z| - eps_M) (eps - z)/|eps - z|   where |eps - z| > eps_M, else 0,
    eps_0 = eps_n + (z - eps_n)/(1 + H).

eps_M is the threshold, in the unit of eps; k is the rate [1/s] and H the hardening [-]. H = 0 is the paper's law.

Over a time step the strain is taken as linear in time and the law is integrated exactly, including the instants at
which yielding begins and ends. A curvature vector returns along its final direction.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dlocore.compiling.kernel import law
from dlocore.effects.base import Effect, Site, Symmetric, Vector


@dataclass(frozen=True)
class Plasticity(Effect):
    """Threshold, rate k [1/s] and hardening H of the strain at one site.

    The threshold is eps_M of this file, in the unit of the strain.
    """

    name: ClassVar[str] = "plasticity"
    site: ClassVar[Site]
    threshold: float
    memory_rate: float
    hardening: float

    def parameters(self) -> tuple[float, ...]:
        """Return (threshold, k (1 + H), 1/(1 + H))."""
        return (self.threshold, self.memory_rate * (1.0 + self.hardening), 1.0 / (1.0 + self.hardening))


@dataclass(frozen=True)
class BendingMemory(Plasticity):
    """Memory of the curvature; the threshold is 2 eps_M/D [1/m], with the yield strain eps_M of the outermost fibre."""

    site: ClassVar[Site] = "curvature"


@dataclass(frozen=True)
class TwistMemory(Plasticity):
    """Memory of the twist rate; the threshold is 2 eps_M/D [rad/m]."""

    site: ClassVar[Site] = "twist"


@dataclass(frozen=True)
class StretchMemory(Plasticity):
    """Memory of the axial strain; the threshold is eps_M."""

    site: ClassVar[Site] = "axial"


@law
def elastic_part(begin: float, end: float, h: float, threshold: float, k: float) -> tuple[float, float]:
    """Return x(h), the elastic strain after a step h, and its derivative with respect to `end`.

    `end` is what x would be if nothing yielded. From x(0) = begin,

        x_t = (end - begin)/h - k (|x| - threshold) sign x

    where |x| exceeds the threshold, and x_t = (end - begin)/h elsewhere. There are at most three phases: yielding,
    elastic, yielding the other way. The derivative y = dx/d(rate) obeys y_t = 1 - k y while yielding and y_t = 1
    otherwise, and is continuous between phases.
    """
    x, y, left = begin, 0.0, h
    rate = (end - begin) / h
    for _ in range(3):
        side = 1.0 if x > threshold else -1.0 if x < -threshold else 0.0
        if side == 0.0 and abs(x) == threshold and x * rate > 0.0:
            side = 1.0 if x > 0.0 else -1.0
        if side == 0.0:
            free = abs(x + rate * left) <= threshold
            goal = threshold if rate > 0.0 else -threshold
            used = left if free else (goal - x) / rate
            x = x + rate * used if free else goal
            y += used
        else:
            over = x - side * threshold
            final = over * np.exp(-k * left) - rate / k * np.expm1(-k * left)
            yields = final * side >= 0.0
            # otherwise yielding ends when over exp(-k s) + rate/k (1 - exp(-k s)) = 0
            used = left if yields else np.log(1.0 - over * k / rate) / k
            decay = np.exp(-k * used)
            x = side * threshold + (final if yields else 0.0)
            y = y * decay + (1.0 - decay) / k
        left -= used
        if left <= 0.0:
            break
    return x, y / h


@law
def yielded(kappa: Vector, last: Vector, z: Vector, h: float, threshold: float, k: float) -> tuple[Vector, Symmetric]:
    """Return the elastic part e of the strain kappa after a step h from `last`, and de/dkappa (positive definite)."""
    e = (kappa[0] - z[0], kappa[1] - z[1], kappa[2] - z[2])
    size = np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    b = (last[0] - z[0], last[1] - z[1], last[2] - z[2])
    before = np.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    if max(size, before) <= threshold or size == 0.0:
        return e, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    n = (e[0] / size, e[1] / size, e[2] / size)
    x, along = elastic_part(b[0] * n[0] + b[1] * n[1] + b[2] * n[2], size, h, threshold, k)
    across = abs(x) / size
    change = along - across
    return (x * n[0], x * n[1], x * n[2]), (
        across + change * n[0] * n[0],
        across + change * n[1] * n[1],
        across + change * n[2] * n[2],
        change * n[0] * n[1],
        change * n[0] * n[2],
        change * n[1] * n[2],
    )
