"""The parts of an answer, and of what a solve reports while it runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.compiling.interrupts import interruptible
from dlocore.errors import SceneError
from dlocore.pickling import Answered, state_with
from dlocore.scene.scene import Material
from dlocore.spline import SplineSurface, in_range

Floats = NDArray[np.float64]
Status = Literal["converged", "max_iterations", "stalled", "time_limit"]


def with_notes(said: str, notes: Sequence[str]) -> str:
    """Return what was said of an answer and the notes on it, each in words, as one message."""
    return " ".join([said, *[f"Note: {note}." for note in notes]])


@dataclass(frozen=True)
class EffectReport:
    """Whether an effect was simulated, why, and how large it was.

    Attributes:
        name: as in the scene's `effects`.
        active: whether it was simulated.
        reason: why, in words.
        magnitude: its size on the predicted motion, in `unit`; None where that means nothing.
        unit: of the magnitude, e.g. "N".
    """

    name: str
    active: bool
    reason: str
    magnitude: float | None = None
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Iteration:
    """One iteration of a solve: of `spacetime` or `paper`, or one refinement level of `march`.

    Attributes:
        number: from 0.
        update: norm of the change of the control points, the paper's eq. (25) [m]; for a refinement level the largest
            change of the surface [m], infinite at the first.
        residual: root of the weighted mean square of the equations' residual over the whole motion, as a displacement
            [m] (docs/model.md eq. 16); for `paper` a force [N]; for a level of `march` the largest error left
            by Newton's iterations [m].
        wall_time: since the solve began [s].
        damping: share by which the diagonal of a `spacetime` step's normal equations was raised, where they had lost
            their positive factors to rounding; else 0.
        step_length: fraction of the full step that was taken.
        n_u: control points along the cable at this iteration.
        n_t: control points in time.
        find_surface: finds the iterate itself, which `surface` keeps.
        find_energy: finds the elastic energy at the end of the motion [J], which `energy` keeps.
        note: what it was: `spacetime`, `paper`, `march` with what was found on it, or `rod of` so many elements.
    """

    number: int
    update: float
    residual: float
    wall_time: float
    damping: float
    step_length: float
    n_u: int
    n_t: int
    find_surface: Callable[[], SplineSurface] = field(repr=False)
    find_energy: Callable[[], float] = field(repr=False)
    note: str = ""

    @cached_property
    @interruptible
    def surface(self) -> SplineSurface:
        """The iterate itself."""
        return self.find_surface()

    @cached_property
    @interruptible
    def energy(self) -> float:
        """Elastic energy at the end of the motion [J]."""
        return self.find_energy()

    def __getstate__(self) -> dict[str, Any]:
        return state_with(self, surface="find_surface", energy="find_energy")


OnIteration = Callable[[Iteration], None]


@dataclass(frozen=True, eq=False)
class GraspReaction(Answered):
    """Force and moment that a gripper gives to the cable, in world axes, the moment about the grasped point.

    Attributes:
        u: material coordinate of the grasp [m].
        times: (k,) [s], those of the prediction's reactions; twice where these may jump, as a grasp closes or opens, as
            `dlocore.Load` takes them.
        reaction: (k, 3) [N]; zero while the gripper is open. The impulse that the cable gets where the velocity of a
            gripper jumps, or it closes on a moving cable, is no part of it.
        moment: (k, 3) [N m]; zero for a grasp that holds only the position.
        reaction_error: estimated error of the force at those times (k,) [N], of the discretisation, from its distance
            to the force on another grid (docs/accuracy.md, forces); None where none was computed.
        moment_error: the same of the moment (k,) [N m].
    """

    u: float
    times: Floats
    reaction: Floats
    moment: Floats
    reaction_error: Floats | None = None
    moment_error: Floats | None = None


@dataclass(frozen=True, eq=False)
class ContactForce(Answered):
    """How hard the table or an obstacle presses on the cable, and how its friction holds it.

    Attributes:
        name: "table", or "obstacles[i]" with the number of the obstacle in the scene.
        times: (k,) [s].
        force: that it gives to the cable across its surface (k, 3) [N], without friction.
        friction: force that it gives to the cable along its surface (k, 3) [N].
        pressed: sum of the sizes of what it gives along the cable (k,) [N]: more than the size of `force` where it
            presses from several sides, as a peg on a cable that is laid around it.
        force_error: estimated error of the force (k,) [N], as `GraspReaction.reaction_error`; None where none was
            computed.
        friction_error: that of the friction (k,) [N].
    """

    name: str
    times: Floats
    force: Floats
    friction: Floats
    pressed: Floats
    force_error: Floats | None = None
    friction_error: Floats | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialMotion(Answered):
    """What the sections of the cable remember, over time; see `dlocore.Material`.

    Attributes:
        times: (m,) [s].
        director: (m, 3), at u = 0.
        u: (k,) [m].
        memory: (m, k, 3) [1/m, 1/m, rad/m].
        stretch: (m, k).
        natural: (k, 3) [1/m, 1/m, rad/m].
    """

    times: Floats
    director: Floats
    u: Floats
    memory: Floats
    stretch: Floats
    natural: Floats

    def at(self, t: float) -> Material:
        """Return what the sections remember at time `t` [s], linear between the stored times.

        Raises:
            SceneError: a time outside the predicted time.
        """
        k, s = _bracket(self.times, t)
        director = (1 - s) * self.director[k] + s * self.director[k + 1]
        return Material(
            director=director / np.linalg.norm(director),
            u=self.u,
            memory=(1 - s) * self.memory[k] + s * self.memory[k + 1],
            stretch=(1 - s) * self.stretch[k] + s * self.stretch[k + 1],
            natural=self.natural,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class StretchMotion(Answered):
    """How far the cable is stretched, over time: what its spline does not tell to the accuracy of a tension.

    Attributes:
        times: (m,) [s].
        u: (k,) [m], with both ends, and both sides of where something holds, loads or weighs down the cable.
        strain: axial strain (m, k) that balances the forces on the cable (docs/model.md, selective reduced
            integration). In an elastic cable without axial damping EA times it is the tension [N]; where a force acts
            in a point, the mean of both sides.
    """

    times: Floats
    u: Floats
    strain: Floats

    def at(self, t: float) -> Floats:
        """Return the axial strain (k,) at time `t` [s], linear between the stored times.

        Raises:
            SceneError: a time outside the predicted time.
        """
        k, s = _bracket(self.times, t)
        return np.asarray((1 - s) * self.strain[k] + s * self.strain[k + 1])

    def along(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return the axial strain (k_t, k_u) at the places `u` (k_u,) [m] and times `t` (k_t,) [s], linear between.

        Raises:
            SceneError: a place is off the cable, or a time outside the predicted time.
        """
        u, t = in_range("u", u, float(self.u[-1]), "m"), in_range("t", t, float(self.times[-1]), "s")
        return np.array([np.interp(u, self.u, self.at(s)) for s in t]).reshape(len(t), len(u))


def _bracket(times: Floats, t: float) -> tuple[int, float]:
    """Return which of the times (m,) [s] is the last before `t`, and the share of the way from it to the next.

    Raises:
        SceneError: `t` is outside them, or no single time.
    """
    given = in_range("t", t, float(times[-1]), "s")
    if given.size != 1:
        raise SceneError("t", f"{given.size} times", "one")
    t = float(given[0])
    k = int(np.clip(np.searchsorted(times, t) - 1, 0, len(times) - 2))
    return k, float(np.clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """What the answer is worth and what it cost.

    Attributes:
        method: the method that gave the answer.
        error_estimate: estimated error of the position at the worst point of the surface [m]; None where nothing was
            computed that tells.
        error_parts: what it adds up from [m]: "grid", of the discretisation, or "space" and "time" where they are known
            apart; "iteration", what the last iteration left; "neglected", effects that "auto" left out; "start",
            where the scene does not determine its motion, how far a start that is hardly another ends elsewhere;
            "contact", how far contact twice as stiff takes a motion that strikes something. Empty where there is no
            estimate.
        neglected: the part of it that effects left out by "auto" may have, about [m].
        wall_time: time of the whole solve [s].
        n_u, n_t: size of the net of control points.
        delta: threshold on the update [m].
        steps: time steps of the march.
        dimensions: 2 where the motion is planar, else 3.
        dimensions_reason: why, in words.
        phases: time by phase [s]: "setup", "march", "fit", "spacetime", "paper", "estimate"; "march" has the fit of a
            smooth motion without twist, which is one compiled call with it. Of method "reference": "simulation", "fit".
    """

    method: str
    error_estimate: float | None
    neglected: float
    wall_time: float
    n_u: int
    n_t: int
    delta: float
    steps: int
    dimensions: int
    dimensions_reason: str
    phases: dict[str, float] = field(default_factory=dict)
    error_parts: dict[str, float] = field(default_factory=dict)
