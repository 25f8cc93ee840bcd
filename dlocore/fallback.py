"""Finer grids where one that was given can't show the motion: what is asked for instead, and what is said of it."""

from dataclasses import replace

from dlocore.errors import SceneError
from dlocore.prediction import Prediction
from dlocore.refinement import AUTO_ENOUGH
from dlocore.scene import MAX_N_T, Quality, Scene
from dlocore.solvers.monitor import Monitor

_MORE_IN_TIME = 2  # times the control points in time of a least squares
# control points in time times the cube of the coordinates of those along the cable, of a least squares that is solved
# once more: some twenty seconds
_MOST_WORK = 2e9


def quality_instead(found: Prediction) -> Quality | None:
    """Return what to ask for where a given grid could not show the motion, None where it did or nothing is left.

    Knots are added: to a march until two grids agree to AUTO_ENOUGH of the length; in time to a least squares that was
    asked for, whose residual the time spline keeps large most often. The printed scheme stays as it is.
    """
    asked, level = found.scene.quality, found.level
    if asked.n_u is None or asked.n_t is None or level is None or found.status in ("converged", "time_limit"):
        return None
    if asked.method != "spacetime":
        target = AUTO_ENOUGH * found.scene.cable.length
        free = replace(asked, n_u=None, n_t=None, target_error=target, method="march")
        return None if asked.method == "paper" else free
    n_t = _MORE_IN_TIME * asked.n_t
    affordable = n_t <= MAX_N_T and n_t * (level.problem.nc * asked.n_u) ** 3 <= _MOST_WORK
    return replace(asked, n_t=n_t) if affordable else None


def no_grid_for(scene: Scene) -> str:
    """Return what to say where a scene goes on from one like it that left the grid that both ask for."""
    quality = scene.quality
    return f"The {quality.n_u} x {quality.n_t} control points that were asked for were left before."


def with_finer(found: Prediction, finer: Prediction | SceneError, spent: float, monitor: Monitor) -> Prediction:
    """Return the answer of finer grids where it is a success, else that of the given one, and say what was done.

    Args:
        found: on the given grid.
        finer: on finer grids, or why there is none.
        spent: on the given grid [s].
        monitor: that of both solves.
    """
    quality, more = found.scene.quality, monitor.elapsed() - spent
    if isinstance(finer, Prediction) and finer.status == "converged":
        accuracy = finer.accuracy
        error = accuracy.error_estimate
        known = "an error that is not known" if error is None else f"an estimated error of {error * 1e3:.2g} mm"
        failed = "did not converge" if quality.method == "spacetime" else "could not show the motion"
        said = (
            f"{finer.said} The {quality.n_u} x {quality.n_t} control points that were asked for {failed}, which took "
            f"{spent * 1e3:.0f} ms to find: {found.said} This is the answer on {accuracy.n_u} x {accuracy.n_t}, with "
            f"{known}, which took {more * 1e3:.0f} ms more."
        )
        return replace(finer, scene=found.scene, said=said)
    reason = str(finer) if isinstance(finer, SceneError) else finer.said
    return replace(
        found,
        said=f"{found.said} Finer grids were tried for {more * 1e3:.0f} ms and do not converge either: {reason}",
        iterations=tuple(monitor.iterations),
        accuracy=replace(found.accuracy, wall_time=monitor.elapsed(), phases=dict(monitor.phases)),
    )
