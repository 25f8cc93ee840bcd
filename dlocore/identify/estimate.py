"""identify(recordings, ...): the parameters of a cable from windows of recordings, starting with short ones."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from time import perf_counter
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.compiling.interrupts import interruptible
from dlocore.errors import SceneError, instances, number, whole
from dlocore.identify.candidate import Candidate, resized
from dlocore.identify.identification import Identification, Progress
from dlocore.identify.intervals import assess
from dlocore.identify.parameters import (
    DEFAULT,
    MEMORY_RATE,
    PLACES,
    Parameter,
    clamp_needed,
    parameters,
    prepared,
)
from dlocore.identify.replay import LEAST_STEP, Resolution
from dlocore.identify.search import Search
from dlocore.identify.together import check_together
from dlocore.identify.windows import cut, gaps_told
from dlocore.recordings import PAIR, Recording
from dlocore.scene.cable import Cable
from dlocore.scene.scene import MAX_N_U, Environment

Floats = NDArray[np.float64]

WINDOW = 5.0  # [s]: longer recordings are replayed in windows of about this length, each from its own start
_SHORTEST, _LONGEST = 1e-3, 1e4  # [s] of such windows
_BEGINS = 0.5, 1.5  # [s] of the windows on which a search begins, for a cable of 1 m; it swings once in 2 s
_MOST_SHORT = 8  # of these windows, at most
_COARSE = 13  # control points with which they are replayed, at most
_STIFFNESSES = 0.1, 0.3, 3.0, 10.0  # times the given stiffness: what is tried first
_BEGINNING = 4  # iterations on them
_DENSITY = 0.04  # [kg/m] of a cable whose recordings do not give it
_UNTWISTED = (
    "Replayed without twist: between two clamps strong damping then makes the cable too stiff. Check the result with "
    "torsional_stiffness as one more parameter."
)
_UNTWISTED_FREE = (
    "Replayed without twist: for a cable in space with strong internal damping, such as this one, EI may come out "
    "far too large, and its interval does not include that. Only a recording with clamps can show it."
)
_STRONG = 0.08  # [s] bending damping over EI, from which on twist matters for a cable that may turn at its ends
_FLAT = 0.02  # of the markers' extent, across the plane that they lie in: a motion in a plane twists nothing


@interruptible
def identify(
    recordings: Sequence[Recording],
    cable: Cable | None = None,
    environment: Environment | None = None,
    *,
    names: tuple[str, ...] = DEFAULT,
    start: Candidate | None = None,
    resolution: Resolution | None = None,
    window: float = WINDOW,
    iterations: int = 25,
    on_progress: Callable[[Progress], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Identification:
    """Identify parameters of a cable from recordings of its motions, or of its shapes at rest.

    Args:
        recordings: of one cable.
        cable: what is known of it, and first guesses; None: from the recordings' facts. Its length is that of the first
            recording, in which its point masses keep their fractions of it. If it has no point masses, it gets those of
            the recordings. Motion and shape depend on forces per mass alone, so its linear density is taken as known.
        environment: first guesses of the drag, and a table.
        names: parameters to identify (`parameters.SCALARS`, "rest_curvature", "clamp_angles", "marker_offsets").
        start: a candidate to begin with, with its own cable and environment: neither is given beside it.
        resolution: how finely recordings are replayed.
        window: [s] of the windows into which longer recordings are cut, 0.001 to 10,000. They are also cut where held
            markers are lost for too long.
        iterations: at most; at least one.
        on_progress: called after every iteration.
        cancelled: called between replays; if it returns True the search stops.

    Raises:
        SceneError: the recordings, or what is requested from them, do not fit together.
        Cancelled: `cancelled` returned True.
    """
    began = perf_counter()
    recordings = instances("recordings", recordings, Recording, "Recording")
    if not recordings:
        raise SceneError("recordings", [], "at least one recording")
    for name, part in (("cable", cable), ("environment", environment)):
        if start is not None and part is not None:
            raise SceneError(name, f"{name} and start", f"either start or {name}", "start has its own")
    check_together(recordings)
    resolution = resolution or Resolution()
    whole("n_u", resolution.n_u, at_least=5, at_most=MAX_N_U)
    number("step", resolution.step, at_least=LEAST_STEP, at_most=1.0, unit="s")
    window = number("window", window, at_least=_SHORTEST, at_most=_LONGEST, unit="s")
    iterations = whole("iterations", iterations, at_least=1)
    windows = cut(recordings, window)
    clamps = max(sum(h.towards is not None for h in r.holds) for r in windows)
    free = sorted({int(i) for r in windows for i in r.free})
    known = cable_of(recordings) if cable is None else _known(cable, recordings)
    given = start or Candidate(cable=known, environment=environment or Environment())
    given = replace(
        given,
        cable=resized(given.cable, cast(float, recordings[0].length)),
        environment=replace(given.environment, gravity=recordings[0].gravity),
    )
    places = PLACES if given.rest_curvature is None else len(given.rest_curvature)
    chosen = parameters(names, clamps, free, places)
    markers = sorted({cast(Floats, r.markers).shape[1] for r in windows})
    if len(markers) > 1 and any(p.name.startswith("marker_offsets") for p in chosen):
        raise SceneError("recordings", f"{markers} markers", "recordings of the same markers, for marker_offsets")
    candidate = prepared(given, tuple(p.name for p in chosen), clamps, markers[-1])
    _check_clamps(windows, chosen, candidate)
    if start is None:
        candidate = _begun(recordings, candidate, chosen, resolution, cancelled)
    search = Search(windows, chosen, resolution, cancelled)
    state = search.run(candidate, iterations, on_progress)
    found = assess(search, state, perf_counter() - began)
    told = [*gaps_told(recordings), *_held_told(recordings)]
    told += _assumed(recordings, given, names, cable is None and start is None, environment is None and start is None)
    if clamps > 1 and "bending_damping" in names and not candidate.twist:
        told.append(_UNTWISTED)
    elif _twists(recordings, found.cable) and not candidate.twist:
        told.append(_UNTWISTED_FREE)
    return replace(found, message=" ".join([found.message, *told]))


def _held_told(recordings: Sequence[Recording]) -> list[str]:
    """Return messages on how held neighbours were read: as one clamp, or as two point grasps."""
    clamps, points = dict[str, None](), dict[str, None]()  # each once, in order
    for recording in recordings:
        held, u = recording.held, cast(Floats, recording.u)
        pairs = {tuple(sorted((h.marker, h.towards))) for h in recording.holds if h.towards is not None}
        taken = {marker for pair in pairs for marker in pair}
        for first, second in pairwise(held):
            said = f"{first} and {second} ({100 * (u[second] - u[first]) / cast(float, recording.length):.3g} %)"
            if (first, second) in pairs:
                clamps[said] = None
            elif second == first + 1 and not taken & {first, second}:
                points[said] = None
    told = []
    if clamps:
        told.append(f"Held markers within {100 * PAIR:g} % of the length are a clamp: {', '.join(clamps)}.")
    if points:
        told.append(
            f"Held neighbours farther apart than {100 * PAIR:g} % of the length are two point grasps, which leave the "
            f"direction free: {', '.join(points)}."
        )
    return told


def _twists(recordings: Sequence[Recording], cable: Cable) -> bool:
    """Tell whether a cable is damped so strongly, and moves so far out of a plane, that its twist may matter."""
    lasts = cable.bending_damping / cast(float, cable.bending_stiffness)
    moving = [cast(Floats, r.markers).reshape(-1, 3) for r in recordings if not r.static]
    seen = [points[np.isfinite(points).all(axis=1)] for points in moving]
    extents = [np.linalg.svd(points - points.mean(axis=0), compute_uv=False) for points in seen if len(points) > 2]
    return lasts > _STRONG and any(across > _FLAT * along for along, _, across in extents)


def _check_clamps(recordings: Sequence[Recording], chosen: Sequence[Parameter], candidate: Candidate) -> None:
    """Refuse parameters that depend on the angle of the sections if a recording has no clamp, which alone shows it."""
    needed = clamp_needed(chosen, candidate)
    for recording in recordings:
        if needed and not any(h.towards is not None for h in recording.holds):
            allowed = "recordings in which a gripper holds two neighbouring markers, as a clamp"
            raise SceneError("recordings", f"{recording.name!r} without a clamp", allowed, needed)


def _assumed(
    recordings: Sequence[Recording], given: Candidate, names: tuple[str, ...], cable: bool, drag: bool
) -> list[str]:
    """Return messages about values that were neither given nor identified, and so were assumed.

    Args:
        recordings: of the cable.
        given: what the search began with.
        names: of the identified parameters.
        cable, drag: whether the numbers of the cable, or those of its drag, were not given.
    """
    moves = any(not r.static for r in recordings)
    assumed = {
        "bending_stiffness": cable, "torsional_stiffness": cable, "bending_damping": cable and moves,
        "drag": drag and moves, "drag_quadratic": drag and moves,
    }  # fmt: skip
    kept = [
        f"{p.name} {p.get(given):g} {p.unit}"
        for p in parameters(tuple(assumed), 0)
        if assumed[p.name] and p.name not in names
    ]
    if cable:
        kept.append(f"axial_stiffness {given.cable.axial_stiffness:g} N")
    if cable and not any(r.diameter is not None for r in recordings):
        kept.append(f"diameter {given.cable.diameter:g} m")
    if "yield_strain" in names and given.cable.memory_rate is None:
        kept.append(f"memory_rate {MEMORY_RATE:g} 1/s")
    said = []
    if kept:
        said.append(f"Neither given nor identified, so kept at an assumed value: {', '.join(kept)}.")
    if cable and not any(r.linear_density is not None for r in recordings) and "linear_density" not in names:
        said.append(
            f"The recordings give no linear density: {given.cable.linear_density:g} kg/m is assumed. Stiffnesses, "
            "damping and drag are in proportion to it."
        )
    return said


def _begun(
    recordings: Sequence[Recording],
    candidate: Candidate,
    chosen: tuple[Parameter, ...],
    resolution: Resolution,
    cancelled: Callable[[], bool] | None,
) -> Candidate:
    """Return a candidate improved on short windows, in which a wrong guess has no time to grow into another motion.

    Only numbers of the cable are sought here: the other parameters need only a fair guess of these.
    """
    scalars = tuple(p for p in chosen if p.name in DEFAULT)
    coarse = replace(resolution, n_u=min(resolution.n_u, _COARSE))
    moving = [r for r in recordings if not r.static]
    for seconds in _BEGINS if scalars else ():
        try:
            short = [w for r in moving for w in cut([r], seconds * np.sqrt(cast(float, r.length)))]
            short = [w for w in short if np.isfinite(cast(Floats, w.markers)[..., 0]).any(axis=0).all()]
            if len(short) > len(moving):
                picked = np.unique(np.linspace(0, len(short) - 1, _MOST_SHORT).round().astype(int))
                search = Search([short[i] for i in picked], scalars, coarse, cancelled)
                candidate = search.run(_stiff(search, candidate), _BEGINNING, None).candidate
        except SceneError:  # short windows may have too few samples, or begin where no start can be found
            continue
    return candidate


def _stiff(search: Search, candidate: Candidate) -> Candidate:
    """Return the candidate with that of several bending stiffnesses that fits the markers best.

    Far from the true stiffness, the misfit of a stiff cable hardly changes with it, so no slope leads there.
    """
    scalar = next((p for p in search.chosen if p.name == "bending_stiffness"), None)
    if scalar is None:
        return candidate
    given = search.play(candidate)
    deviation = search.deviation(given)
    best, least = candidate, search.misfit(np.concatenate(given.residuals), deviation)
    for factor in _STIFFNESSES:
        try:
            other = scalar.put(candidate, factor * scalar.get(candidate))
            misfit = search.misfit(np.concatenate(search.play(other).residuals), deviation)
        except SceneError:  # no such cable, or none with such a start
            continue
        if misfit < least:
            best, least = other, misfit
    return best


def _known(cable: Cable, recordings: Sequence[Recording]) -> Cable:
    """Return a given cable, with the point masses from the recordings if it has none."""
    telling = next((r for r in recordings if r.point_masses), None)
    if telling is None or cable.point_masses:
        return cable
    return replace(resized(cable, cast(float, telling.length)), point_masses=telling.point_masses)


def cable_of(recordings: Sequence[Recording]) -> Cable:
    """Return a first guess of the cable from the facts of its recordings, by default 5 mm thick with 40 g/m.

    The axial stiffness is so high that nothing stretches the cable.
    """
    telling = next((r for r in recordings if r.point_masses), recordings[0])
    density = next((r.linear_density for r in recordings if r.linear_density is not None), _DENSITY)
    cable = Cable(
        length=cast(float, telling.length),
        diameter=next((r.diameter for r in recordings if r.diameter is not None), 0.005),
        linear_density=density,
        bending_stiffness=1e-3 * density / _DENSITY,
        axial_stiffness=500.0 * density / _DENSITY,
        bending_damping=2e-4,
        point_masses=telling.point_masses,
    )
    return resized(cable, cast(float, recordings[0].length))
