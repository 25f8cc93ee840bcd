"""How well the identified parameters are known: intervals, correlations, and what the data do not determine."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from dlocore.errors import SceneError
from dlocore.identify.candidate import Candidate
from dlocore.identify.frames import rest_points
from dlocore.identify.identification import Estimated, Fit, Identification
from dlocore.identify.parameters import Parameter
from dlocore.identify.replay import Played, Replay
from dlocore.identify.rest import Rest, Settled
from dlocore.identify.search import Search, State, robust_deviation, weights
from dlocore.identify.tracks import noise_of_free
from dlocore.spline import DEGREE
from dlocore.words import counted, in_mm

Floats = NDArray[np.float64]

_BLOCK = 0.5  # [s] within which residuals are taken as correlated
_SHAKES = 12  # replays with different noise of the held markers and the start
_UNSEEN = 1.0  # half the interval of a logarithm, or in usual values: from this on a parameter is not identified
_UNEXPLAINED = 2.0  # times what noise explains: a model that misses markers by more lacks something
_ELSEWHERE = 0.2  # of the length: a prediction that misses half of the markers by more is another motion
_ASTRAY = 0.01  # of the length: a prediction that misses the markers, or is moved by noise, by more can't be trusted


def assess(search: Search, state: State, seconds: float) -> Identification:
    """Return the identification of a finished search.

    The variance of a value is the sum of three: that from the residuals, taken as independent, or as correlated within
    blocks of half a second if that gives more; that from the noise of what was taken as known, the held markers and the
    start, found by replays with different noise of the same size; and the square of the change due to half the span
    length and half the step.
    """
    chosen = search.chosen
    x = search.coordinates(state.candidate)
    r = np.concatenate(state.residuals)
    deviation = search.deviation(state)
    derivatives = cast(list[Floats], state.derivatives)
    J = np.concatenate(derivatives)
    w = weights(r, deviation)
    data = (J * w[:, None]).T @ J / deviation**2
    prior = np.diag(1.0 / search.prior() ** 2)
    weak = np.diag(np.where(np.diag(prior) > 0, np.diag(prior), 1e-4))
    inverse = np.linalg.inv(data + weak)
    blocks = _blocks(search, state, w * r / deviation**2)
    spread = sum((np.outer(g, g) for g in blocks), np.zeros_like(data))
    spread *= len(blocks) / max(len(blocks) - len(x), 1)
    clustered = inverse @ spread @ inverse
    noise, spread_by_noise, unshaken = _shaken(search, state, w / deviation**2)
    shaken = inverse @ noise @ inverse
    plain = np.diag(inverse)
    pull, unrefined = _refined(search, state, w / deviation**2)
    refined = inverse @ pull
    variance = np.maximum(plain, np.diag(clustered)) + np.diag(shaken) + refined**2
    quantile = float(stdtrit(max(len(blocks) - len(x), 2), 0.975))
    share = np.array([_information(D, residual, deviation) for D, residual in
                      zip(derivatives, state.residuals, strict=True)])  # fmt: skip
    parts = share / np.maximum(share.sum(axis=0), 1e-300)
    estimated = tuple(
        _estimated(p, x[j], float(np.sqrt(variance[j])), quantile, float(data[j, j]), search, parts[:, j])
        for j, p in enumerate(chosen)
    )
    told = np.array([e.identifiable for e in estimated])
    size = np.sqrt(np.diag(inverse))
    correlations = inverse / np.outer(size, size)
    correlations[~told] = np.nan
    correlations[:, ~told] = np.nan
    fits = tuple(_fit(*pair) for pair in zip(search.replays, state.played, strict=True))
    doubts = [*_left_out(unshaken, unrefined), *_doubts(search, state, spread_by_noise)]
    message = " ".join([_message(state, estimated, correlations), *doubts])
    return Identification(
        status=state.status,
        message=message,
        candidate=state.candidate,
        parameters=estimated,
        correlations=correlations,
        rest_shape=_rest_shape(search, state.candidate),
        fits=fits,
        deviation=deviation,
        iterations=state.iterations,
        seconds=seconds,
    )


def _rest_shape(search: Search, candidate: Candidate) -> Floats | None:
    if candidate.rest_curvature is None:
        return None
    replay = search.replays[0]
    return rest_points(candidate.rest_curvature, replay.span.scaled(candidate.length_ratio), replay.references[0])


def _fit(replay: Replay | Rest, played: Played | Settled) -> Fit:
    recording = replay.recording
    times = cast(Floats, recording.times)
    return Fit(
        name=recording.name,
        begin=float(times[0]),
        end=float(times[-1]),
        static=recording.static,
        gravity=cast(Floats, recording.gravity),
        times=times[replay.compared],
        measured=replay.markers,
        predicted=played.predicted,
        free=recording.free,
        stalled=played.stopped,
    )


def _information(D: Floats, r: Floats, deviation: float) -> Floats:
    return np.asarray(((D * weights(r, deviation)[:, None]) * D).sum(axis=0))


def _blocks(search: Search, state: State, pull: Floats) -> list[Floats]:
    """Return the gradient of the misfit by blocks of time, or by shapes at rest."""
    out, at = [], 0
    for replay, D in zip(search.replays, cast(list[Floats], state.derivatives), strict=True):
        part = (D * pull[at : at + len(D), None]).reshape(len(replay.compared), -1, D.shape[1]).sum(axis=1)
        at += len(D)
        times = cast(Floats, replay.recording.times)[replay.compared]
        number = np.arange(len(times)) if isinstance(replay, Rest) else ((times - times[0]) / _BLOCK).astype(int)
        out += [part[number == k].sum(axis=0) for k in np.unique(number)]
    return out


def _shaken(search: Search, state: State, scale: Floats) -> tuple[Floats, dict[str, Floats], int]:
    """Return the effect of noise of the held markers and the start.

    This is the covariance of the gradient of the misfit; the robust deviation (3,) of the coordinates of the free
    markers [m], for each recording of a motion; and the number of replays that could not begin.
    """
    size = len(search.chosen)
    total = np.zeros((size, size))
    at, moved, lost = 0, dict[str, list[Floats]](), 0
    for i, (replay, played) in enumerate(zip(search.replays, state.played, strict=True)):
        D = cast(list[Floats], state.derivatives)[i]
        factor = scale[at : at + len(D)]
        at += len(D)
        free = replay.recording.free
        found = []
        for seed in range(_SHAKES):
            search.check()
            noise = np.random.default_rng([i, seed])
            try:
                deviation = robust_deviation(state.residuals[i][search.measured[i]])
                other = _disturbed(search, replay, deviation, noise).play(state.candidate)
            except SceneError:
                lost += 1
                continue
            change = (other.predicted - played.predicted)[:, free].ravel()
            found.append(D.T @ (factor * change))
            if not replay.recording.static:
                moved.setdefault(replay.recording.name, []).append(change.reshape(-1, 3))
        if found:
            total += np.array(found).T @ np.array(found) / len(found)
    return total, {name: _by_axis(np.concatenate(changes)) for name, changes in moved.items()}, lost


def _by_axis(away: Floats) -> Floats:
    """Return the robust deviation (3,) of each coordinate of (k, 3) [m]."""
    return np.array([robust_deviation(x) for x in away.T])


def _disturbed(search: Search, replay: Replay | Rest, deviation: float, noise: np.random.Generator) -> Replay | Rest:
    """Return a replay with different noise of what is held; for shapes at rest, noise as large as the residuals."""
    recording = replay.recording
    if not recording.static:
        return search.replay(recording, noise)
    markers = cast(Floats, recording.markers)
    size = min(deviation, _ASTRAY * cast(float, recording.length))
    return search.replay(replace(recording, markers=markers + size * noise.standard_normal(markers.shape)))


def _refined(search: Search, state: State, scale: Floats) -> tuple[Floats, int]:
    """Return the gradient of the misfit that a net twice as fine and half the step give.

    Return also the number of windows that could not be replayed with them.
    """
    resolution = search.resolution
    finer = replace(resolution, n_u=2 * resolution.n_u - DEGREE, step=0.5 * resolution.step)
    total = np.zeros(len(search.chosen))
    at, lost = 0, 0
    for i, (replay, played) in enumerate(zip(search.replays, state.played, strict=True)):
        search.check()
        D = cast(list[Floats], state.derivatives)[i]
        factor = scale[at : at + len(D)]
        at += len(D)
        kind = Rest if isinstance(replay, Rest) else Replay
        try:
            other = kind(replay.recording, finer, search.references).play(state.candidate)
        except SceneError:
            lost += 1
            continue
        if not other.stopped:
            change = other.predicted - played.predicted
            total += D.T @ (factor * change[:, replay.recording.free].ravel())
    return total, lost


def _left_out(unshaken: int, unrefined: int) -> list[str]:
    """Return messages about what intervals leave out because replays with other noise or a finer net can't begin."""
    parts = [
        f"{counted(lost, 'replay')} {how} can't begin"
        for lost, how in ((unshaken, "with other noise of the start"), (unrefined, "on a finer net"))
        if lost
    ]
    return [f"{' and '.join(parts)}: the intervals do not include what they would add."] if parts else []


def _estimated(
    p: Parameter, x: float, deviation: float, quantile: float, information: float, search: Search, parts: Floats
) -> Estimated:
    value = p.value(x)
    low, high = p.value(x - quantile * deviation), p.value(x + quantile * deviation)
    if not p.logarithmic:
        low = max(low, p.least)
    unseen = not information > 1e-8
    wide = quantile * deviation > _UNSEEN * (1.0 if p.logarithmic else max(1.0, abs(x)))
    if unseen:
        statement = f"{p.name} can't be seen in these recordings: it changes nothing that was measured."
    elif wide:
        statement = f"{p.name} can't be determined from these recordings: any value from {low:.2g} to {high:.2g} fits."
    elif not p.logarithmic and np.isfinite(p.least) and low <= p.least:
        statement = f"{p.name} is at most {high:.2g} {p.unit}, and may be zero."
    else:
        half = 0.5 * (high - low)
        # a parameter that may have either sign has no size to compare with
        known = f"{100 * half / value:.2g} %" if np.isfinite(p.least) else f"{half:.2g} {p.unit}"
        statement = f"{p.name} = {f'{value:.3g} {p.unit}'.rstrip()}, known to {known}."
    rests: dict[str, float] = {}
    for replay, part in zip(search.replays, parts, strict=True):
        rests[replay.recording.name] = rests.get(replay.recording.name, 0.0) + float(part)
    return Estimated(
        name=p.name,
        unit=p.unit,
        value=value,
        low=low,
        high=high,
        identifiable=not (unseen or wide),
        statement=statement,
        rests_on={} if unseen else rests,
    )


def _doubts(search: Search, state: State, by_noise: Mapping[str, Floats]) -> list[str]:
    """Return messages on why the intervals may not hold, for the worst recording of a motion and of shapes at rest.

    Each recording is judged by the direction with the largest misfit: in a planar motion, the direction across the
    plane holds only noise.

    Args:
        search, state: the finished search, and its final state.
        by_noise: how far noise of the held markers and the start moves the prediction along each axis (3,) [m], for
            each recording of a motion; empty if unknown.
    """
    length = max(cast(float, window.length) for window in search.windows)
    said = list[str]()
    wild = {name: float(moved.max()) for name, moved in by_noise.items() if moved.max() > _ASTRAY * length}
    if wild:
        said += [
            f"Noise of the held markers and the start alone moves the prediction by {in_mm(max(wild.values()))}:",
            "intervals don't hold for so sensitive a motion. Record a slower one, or replay shorter windows.",
        ]
    found: dict[bool, list[_Miss]] = {False: [], True: []}
    for static, name in dict.fromkeys((w.static, w.name) for w in search.windows):
        if not static and name in wild:
            continue
        own = [i for i, w in enumerate(search.windows) if (w.static, w.name) == (static, name)]
        away = np.concatenate([search.away(state, i) for i in own])
        explained = np.full(3, np.inf)  # the noise of shapes at rest is not known
        if not static and name in by_noise:
            noise = np.max([noise_of_free(search.windows[i]) for i in own], axis=0)
            explained = np.hypot(by_noise[name], noise)
        deviation = _by_axis(away)
        miss = _Miss(
            name, float(np.median(np.linalg.norm(away, axis=1))) / length, float(deviation.max()) / length,
            float((deviation / explained).max()),
        )  # fmt: skip
        if miss.times > _UNEXPLAINED or miss.deviation > _ASTRAY:
            found[static].append(miss)
    several = len({w.name for w in search.windows}) > 1
    for static, misses in found.items():
        if not misses:
            continue
        worst = max(misses, key=lambda miss: (miss.times, miss.deviation))
        whose = f" of {worst.name!r}" if several else ""
        if worst.times > _UNEXPLAINED:
            times = float(f"{worst.times:.2g}")
            much, why = f"{times:g} times what noise explains", "the model lacks something"
        else:
            much = f"with a deviation of {100 * worst.deviation:.2g} % of the length"
            why = "the tracking is wild, the model lacks something"
        said += [
            f"The free markers{whose} {'at rest ' if static else ''}are missed by {in_mm(worst.distance * length, 3)} "
            f"in the median, {much}:",
            f"{why}, or another cable fits them better. Intervals account for noise only.",
        ]
        if worst.distance > _ELSEWHERE:
            said.append("That is another motion: are gravity, held and the order of the markers right?")
    return said


@dataclass(frozen=True)
class _Miss:
    """How far the prediction misses the free markers of a recording.

    Attributes:
        name: of the recording.
        distance: median distance of the free markers, in lengths of the cable.
        deviation: robust deviation in the worst direction, in lengths of the cable.
        times: its ratio to what noise explains, in the worst direction.
    """

    name: str
    distance: float
    deviation: float
    times: float


def _message(state: State, estimated: tuple[Estimated, ...], correlations: Floats) -> str:
    """Return a message on how the search ended, and on what it does not determine."""
    done = "Converged" if state.status == "converged" else "Stopped without converging"
    why = ", as no step improves the fit: nearby values of the parameters make the prediction jump, or fail"
    parts = [f"{done} in {counted(state.iterations, 'iteration')}{why if state.stuck else ''}."]
    parts += [e.statement for e in estimated if not e.identifiable]
    n = len(estimated)
    tied = [(i, j) for i in range(n) for j in range(i) if abs(correlations[i, j]) > 0.95]
    parts += [
        f"{estimated[i].name} and {estimated[j].name} can hardly be told apart (correlation {correlations[i, j]:.2f})."
        for i, j in tied
    ]
    return " ".join(parts)
