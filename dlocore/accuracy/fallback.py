"""Fallbacks for a given grid, or a least squares, that fails, and the messages about them.

A requested least squares that does not converge is solved once more with more control points in time. If it does not
converge on them either, its march is the answer, as a last resort. If the error on a grid is too large, or the motion
on it does not reach its end, finer grids are used.
"""

from collections.abc import Sequence
from dataclasses import replace

from dlocore.accuracy.refinement import AUTO_ENOUGH
from dlocore.errors import SceneError
from dlocore.levels.level import Level
from dlocore.prediction import Prediction
from dlocore.scene.scene import MAX_N_T, Quality, Scene
from dlocore.solvers.monitor import Monitor
from dlocore.words import in_mm, in_ms

_MORE_IN_TIME = 2  # times the control points in time of a least squares
# control points in time times the cube of the coordinates along the cable, up to which a least squares is solved
# once more: some twenty seconds
_MOST_WORK = 2e9
_NEARER = 0.5  # times the estimated error of a given grid: finer grids with less error are the answer, converged or not


def falls_short(found: Prediction) -> bool:
    """Tell whether something else has to be solved in place of an answer on a given grid.

    That is so if it did not converge, or if its estimated error is more than AUTO_ENOUGH of the length. The printed
    scheme is left as it is.
    """
    asked = found.scene.quality
    given = asked.n_u is not None and asked.method != "paper" and found.level is not None
    return given and (found.status not in ("converged", "time_limit") or errs(found))


def errs(found: Prediction) -> bool:
    """Tell whether the error estimate of a converged answer is above AUTO_ENOUGH of the length."""
    error = found.accuracy.error_estimate
    most = AUTO_ENOUGH * found.scene.cable.length + found.accuracy.neglected  # neglected effects remain on finer grids
    return found.status == "converged" and error is not None and error > most


def more_in_time(found: Prediction) -> Quality | None:
    """Return the quality to request if a least squares did not converge; None if that would take too long.

    It has more control points in time: most often it is the time spline that keeps the residual large.
    """
    asked, level = found.scene.quality, found.level
    assert asked.n_u is not None
    assert asked.n_t is not None
    assert level is not None
    n_t = _MORE_IN_TIME * asked.n_t
    affordable = n_t <= MAX_N_T and n_t * (level.problem.nc * asked.n_u) ** 3 <= _MOST_WORK
    return replace(asked, n_t=n_t) if affordable else None


def free_grids(scene: Scene) -> Quality:
    """Return the quality to request if a given grid can't show the motion: finer grids that agree to AUTO_ENOUGH."""
    target = AUTO_ENOUGH * scene.cable.length
    return Quality(target_error=target, method="march")


def as_marched(level: Level) -> Level:
    """Return the march that a least squares started from as if it had been requested itself."""
    scene = level.posed.scene
    scene = replace(scene, quality=replace(scene.quality, method="march"))
    return replace(level, posed=replace(level.posed, scene=scene), problem=replace(level.problem, scene=scene))


def left_before(scene: Scene, solved: Scene) -> str:
    """Return what to say if a scene continues from a similar one that was not solved in the way both requested."""
    asked, kept = scene.quality, solved.quality
    said = []
    if asked.method == "spacetime" != kept.method:
        said.append("The requested least squares did not suffice for a similar scene: this is a march.")
    if (asked.n_u, asked.n_t) != (kept.n_u, kept.n_t):
        said.append(f"The requested {asked.n_u} x {asked.n_t} control points did not suffice for a similar scene.")
    return " ".join(said)


def by_march(marched: Prediction, tried: Sequence[tuple[Quality, Prediction | SceneError]], spent: float) -> Prediction:
    """Return the march that is the answer because no least squares converges, and say what was tried.

    Args:
        marched: the march.
        tried: the least squares, and the result of each.
        spent: time spent on them [s].
    """
    ends = [f"on {quality.n_u} x {quality.n_t} control points {_end(found)}" for quality, found in tried]
    least = f"the requested least squares, which did not converge in {in_ms(spent)}"
    return replace(marched, said=f"{marched.said} A march gives the answer instead of {least}: {'; '.join(ends)}.")


def _end(found: Prediction | SceneError) -> str:
    """Return how a solve ended, in words, as part of a sentence."""
    said = str(found) if isinstance(found, SceneError) else found.said
    first = said.split(". ")[0].removesuffix(".")
    return first[:1].lower() + first[1:]


def with_finer(found: Prediction, finer: Prediction | SceneError, spent: float, monitor: Monitor) -> Prediction:
    """Return the answer on finer grids if it converged or is far closer, else the given grid's; say what was done.

    Args:
        found: the answer on the given grid.
        finer: the answer on finer grids, or why there is none.
        spent: time spent on the given grid [s].
        monitor: of both solves.
    """
    quality, more = found.scene.quality, monitor.elapsed() - spent
    off = f"by an estimated {in_mm(found.accuracy.error_estimate or 0.0)}" if errs(found) else ""
    if isinstance(finer, Prediction) and (finer.status == "converged" or _is_nearer(finer, found)):
        accuracy = finer.accuracy
        error = accuracy.error_estimate
        known = "an unknown error" if error is None else f"an estimated error of {in_mm(error)}"
        failed = "did not converge" if accuracy.method == "spacetime" else "could not show the motion"
        failed = f"err {off}" if off else failed
        said = (
            f"{finer.said} The requested {quality.n_u} x {quality.n_t} control points {failed}, which took "
            f"{in_ms(spent)} to find out: {found.said} This answer is on {accuracy.n_u} x {accuracy.n_t}, with "
            f"{known}, which took {in_ms(more)} more."
        )
        return replace(finer, scene=found.scene, said=said)
    reason = str(finer) if isinstance(finer, SceneError) else finer.said
    failed = f", as it errs {off}, but do not converge" if off else " but do not converge either"
    return replace(
        found,
        said=f"{found.said} Finer grids were tried for {in_ms(more)}{failed}: {reason}",
        iterations=tuple(monitor.iterations),
        accuracy=replace(found.accuracy, wall_time=monitor.elapsed(), phases=dict(monitor.phases)),
    )


def _is_nearer(finer: Prediction, found: Prediction) -> bool:
    """Tell whether finer grids that don't converge have so much less error than a given one that they are better.

    If the given grid stalled, its message says what is wrong with the scene, so it is kept.
    """
    error, given = finer.accuracy.error_estimate, found.accuracy.error_estimate
    if error is None or given is None or found.status == "stalled":
        return False
    return error < _NEARER * given
