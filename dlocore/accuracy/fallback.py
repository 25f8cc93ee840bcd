"""What takes the place of a given grid or of a least squares that fails on it, and what is said of that.

A least squares that was asked for and does not converge is solved once more with more control points in time; where it
does not converge on them either its march is the answer, as the last resort. A grid on which a motion errs too much, or
does not come to its end, is left for finer ones.
"""

from collections.abc import Sequence
from dataclasses import replace

from dlocore.accuracy.refinement import AUTO_ENOUGH
from dlocore.errors import SceneError
from dlocore.levels.level import Level
from dlocore.prediction import Prediction
from dlocore.scene.scene import MAX_N_T, Quality, Scene
from dlocore.solvers.monitor import Monitor
from dlocore.words import in_mm

_MORE_IN_TIME = 2  # times the control points in time of a least squares
# control points in time times the cube of the coordinates of those along the cable, of a least squares that is solved
# once more: some twenty seconds
_MOST_WORK = 2e9
_NEARER = 0.5  # times the estimated error of a given grid: finer ones that err by less are the answer, converged or not


def falls_short(found: Prediction) -> bool:
    """Tell whether something else is to be solved in place of an answer on a given grid.

    It is where that is no success, or errs by more than AUTO_ENOUGH of the length as it estimates. The printed scheme
    stays as it is.
    """
    asked = found.scene.quality
    given = asked.n_u is not None and asked.method != "paper" and found.level is not None
    return given and (found.status not in ("converged", "time_limit") or errs(found))


def errs(found: Prediction) -> bool:
    """Tell whether a success errs by more than AUTO_ENOUGH of the length, as it estimates: its grid is too coarse."""
    error = found.accuracy.error_estimate
    most = AUTO_ENOUGH * found.scene.cable.length + found.accuracy.neglected  # which finer grids leave as it is
    return found.status == "converged" and error is not None and error > most


def more_in_time(found: Prediction) -> Quality | None:
    """Return what to ask for where a least squares did not converge, None where that would take too long.

    It is more control points in time: the time spline is what keeps the residual large most often.
    """
    asked, level = found.scene.quality, found.level
    assert asked.n_u is not None
    assert asked.n_t is not None
    assert level is not None
    n_t = _MORE_IN_TIME * asked.n_t
    affordable = n_t <= MAX_N_T and n_t * (level.problem.nc * asked.n_u) ** 3 <= _MOST_WORK
    return replace(asked, n_t=n_t) if affordable else None


def free_grids(scene: Scene) -> Quality:
    """Return what to ask for where a given grid can't show the motion: two finer ones that agree to AUTO_ENOUGH."""
    target = AUTO_ENOUGH * scene.cable.length
    return replace(scene.quality, n_u=None, n_t=None, target_error=target, method="march")


def as_marched(level: Level) -> Level:
    """Return the march that a least squares started from as one that was asked for itself."""
    scene = level.posed.scene
    scene = replace(scene, quality=replace(scene.quality, method="march"))
    return replace(level, posed=replace(level.posed, scene=scene), problem=replace(level.problem, scene=scene))


def left_before(scene: Scene, solved: Scene) -> str:
    """Return what to say where a scene goes on from one like it that was not solved as both ask for."""
    asked, kept = scene.quality, solved.quality
    said = []
    if asked.method == "spacetime" != kept.method:
        said.append("The least squares that was asked for was left before: this is a march.")
    if (asked.n_u, asked.n_t) != (kept.n_u, kept.n_t):
        said.append(f"The {asked.n_u} x {asked.n_t} control points that were asked for were left before.")
    return " ".join(said)


def by_march(marched: Prediction, tried: Sequence[tuple[Quality, Prediction | SceneError]], spent: float) -> Prediction:
    """Return the march that is the answer as no least squares converges, and say what was tried.

    Args:
        marched: the march.
        tried: the least squares, and what came of each.
        spent: on them [s].
    """
    ends = [f"on {quality.n_u} x {quality.n_t} control points {_end(found)}" for quality, found in tried]
    least = f"the least squares that was asked for, which did not converge in {spent * 1e3:.0f} ms"
    return replace(marched, said=f"{marched.said} A march is the answer in place of {least}: {'; '.join(ends)}.")


def _end(found: Prediction | SceneError) -> str:
    """Return how a solve ended, in words, as a part of a sentence."""
    said = str(found) if isinstance(found, SceneError) else found.said
    first = said.split(". ")[0].removesuffix(".")
    return first[:1].lower() + first[1:]


def with_finer(found: Prediction, finer: Prediction | SceneError, spent: float, monitor: Monitor) -> Prediction:
    """Return the answer of finer grids where it is a success, or far nearer, else the given one's; say what was done.

    Args:
        found: on the given grid.
        finer: on finer grids, or why there is none.
        spent: on the given grid [s].
        monitor: that of both solves.
    """
    quality, more = found.scene.quality, monitor.elapsed() - spent
    off = f"by an estimated {in_mm(found.accuracy.error_estimate or 0.0)}" if errs(found) else ""
    if isinstance(finer, Prediction) and (finer.status == "converged" or _is_nearer(finer, found)):
        accuracy = finer.accuracy
        error = accuracy.error_estimate
        known = "an error that is not known" if error is None else f"an estimated error of {in_mm(error)}"
        failed = "did not converge" if accuracy.method == "spacetime" else "could not show the motion"
        failed = f"err {off}" if off else failed
        said = (
            f"{finer.said} The {quality.n_u} x {quality.n_t} control points that were asked for {failed}, which took "
            f"{spent * 1e3:.0f} ms to find: {found.said} This is the answer on {accuracy.n_u} x {accuracy.n_t}, with "
            f"{known}, which took {more * 1e3:.0f} ms more."
        )
        return replace(finer, scene=found.scene, said=said)
    reason = str(finer) if isinstance(finer, SceneError) else finer.said
    failed = f", as it errs {off}, and do not converge" if off else " and do not converge either"
    return replace(
        found,
        said=f"{found.said} Finer grids were tried for {more * 1e3:.0f} ms{failed}: {reason}",
        iterations=tuple(monitor.iterations),
        accuracy=replace(found.accuracy, wall_time=monitor.elapsed(), phases=dict(monitor.phases)),
    )


def _is_nearer(finer: Prediction, found: Prediction) -> bool:
    """Tell whether finer grids, though they don't converge, err by so much less than a given one that they are better.

    Where that stalled it says what is wrong with the scene.
    """
    error, given = finer.accuracy.error_estimate, found.accuracy.error_estimate
    if error is None or given is None or found.status == "stalled":
        return False
    return error < _NEARER * given
