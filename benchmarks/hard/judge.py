"""Run a drawn scene and judge the answer: a record of plain numbers and words, one line of JSON."""

import itertools
import time
import traceback
from contextlib import suppress
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from benchmarks.hard.generator import Drawn
from benchmarks.hard.laws import measure
from dlocore import Prediction, Scene, SceneError, predict
from dlocore.accuracy.companion import TOO_LATE, UNKNOWN
from dlocore.levels.driven import driven, words
from dlocore.levels.given import evenly_fitted, given_status
from dlocore.levels.level import Size, given_steps, stretched
from dlocore.levels.progress import surface_at
from dlocore.levels.whole_march import march_level
from dlocore.problem.discretisation import smallest_n_u
from dlocore.problem.events import moments
from dlocore.problem.problem import Problem, pose
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.stability.determined import DISTURBED, UNSEEN, bent
from dlocore.statics.statics import settles_elsewhere, start_grid

WRONG = 0.01  # of the length: larger errors must be reported by the answer
SURE = 0.3  # of the distance from the refined march: the error counts if the refined marches are less than this apart
MOST_STRAIN = 0.02
HELD = 1e-9  # [m]
ASTRAY = 1e-4  # of the length: deviation of the time spline from a gripper's path, between the ends
GAINED = 0.02  # of the largest energy in the motion
LOST = 0.05  # of the impulses in the motion
OPEN = ("does not determine its motion", "mirror image", UNSEEN)  # words in an answer that may be one of several
MIDWAY = (0.25, 0.5, 0.75)  # of the duration of a motion

DRIVEN = "impossible: a gripper drives what it holds into something"

Whose = Literal["checked", "failed", "all"]


def run(
    drawn: Drawn, deadline: float, checked: bool, *, patience: float | None = None, measured: Whose = "failed"
) -> dict[str, Any]:
    """Run one scene and return its record.

    Args:
        drawn: the scene.
        deadline: time limit of the prediction [s].
        checked: whether to compare it with a refined march too.
        patience: time limit of each further solve by the judge [s]; None for the same limit.
        measured: which scenes are disturbed at the start, to tell whether they determine their motion: those that do
            not converge ("failed"), "all", or only those that are compared ("checked"); the compared ones always are.
    """
    patience = deadline if patience is None else patience
    record: dict[str, Any] = {"index": drawn.index, "families": drawn.families, "possible": drawn.possible}
    began, cpu = time.perf_counter(), time.process_time()
    try:
        scene = drawn.make()
        prediction = predict(scene, deadline=deadline)
        record |= _answer(prediction, scene)
        record["seconds"] = time.process_time() - cpu
        record["laws"] = asdict(measure(prediction))
        if checked:
            record |= compare(prediction, scene, patience)
        how = driven_into(prediction, scene, patience)
        if how:
            record |= {"possible": False, "shown": how, "families": (DRIVEN, *drawn.families)}
        failed = measured != "checked" and prediction.status != "converged" and record["possible"]
        if failed or measured == "all" or checked:
            record["disturbed"] = disturbed(prediction, scene, patience)
            if not is_undetermined(record):
                record["midway"] = disturbed_midway(prediction, scene, patience)
    except SceneError as error:
        record |= {"status": "refused", "message": str(error), "field": error.field}
    except Exception as error:  # any error: finding errors is the purpose of this run
        where = traceback.extract_tb(error.__traceback__)[-1]
        record |= {"status": "exception", "message": f"{type(error).__name__}: {error} at {where.name}:{where.lineno}"}
    record.setdefault("seconds", time.process_time() - cpu)
    record["wall"] = time.perf_counter() - began
    record["faults"] = faults(record)
    return record


def _answer(prediction: Prediction, scene: Scene) -> dict[str, Any]:
    accuracy, length = prediction.accuracy, scene.cable.length
    estimate = accuracy.error_estimate
    return {
        "status": prediction.status,
        "message": prediction.message,
        "method": scene.quality.method,
        "solved_by": accuracy.method,
        "effects": [e.name for e in prediction.effects if e.active],
        "dimensions": accuracy.dimensions,
        "asked": None if scene.quality.n_u is None else [scene.quality.n_u, scene.quality.n_t],
        "n_u": accuracy.n_u,
        "n_t": accuracy.n_t,
        "iterations": len(prediction.iterations),
        "estimate": None if estimate is None else estimate / length,
        "target": None if scene.quality.target_error is None else scene.quality.target_error / length,
        "length": length,
    }


def compare(prediction: Prediction, scene: Scene, deadline: float) -> dict[str, Any]:
    """Return the distance from a refined march, and that between two refined marches, relative to the length."""
    accuracy, surface, length = prediction.accuracy, prediction.surface, scene.cable.length
    u, t = np.linspace(0.0, length, 101), np.linspace(0.0, surface.horizon, moments(scene, 65))
    problem = _posed(prediction, scene)
    found = []
    for finer in (2.0, 3.0):
        least = (finer + 2.0) / 3.0  # least refinement relative to the answer, however fine that is
        n_u = max(int(np.clip(round(finer * accuracy.n_u), 33, 129 if finer > 2 else 97)), round(least * accuracy.n_u))
        n_t = max(int(np.clip(round(finer * accuracy.n_t), 65, 513 if finer > 2 else 385)), round(least * accuracy.n_t))
        steps = max(given_steps(n_t), round(finer * accuracy.steps))
        try:
            level = march_level(problem, Size(n_u, n_t, steps), Monitor(None, deadline), free_knots=True)
        except TimeIsUp:
            return {"reference": "time_limit: before the first step"}
        refined = evenly_fitted(level)
        status, message = given_status(refined)
        if status != "converged":
            return {"reference": f"{status}: {message[:120]}"}
        found.append(surface_at(refined, refined.control).positions(u, t))
    own = surface.positions(u, t)
    error = float(np.linalg.norm(own - found[1], axis=-1).max()) / length
    apart = float(np.linalg.norm(found[0] - found[1], axis=-1).max()) / length
    return {"reference": "converged", "error": error, "apart": apart}


def disturbed(prediction: Prediction, scene: Scene, deadline: float) -> float | None:
    """Return how far a start bent by DISTURBED changes the motion, relative to the length; None if no march can tell.

    If it is more than WRONG, the scene does not determine its motion. Three marches run on one grid as fine as the
    finest that the prediction tried, because coarse steps damp what would grow. The start is unchanged in the first,
    and bent by a few half waves in the others. All three must find their equilibria and keep the length of the cable. A
    start that settles is also bent before it settles.
    """
    problem = _posed(prediction, scene)
    n_u, steps = _finest(prediction, problem)
    t = np.linspace(0.0, problem.horizon, 65)
    shapes = []
    for seed in range(3):
        monitor = Monitor(None, deadline)
        grid = start_grid(problem, n_u, monitor)
        start = grid.start + bent(problem, grid, seed) * (seed > 0)
        motion = march(problem, grid.changed(start=start), steps, monitor)
        if motion.stopped or motion.largest_strain > MOST_STRAIN:
            return None
        at = np.searchsorted(motion.times, t).clip(0, len(motion.times) - 1)
        shapes.append(motion.states[at][:, :, : problem.plane.dimensions])
    away = max(float(np.linalg.norm(x - shapes[0], axis=-1).max()) for x in shapes[1:])
    with suppress(TimeIsUp):
        away = max(away, settles_elsewhere(problem, grid, Monitor(None, deadline)))
    return away / scene.cable.length


def disturbed_midway(prediction: Prediction, scene: Scene, deadline: float) -> float | None:
    """Return the same for a motion that is bent at a quarter, a half and three quarters of its time.

    It is None where no march can tell. A motion that goes through equilibria or is damped strongly forgets its start,
    and may still snap or be struck; what decides the outcome is whatever disturbs it at that time. The bend and the
    grid are those of `disturbed`, but in all marches steps begin at those times. All marches share the deadline.
    """
    problem = _posed(prediction, scene)
    n_u, steps = _finest(prediction, problem)
    monitor = Monitor(None, deadline)
    grid = start_grid(problem, n_u, monitor)
    none, dimensions = np.zeros_like(grid.start), problem.plane.dimensions
    at = {part * problem.horizon: none for part in MIDWAY}
    bends = [bent(problem, grid, seed) for seed in (1, 2)]
    plain, most = march(problem, grid, steps, monitor, knocks=at), None
    if plain.stopped or plain.largest_strain > MOST_STRAIN:
        return None
    for moment, bend in itertools.product(at, bends):
        motion = march(problem, grid, steps, monitor, knocks={**at, moment: bend})
        if motion.stopped == "time":
            break
        if not motion.stopped and motion.largest_strain <= MOST_STRAIN:
            away = np.linalg.norm((motion.states - plain.states)[..., :dimensions], axis=-1).max()
            most = max(most or 0.0, float(away) / scene.cable.length)
    return most


def driven_into(prediction: Prediction, scene: Scene, deadline: float) -> str:
    """Return where a gripper drives what it holds into something, as the motion shows; "" if none does.

    The path of a grasp that closes late begins where the cable is at that time, which the generator does not know. On a
    coarse grid this may be elsewhere, so a march as fine as the finest that the prediction tried must show it too.
    """
    level = prediction.level
    if level is None or prediction.status != "stalled" or driven(level.problem, level.motion) is None:
        return ""
    problem = _posed(prediction, scene)
    n_u, steps = _finest(prediction, problem)
    monitor = Monitor(None, deadline)
    motion = march(problem, start_grid(problem, n_u, monitor), steps, monitor)
    found = driven(problem, motion)
    return "" if found is None else words(problem, found)


def _finest(prediction: Prediction, problem: Problem) -> tuple[int, int]:
    """Return control points along the cable and steps, at least those of the finest grid that a prediction tried."""
    n_u = max(50, smallest_n_u(problem), prediction.accuracy.n_u)
    return n_u, max(8 * stretched(problem, 3).steps, prediction.accuracy.steps)


def _posed(prediction: Prediction, scene: Scene) -> Problem:
    """Return the problem with the effects that a prediction found necessary."""
    called = {} if prediction.level is None else prediction.level.posed.called_for
    return pose(scene, {**called, **{e.name: e.reason for e in prediction.effects if e.active}})


def by_a_march(record: dict[str, Any]) -> bool:
    """Tell whether a scene converges by the march that replaces a requested least squares.

    Records made before that last resort existed report a march to 1 % of the length, as "free".
    """
    marched = record["status"] == "converged" and record.get("solved_by") == "march"
    return (marched and record.get("method") == "spacetime") or record.get("free") == "converged"


def left_its_grid(record: dict[str, Any]) -> bool:
    """Tell whether a scene was solved on other, finer grids than the one it requests."""
    asked = record.get("asked")
    return asked is not None and asked != [record["n_u"], record["n_t"]]


def is_undetermined(record: dict[str, Any], growth: float = WRONG / DISTURBED) -> bool:
    """Tell whether a scene was proven not to determine its motion: a change, at the start or midway, grows by more."""
    return max(record.get("disturbed") or 0.0, record.get("midway") or 0.0) > growth * DISTURBED


def tells(record: dict[str, Any]) -> bool:
    """Tell whether an answer says that its error may exceed WRONG, or that another motion is equally possible."""
    told = record["status"] != "converged" or (record["estimate"] or 0.0) > WRONG
    return told or any(words in record["message"] for words in OPEN)


def faults(record: dict[str, Any]) -> list[str]:
    """Return what is wrong with an answer, in words; empty if it is right."""
    status, found = record["status"], []
    if status == "exception":
        return ["exception"]
    if status == "refused":
        return ["refused a possible scene"] if record["possible"] else []
    if not record["possible"]:
        told = "strains the cable" in record["message"]  # a soft cable may follow
        return ["converged on an impossible scene"] if status == "converged" and not told else []
    laws = record["laws"]
    if not laws["finite"]:
        return ["not finite"]
    undetermined = is_undetermined(record)  # another motion is just as right
    if undetermined:
        found.append(f"undetermined and told: {status}" if tells(record) else "undetermined and not told")
    if status == "converged":
        if laws["strain"] > MOST_STRAIN:
            found.append("strained")
        if laws["held"] > HELD * max(1.0, record["length"]):
            found.append("let go of a gripper")
        if laws["held_between"] > ASTRAY * record["length"]:
            found.append("spline off a gripper's path")
        if laws["energy"] is not None and laws["energy"] > GAINED:
            found.append("gained energy")
        if laws["momentum"] is not None and laws["momentum"] > LOST:
            found.append("lost momentum")
        error, estimate = record.get("error", 0.0), record["estimate"]
        if undetermined:
            return found
        if error > WRONG and record["apart"] < SURE * error:
            unknown = any(words in record["message"] for words in (TOO_LATE, UNKNOWN))
            told = unknown if estimate is None else estimate > min(WRONG, 0.5 * error)
            found.append("wrong and told" if told else "lie")
        elif record.get("apart", 0.0) > WRONG:
            found.append("no reference and told" if tells(record) else "no reference and not told")
    elif not undetermined:
        found.append(f"not converged: {status}")
    return found
