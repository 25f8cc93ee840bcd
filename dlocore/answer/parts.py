"""The parts of an answer, and the records that a solve reports while it runs."""

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
    """Return the status of an answer in words, and the notes on it, as one message."""
    return " ".join([said, *[f"Note: {note}." for note in notes]])


@dataclass(frozen=True)
class EffectReport:
    """Whether an effect was simulated, why, and how large it was.

    Attributes:
        name: as in the scene's `effects`.
        active: whether it was simulated.
        reason: why, in words.
        magnitude: its size on the predicted motion, in `unit`; None if it has none.
        unit: of the magnitude, e.g. "N".
    """

    name: str
    active: bool
    reason: str
    magnitude: float | None = None
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Iteration:
    """One iteration of a solve: an iteration of `spacetime` or `paper`, or one refinement level of `march`.

    Attributes:
        number: from 0.
        update: norm of the change of the control points, the paper's eq. (25) [m]. For a refinement level, the largest
            change of the surface [m], infinite at the first.
        residual: root of the weighted mean square of the equations' residual over the whole motion, as a displacement
            [m] (docs/model.md eq. 16). For `paper`, a force [N]. For a level of `march`, the largest error that
            Newton's iterations left [m].
        wall_time: since the solve began [s].
        damping: relative amount by which the diagonal of the normal equations of a `spacetime` step was raised, if they
            were no longer positive definite because of rounding; otherwise 0.
        step_length: fraction of the full step that was taken.
        n_u: control points along the cable at this iteration.
        n_t: control points in time.
        find_surface: computes the iterate itself; read `surface`, which stores it.
        find_energy: computes the elastic energy at the end of the motion [J]; read `energy`, which stores it.
        note: the kind of iteration: `spacetime`, `paper`, `march` with remarks on its result, or `rod of` so many
            elements.
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
    """Force and moment that a gripper exerts on the cable, in world axes; the moment is about the grasped point.

    Attributes:
        u: material coordinate of the grasp [m].
        times: (k,) [s], the same for all grasps of a prediction. A time at which forces may jump, because a grasp
            closes or opens, occurs twice, as in `dlocore.Load`.
        reaction: (k, 3) [N]; zero while the gripper is open. Impulses are not included: the cable gets one if the
            velocity of a gripper jumps, or if a gripper closes on a moving cable.
        moment: (k, 3) [N m]; zero for a grasp that holds only the position.
        reaction_error: estimated discretisation error of the force (k,) [N], from its distance to the force on another
            grid (docs/accuracy.md, forces); None if it was not estimated.
        moment_error: the same for the moment (k,) [N m].
    """

    u: float
    times: Floats
    reaction: Floats
    moment: Floats
    reaction_error: Floats | None = None
    moment_error: Floats | None = None


@dataclass(frozen=True, eq=False)
class ContactForce(Answered):
    """Normal force and friction force of the table or an obstacle on the cable.

    The forces are sampled at about 129 times. A strike is shorter than the time between two of them: it may not show,
    and the integral of the forces over time is not its impulse.

    Attributes:
        name: "table", or "obstacles[i]" with the number of the obstacle in the scene.
        times: (k,) [s].
        force: total normal force on the cable (k, 3) [N], without friction.
        friction: total friction force on the cable (k, 3) [N].
        pressed: sum of the magnitudes of the normal forces along the cable (k,) [N]. It exceeds the magnitude of
            `force` if the cable is pressed from several sides, for example by a peg that it is laid around.
        force_error: estimated error of the force (k,) [N], as `GraspReaction.reaction_error`; None if it was not
            estimated.
        friction_error: the same for the friction (k,) [N].
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
        director: unit vectors (m, 3) across the cable at u = 0, fixed in its section where theta is zero.
        u: material coordinates (k,) [m], rising.
        memory: stress-free strain (m, k, 3): two curvatures in the sections' frame and the twist rate
            [1/m, 1/m, rad/m].
        stretch: stress-free axial strain (m, k), without unit.
        natural: `memory` before anything yielded (k, 3), towards which hardening pulls back [1/m, 1/m, rad/m].
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
            SceneError: `t` is outside the predicted time.
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
    """Axial strain of the cable over time, accurate enough for a tension; the strain of its spline is not.

    Attributes:
        times: (m,) [s].
        u: (k,) [m]: includes both ends, and both sides of each grasp, load and point mass.
        strain: axial strain (m, k) that balances the forces on the cable (docs/model.md, selective reduced
            integration). In an elastic cable without axial damping, EA times it is the tension [N]. At a point where a
            force acts it is the mean of both sides.
    """

    times: Floats
    u: Floats
    strain: Floats

    def at(self, t: float) -> Floats:
        """Return the axial strain (k,) at time `t` [s], linear between the stored times.

        Raises:
            SceneError: `t` is outside the predicted time.
        """
        k, s = _bracket(self.times, t)
        return np.asarray((1 - s) * self.strain[k] + s * self.strain[k + 1])

    def along(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return the axial strain (k_t, k_u) at coordinates `u` (k_u,) [m] and times `t` (k_t,) [s], interpolated.

        Raises:
            SceneError: a coordinate is off the cable, or a time outside the predicted time.
        """
        u, t = in_range("u", u, float(self.u[-1]), "m"), in_range("t", t, float(self.times[-1]), "s")
        return np.array([np.interp(u, self.u, self.at(s)) for s in t]).reshape(len(t), len(u))


def _bracket(times: Floats, t: float) -> tuple[int, float]:
    """Return the index of the last of the times (m,) [s] before `t`, and the share of the way from it to the next.

    Raises:
        SceneError: `t` is outside them, or not a single time.
    """
    given = in_range("t", t, float(times[-1]), "s")
    if given.size != 1:
        raise SceneError("t", f"{given.size} times", "one")
    t = float(given[0])
    k = int(np.clip(np.searchsorted(times, t) - 1, 0, len(times) - 2))
    return k, float(np.clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """How accurate the answer is, and what it cost.

    Attributes:
        method: the method that gave the answer.
        error_estimate: estimated error of the position at the worst point of the surface [m]; None if it was not
            estimated.
        error_parts: the parts that add up to it [m]; empty if there is no estimate. They are
            "grid": discretisation, or "space" and "time" if these are known separately;
            "iteration": what the last iteration left;
            "neglected": effects that "auto" left out;
            "start": if the scene does not determine its motion, how far an almost equal start takes it elsewhere;
            "contact": for a motion that strikes something, how far contact twice as stiff would change it.
            An effect that the scene switches off has no part; a note in the message reports it if it matters.
        neglected: approximate error due to effects that "auto" left out [m], a part of the estimate.
        wall_time: time of the whole solve [s].
        n_u, n_t: size of the net of control points.
        delta: threshold on the update [m].
        steps: time steps of the march.
        dimensions: 2 if the motion is planar, otherwise 3.
        dimensions_reason: why, in words.
        phases: time by phase [s]: "setup", "march", "fit", "spacetime", "paper", "estimate". For a smooth motion
            without twist "march" includes the fit, since one compiled call does both. Method "reference" has
            "simulation" and "fit".
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
