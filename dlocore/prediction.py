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
from dlocore.errors import instance, number
from dlocore.pickling import state_with
from dlocore.scene.paths import Still
from dlocore.scene.scene import MAX_STRAIN, ControlPoints, Scene
from dlocore.spline import SplineSurface, greville, nearest_line
from dlocore.words import in_mm, in_ms, in_newtons, per_m

if TYPE_CHECKING:
    from dlocore.levels.level import Level

Floats = NDArray[np.float64]

PART, TINY = 0.2, 1e-4  # of how far the cable moves, and of its length: smaller errors get no note
NOTHING = 1e-6  # of the length of the cable: a smaller motion counts as none, it may come from the solver alone
UNSURE = 0.5  # of a force: larger errors get a note, if they exceed TINY of the weight, or of EI/L^2 if that is more


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A predicted motion.

    Some attributes (`grasps`, `contacts`, `effects`, `notes`, `message`, `start_energy`, `material`, `stretch`) are
    computed when they are first read. Pickling computes and stores them too.

    Attributes:
        scene: the scene that was solved.
        status: "converged", or why the solve did not converge; never a success word for a failure.
        said: the status in words, and what to do about it.
        surface: the bivariate spline q(u, t).
        grasps: reaction of each grasp, in the scene's order.
        contacts: force of the table, and of each simulated obstacle, on the cable; empty for method "reference".
        effects: what was simulated and why.
        notes: what else to know, for example what the effects that the scene switches off would have done.
        message: `said` and the notes.
        start_energy: elastic energy stored in the start shape [J].
        iterations: how the solve went.
        accuracy: method, estimated error, time.
        start_fit: root mean square distance of the start from the given points [m], which no error estimate includes;
            0 if the start was given exactly.
        level: the march behind the answer, whose grid another solve can reuse (`predict(..., like=...)`); None for
            method "reference".
        judged: the similar prediction (`like`) whose error estimate was reused; None if the error was estimated anew.
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
        """What else to know: about the scene as given, strains, instabilities, effects that were left out."""
        from dlocore.problem.notes import scene_notes  # imports the compiler, which making a scene does not need

        told = [*scene_notes(self.scene), *self._objections, *self._of_a_small_motion()]
        return (*told, *self._of_sharp_bends(), *self._of_unsure_forces())

    def _of_a_small_motion(self) -> list[str]:
        """Return a note if the error is small against the length of the cable, but not against its motion."""
        control, error = self.surface.control_points[..., :3], self.accuracy.error_estimate
        length, moved = self.surface.length, float(np.linalg.norm(control - control[0], axis=-1).max())
        if self.status != "converged" or error is None or not error > max(PART * moved, TINY * length):
            return []
        if not moved > NOTHING * length:
            return []
        return [
            f"the cable moves by only {in_mm(moved)}, and the estimated error is large compared with that: give a "
            "smaller target_error"
        ]

    def _of_sharp_bends(self) -> list[str]:
        """Return a note if the cable bends beside a gripper more sharply than the surface shows."""
        from dlocore.answer.sharp_bends import sharpest_hidden  # imports the compiler

        if self.status != "converged" or self.level is None or all(g.hold == "point" for g in self.scene.grasps):
            return []
        bend = sharpest_hidden(self.level.problem, self.surface, self.grasps)
        if bend is None:
            return []
        error = "" if bend.error is None else f", give or take {per_m(bend.error)},"
        return [
            f"the cable bends beside primitives[{bend.grasp}] more sharply than the surface shows: with "
            f"{per_m(bend.by_moment)} by the gripper's moment{error} and {per_m(bend.shown)} on the surface. If you "
            "need it, give a smaller target_error"
        ]

    def _of_unsure_forces(self) -> list[str]:
        """Return notes on gripper forces whose median error over time is large, though the motion converged."""
        if self.status != "converged" or self.accuracy.error_estimate is None:
            return []
        cable, told = self.scene.cable, []
        small = TINY * max(self.scene.weight, cast(float, cable.bending_stiffness) / cable.length**2)
        advice = "If you need it, give a smaller target_error"
        jumps = any(not isinstance(g.path, Still) and g.path.profile == "linear" for g in self.scene.grasps)
        if jumps and not cable.bending_damping:
            advice = (
                "Where the velocity of a gripper jumps (profile linear), an undamped cable rings, the faster the finer "
                "the grid: if you need the force, let grippers start and stop smoothly, or give bending_damping"
            )
        for grasp in self.grasps:
            sizes = np.linalg.norm(grasp.reaction, axis=1)
            if grasp.reaction_error is None or not sizes.any():
                continue
            size, error = (float(np.median(values[sizes > 0.0])) for values in (sizes, grasp.reaction_error))
            if error > max(UNSURE * size, small):
                told.append(
                    f"the force of the gripper at u = {grasp.u:.4g} m is uncertain: {in_newtons(size)}, give or take "
                    f"{in_newtons(error)} (medians over time). {advice}"
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
        """What the sections remember over time, and how they are turned; None if they have nothing to remember.

        They have nothing to remember if they are elastic and their stress-free shape is straight whatever the start. A
        motion with twist is an exception, unless it is by method "reference": `material` then holds the director, and
        all else in it is zero.
        """
        return self.report_material()

    @cached_property
    @interruptible
    def stretch(self) -> StretchMotion:
        """Axial strain of the cable over time, accurate enough to read a tension from it."""
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
            state["level"] = self.level.alone  # the levels beside it served the forces' errors, which are known now
        return state

    def shape_at(self, t: float | None = None) -> ControlPoints:
        """Return the cable at time `t` [s], its last by default, as the start of another motion.

        Shape, velocity, stretch, twist, spin and memory carry over, so that primitives chain: grasp, move, release,
        grasp elsewhere. If the cable twists but remembers nothing, the next motion is the same without `material`,
        which then holds only the director. Strains beyond 50 %, which no real cable bears, are clipped to 50 %; such a
        cable may be too long to continue.

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

    Args:
        surface: the predicted motion.
        material: how its sections are turned and what they remember; None: nothing is known of them.
        t: time [s].
        stretch: its axial strain; None, for example if it was not stored: the cable continues with its own length.

    Raises:
        SceneError: `t` is outside the predicted time, or an argument is of another type.
    """
    instance("surface", surface, SplineSurface, "a SplineSurface")
    instance("material", material, MaterialMotion | None, "a MaterialMotion, or None")
    instance("stretch", stretch, StretchMotion | None, "a StretchMotion, or None")
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
