"""What a solve returns."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.answer.parts import (
    Accuracy,
    ContactForce,
    EffectReport,
    GraspReaction,
    Iteration,
    MaterialMotion,
    Status,
    StretchMotion,
    with_notes,
)
from dlocore.compiling.interrupts import interruptible
from dlocore.errors import number
from dlocore.pickling import state_with
from dlocore.scene.scene import MAX_STRAIN, ControlPoints, Scene
from dlocore.spline import SplineSurface, greville, nearest_line
from dlocore.words import in_mm, in_ms, in_newtons

if TYPE_CHECKING:
    from dlocore.levels.level import Level

Floats = NDArray[np.float64]

PART, TINY = 0.2, 1e-4  # of how far the cable moves, and of its length: up to which an error is not worth a word
NOTHING = 1e-6  # of the length of the cable: what moves by less stands still but for what a solve leaves
UNSURE = 0.5  # of a force: from which on its error is worth one, where it is more than TINY of what weighs or bends it


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A predicted motion. It can be pickled, with all that is read from it and may be found only then.

    Attributes:
        scene: what was asked.
        status: "converged", or why not; never a success word for a failure.
        said: the status in words, and what to do about it.
        surface: the bivariate spline q(u, t).
        grasps: reaction of each grasp, in the scene's order.
        contacts: force of the table, and of each obstacle that was simulated, on the cable; of method reference none.
        effects: what was simulated and why.
        notes: what is to be known beside the status, such as what effects that the scene switches off would have done.
        message: what is said, and the notes.
        start_energy: elastic energy stored in the start shape [J]. These six are functions of the rest, evaluated
            when they are first read.
        iterations: how the solve went.
        accuracy: method, estimated error, time.
        start_fit: root mean square distance of the start from the given points [m], which no error estimate counts; 0
            where it was given exactly.
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
    report_grasps: Callable[[], tuple[GraspReaction, ...]]
    report_contacts: Callable[[], tuple[ContactForce, ...]]
    report_effects: Callable[[SplineSurface], tuple[EffectReport, ...]]
    report_material: Callable[[], MaterialMotion | None]
    report_stretch: Callable[[], StretchMotion]
    find_objections: Callable[[], list[str]]
    find_start_energy: Callable[[], float]
    level: "Level | None" = None
    judged: "Prediction | None" = None

    def __repr__(self) -> str:
        accuracy = self.accuracy
        error = "not known" if accuracy.error_estimate is None else in_mm(accuracy.error_estimate)
        by = f"{accuracy.method} on {accuracy.n_u} x {accuracy.n_t} control points"
        return f"<Prediction: {self.status} by {by}, estimated error {error}, in {in_ms(accuracy.wall_time)}>"

    @cached_property
    @interruptible
    def notes(self) -> tuple[str, ...]:
        """What is to be known beside the status: of the scene as given, strains, instabilities, effects left out."""
        from dlocore.problem.notes import scene_notes  # it needs the compiler, which to make a scene does not

        return (*scene_notes(self.scene), *self._objections, *self._of_a_small_motion(), *self._of_unsure_forces())

    def _of_a_small_motion(self) -> list[str]:
        """Return what is told of an answer that is good for the length of the cable, but not for so small a motion."""
        control, error = self.surface.control_points[..., :3], self.accuracy.error_estimate
        length, moved = self.surface.length, float(np.linalg.norm(control - control[0], axis=-1).max())
        if self.status != "converged" or error is None or not error > max(PART * moved, TINY * length):
            return []
        if not moved > NOTHING * length:
            return []
        return [f"the cable moves by {in_mm(moved)}, of which the estimated error is much: give a smaller target_error"]

    def _of_unsure_forces(self) -> list[str]:
        """Return which forces of grippers are hardly known, for half of the time, though the motion is."""
        if self.status != "converged" or self.accuracy.error_estimate is None:
            return []
        cable, told = self.scene.cable, []
        small = TINY * max(self.scene.weight, cast(float, cable.bending_stiffness) / cable.length**2)
        for grasp in self.grasps:
            sizes = np.linalg.norm(grasp.reaction, axis=1)
            if grasp.reaction_error is None or not sizes.any():
                continue
            size, error = (float(np.median(values[sizes > 0.0])) for values in (sizes, grasp.reaction_error))
            if error > max(UNSURE * size, small):
                told.append(
                    f"the force of the gripper at u = {grasp.u:.4g} m is {in_newtons(size)}, give or take "
                    f"{in_newtons(error)}, as the median over time: give a smaller target_error where it matters"
                )
        return told

    @cached_property
    @interruptible
    def _objections(self) -> list[str]:
        return self.find_objections()

    @cached_property
    def message(self) -> str:
        """The status in words, what to do about it, and the notes."""
        return with_notes(self.said, self.notes)

    @cached_property
    @interruptible
    def grasps(self) -> tuple[GraspReaction, ...]:
        """Reaction of each grasp, in the scene's order."""
        return self.report_grasps()

    @cached_property
    @interruptible
    def contacts(self) -> tuple[ContactForce, ...]:
        """Force of the table, and of each obstacle that was simulated, on the cable."""
        return self.report_contacts()

    @cached_property
    @interruptible
    def effects(self) -> tuple[EffectReport, ...]:
        """What was simulated and why."""
        return self.report_effects(self.surface)

    @cached_property
    @interruptible
    def start_energy(self) -> float:
        """Elastic energy stored in the start shape [J]."""
        return self.find_start_energy()

    @cached_property
    @interruptible
    def material(self) -> MaterialMotion | None:
        """What the sections remember over time, and how they are turned.

        None where they are elastic, and straight whatever the start. But for method "reference" there is the director
        of those that twist, too, and all else is zero where they remember nothing.
        """
        return self.report_material()

    @cached_property
    @interruptible
    def stretch(self) -> StretchMotion:
        """How far the cable is stretched over time, to the accuracy of a tension."""
        return self.report_stretch()

    def energies(self, times: ArrayLike) -> dict[str, Floats]:
        """Return the energies of the motion at `times` (k,) [s]; each (k,) [J], by the keys of `dlocore.energies`.

        Raises:
            SceneError: a time is outside the predicted time.
        """
        from dlocore.balance import energies  # it needs the compiler

        return energies(self.scene, self.surface, times, self.material, self.stretch)

    def __getstate__(self) -> dict[str, Any]:
        state = state_with(
            self,
            grasps="report_grasps",
            contacts="report_contacts",
            effects="report_effects",
            material="report_material",
            stretch="report_stretch",
            start_energy="find_start_energy",
            _objections="find_objections",
        )
        if self.level is not None:
            state["level"] = self.level.alone  # what those beside it were for is known now
        return state

    def shape_at(self, t: float | None = None) -> ControlPoints:
        """Return the cable at time `t` [s], its last by default, as the start of another motion.

        Shape, velocity, stretch, twist, spin and memory go on, so that primitives chain: grasp, move, release, grasp
        elsewhere. Where the sections remember nothing, but twist, the motion is the same without `material`, which is
        then but their director. A strain of more than 50 %, which no cable follows, is given as 50 %: such a cable may
        be too long to go on.

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
        strain = nearest_line(greville(surface.knots_u), stretch.u, stretch.at(at)).clip(-MAX_STRAIN, MAX_STRAIN)
    return ControlPoints(
        control_points=control,
        knots=surface.knots_u,
        velocity=velocity,
        material=None if material is None else material.at(at),
        strain=strain,
    )
