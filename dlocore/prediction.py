"""What a solve returns, and what it reports while it runs."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import number
from dlocore.scene import MAX_STRAIN, ControlPoints, Material, Scene
from dlocore.spline import SplineSurface, greville

if TYPE_CHECKING:
    from dlocore.solvers.ladder import Level

Floats = NDArray[np.float64]
Status = Literal["converged", "max_iterations", "stalled", "time_limit"]


def with_notes(said: str, notes: list[str]) -> str:
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
        damping: Levenberg-Marquardt damping of the step, 0 for a plain one.
        step_length: fraction of the full step that was taken.
        n_u: control points along the cable at this iteration.
        n_t: control points in time.
        find_surface: finds the iterate itself, which `surface` keeps.
        find_energy: finds the elastic energy at the end of the motion [J], which `energy` keeps.
        note: what happened, in words, e.g. "Gauss-Newton tangent"; empty for a plain iteration.
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
    def surface(self) -> SplineSurface:
        """The iterate itself."""
        return self.find_surface()

    @cached_property
    def energy(self) -> float:
        """Elastic energy at the end of the motion [J]."""
        return self.find_energy()


OnIteration = Callable[[Iteration], None]


@dataclass(frozen=True, eq=False)
class GraspReaction:
    """Force and moment that a gripper gives to the cable.

    Attributes:
        u: material coordinate of the grasp [m].
        times: (k,) [s], those of the prediction's reactions.
        reaction: (k, 3) [N]; zero while the gripper is open.
        moment: (k, 3) [N m]; zero for a grasp that holds only the position.
    """

    u: float
    times: Floats
    reaction: Floats
    moment: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialMotion:
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
        """Return what the sections remember at time `t` [s], linear between the stored times."""
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
class StretchMotion:
    """How far the cable is stretched, over time: what its spline does not tell to the accuracy of a tension.

    Attributes:
        times: (m,) [s].
        u: (k,) [m].
        strain: axial strain (m, k).
    """

    times: Floats
    u: Floats
    strain: Floats

    def at(self, t: float) -> Floats:
        """Return the axial strain (k,) at time `t` [s], linear between the stored times."""
        k, s = _bracket(self.times, t)
        return np.asarray((1 - s) * self.strain[k] + s * self.strain[k + 1])


def _bracket(times: Floats, t: float) -> tuple[int, float]:
    """Return which of the times (m,) [s] is the last before `t`, and the share of the way from it to the next."""
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
            where the scene does not determine its motion, how far a start that is hardly another ends elsewhere. Empty
            where there is no estimate.
        neglected: the part of it that effects left out by "auto" may have, about [m].
        wall_time: time of the whole solve [s].
        n_u, n_t: size of the net of control points.
        delta: threshold on the update [m].
        steps: time steps of the march.
        dimensions: 2 where the motion is planar, else 3.
        dimensions_reason: why, in words.
        phases: time by phase [s]: "setup", "march", "fit", "spacetime", "estimate", "report"; "march" has the fit of a
            smooth motion without twist, which is one compiled call with it.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A predicted motion.

    Attributes:
        scene: what was asked.
        status: "converged", or why not; never a success word for a failure.
        said: the status in words, and what to do about it.
        surface: the bivariate spline q(u, t).
        grasps: reaction of each grasp, in the scene's order.
        effects: what was simulated and why.
        message: what is said, and what effects that the scene switches off would have done.
        start_energy: elastic energy stored in the start shape [J]. These four are functions of the rest, evaluated
            when they are first read.
        iterations: how the solve went.
        accuracy: method, estimated error, time.
        start_fit: root mean square distance of the start from the given points [m]; 0 where it was given exactly.
        level: the march behind it, on whose grid another may go on (`predict(..., like=...)`); None of a reference.
        judged: the prediction like it whose error estimate it took on; None where its own error was estimated.
    """

    scene: Scene
    status: Status
    said: str
    surface: SplineSurface
    iterations: tuple[Iteration, ...]
    accuracy: Accuracy
    start_fit: float
    report_grasps: Callable[[], tuple[GraspReaction, ...]] = field(repr=False)
    report_effects: Callable[[SplineSurface], tuple[EffectReport, ...]] = field(repr=False)
    report_material: Callable[[], MaterialMotion | None] = field(repr=False)
    report_stretch: Callable[[], StretchMotion] = field(repr=False)
    find_objections: Callable[[], list[str]] = field(repr=False)
    find_start_energy: Callable[[], float] = field(repr=False)
    level: "Level | None" = field(default=None, repr=False)
    judged: "Prediction | None" = field(default=None, repr=False)

    @cached_property
    def message(self) -> str:
        """The status in words, what to do about it, and what effects that the scene switches off would have done."""
        return with_notes(self.said, self.find_objections())

    @cached_property
    def grasps(self) -> tuple[GraspReaction, ...]:
        """Reaction of each grasp, in the scene's order."""
        return self.report_grasps()

    @cached_property
    def effects(self) -> tuple[EffectReport, ...]:
        """What was simulated and why."""
        return self.report_effects(self.surface)

    @cached_property
    def start_energy(self) -> float:
        """Elastic energy stored in the start shape [J]."""
        return self.find_start_energy()

    @cached_property
    def material(self) -> MaterialMotion | None:
        """What the sections remember over time; None where they are elastic, and straight whatever the start."""
        return self.report_material()

    @cached_property
    def stretch(self) -> StretchMotion:
        """How far the cable is stretched over time."""
        return self.report_stretch()

    def shape_at(self, t: float | None = None) -> ControlPoints:
        """Return the cable at time `t` [s], its last by default, as the start of another motion.

        Shape, velocity, stretch, twist, spin and memory go on, so that primitives chain: grasp, move, release, grasp
        elsewhere.

        Raises:
            SceneError: `t` is outside the predicted time.
        """
        return continued(self.surface, self.material, t, stretch=self.stretch)


def continued(
    surface: SplineSurface,
    material: MaterialMotion | None,
    t: float | None = None,
    *,
    stretch: StretchMotion | None = None,
) -> ControlPoints:
    """Return the cable of a predicted motion at time `t` [s], its last by default, as the start of another motion.

    Without `stretch`, where it was not stored, the cable goes on with its own length.

    Raises:
        SceneError: `t` is outside the predicted time.
    """
    at = surface.horizon if t is None else number("t", t, at_least=0.0, at_most=surface.horizon, unit="s")
    control, velocity = (surface.states(at, order)[0] for order in (0, 1))
    strain = None
    if stretch is not None:
        strain = np.interp(greville(surface.knots_u), stretch.u, stretch.at(at)).clip(-MAX_STRAIN, MAX_STRAIN)
    return ControlPoints(
        control_points=control,
        knots=surface.knots_u,
        velocity=velocity,
        material=None if material is None else material.at(at),
        strain=strain,
    )
