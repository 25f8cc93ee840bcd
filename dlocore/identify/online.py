"""Identification while a cable moves, from a sliding window of frames, with the last estimate as prior."""

from collections import deque
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.compiling.interrupts import interruptible
from dlocore.errors import SceneError, array, instance, number
from dlocore.identify.candidate import Candidate
from dlocore.identify.parameters import DEFAULT, clamp_needed, parameters, prepared
from dlocore.identify.replay import Played, Replay, Resolution
from dlocore.identify.search import measured, robust_deviation, weights
from dlocore.identify.windows import gaps
from dlocore.recordings import LEAST_FRAMES, Recording, seen_markers
from dlocore.scene.cable import Cable
from dlocore.scene.scene import Environment

Floats = NDArray[np.float64]

_ASIDE = 1e-3  # step of a coordinate to a neighbouring motion: large enough for one that is marched with a tolerance
_FIRST = 1.0  # standard deviation of a logarithm, or of a share of a usual value, before any frame
_FORGOTTEN = 0.02  # added to it in every update: cables warm up, wear, are replaced
_STEP = 0.3  # change of a coordinate in one update, at most
_AT_ONCE = 2  # parameters that an update improves, at most: each costs a motion in addition to the replayed one
_BLOCK = 25  # frames whose residuals are correlated: this many count as one


@dataclass(frozen=True, kw_only=True)
class Update:
    """The result of an update.

    Attributes:
        values: by parameter.
        deviations: standard deviation of each, on the scale on which it is sought.
        distance: median distance of the free markers from the prediction of the window [m].
        seconds: time that the update took.
    """

    values: dict[str, float]
    deviations: dict[str, float]
    distance: float
    seconds: float


class _NothingShownError(Exception):
    """The latest frames can't improve an estimate; the message says why."""


class Identifier:
    """An estimate of the cable that is updated as frames arrive.

    Every update replays the frames of the last `window` seconds once and makes one Gauss-Newton step in at most two
    parameters, which take turns. The prior is the last estimate and its covariance, slightly widened. Not every frame
    needs an update.

    Args:
        u: material coordinates of the markers (m,) [m], at least three, rising from 0 at the earliest.
        held: numbers of the markers that grippers hold, at least one; negative ones count from the end. Two held
            neighbours within 6 % of the length are one clamp. Others are point grasps, which leave the direction free:
            if those hold a cable that is in fact clamped, EI comes out wrong.
        cable, environment: first guesses, and what is known.
        names: parameters to identify, as in `identify`.
        window: above 0 to 60 [s]; it has 12 frames at least.
        rate: of the frames, 1 to 10,000 [Hz].
        resolution: how finely the window is replayed.

    Attributes:
        skipped: why the last `update` returned None; "" if it did not.

    Raises:
        SceneError: an argument is out of range or of another type, nothing is held, or a parameter is unknown or needs
            a clamp.
    """

    def __init__(
        self,
        u: ArrayLike,
        held: tuple[int, ...],
        cable: Cable,
        environment: Environment | None = None,
        *,
        names: tuple[str, ...] = DEFAULT,
        window: float = 0.8,
        rate: float = 30.0,
        resolution: Resolution | None = None,
    ) -> None:
        instance("cable", cable, Cable, "a Cable")
        instance("environment", environment, Environment | None, "an Environment, or None")
        instance("resolution", resolution, Resolution | None, "a Resolution, or None")
        start = Candidate(cable=cable, environment=environment or Environment())
        u = array("u", u, shape=(None,), unit="m")
        self._count = len(u)
        self._window = Recording(  # its frames are put into it at each update
            times=np.arange(LEAST_FRAMES),
            markers=np.zeros((LEAST_FRAMES, self._count, 3)),
            u=u,
            held=held,
            length=cable.length,
            gravity=start.environment.gravity,
        )
        if not self._window.held:
            raise SceneError("held", (), "at least one held marker", "Nothing shows how the cable is moved")
        window = number("window", window, above=0.0, at_most=60.0, unit="s")
        rate = number("rate", rate, at_least=1.0, at_most=1e4, unit="Hz")
        self._frames = max(12, round(window * rate))
        self._times: deque[float] = deque(maxlen=self._frames)
        self._markers: deque[Floats] = deque(maxlen=self._frames)
        self._resolution = resolution or Resolution(n_u=9, step=1.0 / rate, start_frames=6)
        clamps = sum(h.towards is not None for h in self._window.holds)
        self._chosen = parameters(names, clamps, self._window.free.tolist())
        self._candidate = prepared(start, tuple(p.name for p in self._chosen), clamps, self._count)
        needed = clamp_needed(self._chosen, self._candidate)
        if needed and not clamps:
            raise SceneError("held", self._window.held, "two neighbouring markers, as a clamp", needed)
        self._precision = np.eye(len(self._chosen)) / _FIRST**2
        self._next = 0
        self.skipped = ""

    @property
    def cable(self) -> Cable:
        """The latest estimate of the cable."""
        return self._candidate.cable

    @property
    def environment(self) -> Environment:
        """The latest estimate of the drag."""
        return self._candidate.environment

    def add(self, time: float, markers: ArrayLike) -> None:
        """Take a frame: time [s] and markers (m, 3) [m], NaN or masked if lost.

        Raises:
            SceneError: the time is not after the last one, the number of markers differs, or something is no number.
        """
        time = number("time", time, unit="s")
        x = seen_markers(markers)
        if x.shape != (self._count, 3):
            raise SceneError("markers", f"shape {x.shape}", f"({self._count}, 3)")
        if self._times and not time > self._times[-1]:
            raise SceneError("time", time, f"after the last frame at {self._times[-1]:g} s")
        self._times.append(time)
        self._markers.append(x)

    def _derivatives(self, replay: Replay, played: Played, x: Floats) -> Floats:
        """Return the derivatives (frames, m, 3, parameters) of the prediction by the parameters whose turn it is.

        There are two, or one if neighbouring motions can't be followed from the replayed one: marching one takes twice
        the time.

        Raises:
            ValueError: a neighbouring motion departs from the replayed one, which is unstable and so has no derivative.
        """
        count, followed = len(x), replay.differentiable(played)
        out = np.zeros((*played.predicted.shape, count))
        for _ in range(min(_AT_ONCE if followed else 1, count)):
            j, p = self._next, self._chosen[self._next]
            self._next = (j + 1) % count
            candidate = p.put(self._candidate, p.value(x[j] + _ASIDE))
            moved = replay.play_beside(played, candidate) if followed else replay.play(candidate, played).predicted
            out[..., j] = (moved - played.predicted) / _ASIDE
        return out

    @interruptible
    def update(self) -> Update | None:
        """Improve the estimate by the latest frames; return None while there are too few, or if they show nothing.

        They show nothing if a held marker is lost for too long, if a marker is hardly ever seen, if nothing can be
        replayed, or if the motion is so unstable that it has no derivative. `skipped` then says which.
        """
        self.skipped = ""
        try:
            return self._improved(perf_counter())
        except _NothingShownError as reason:
            self.skipped = str(reason)
            return None

    def _replayed(self) -> tuple[Replay, Played]:
        """Replay the window with the latest estimate.

        Raises:
            _NothingShownError: it can't be replayed.
        """
        if len(self._times) < self._frames:
            raise _NothingShownError(f"{len(self._times)} of the {self._frames} frames of a window have arrived")
        times = np.array(self._times) - self._times[0]
        try:
            recording = replace(self._window, times=times, markers=np.array(self._markers))
            for gap in gaps(recording):
                lost = f"held marker {gap.marker} is lost for {gap.end - gap.begin:.2g} s"
                raise _NothingShownError(f"{lost}, up to {self._times[0] + gap.end:.4g} s")
            replay = Replay(recording, self._resolution)
            played = replay.play(self._candidate)
        except SceneError as error:  # a marker is hardly seen, or outliers begin the window: no cable lies like that
            raise _NothingShownError(f"the window can't be replayed: {error}") from error
        if played.stopped:
            raise _NothingShownError("the replay stops before its end")
        if played.motion.split > 0:
            raise _NothingShownError("the replay takes smaller steps, so neighbouring motions jump")
        return replay, played

    def _improved(self, began: float) -> Update:
        """Improve the estimate; `began` is when that began, on the clock `perf_counter` [s].

        Raises:
            _NothingShownError: the latest frames show nothing.
        """
        replay, played = self._replayed()
        recording, free = replay.recording, replay.recording.free
        x = np.array([p.coordinate(p.get(self._candidate)) for p in self._chosen])
        try:
            J = self._derivatives(replay, played, x)[:, free].reshape(-1, len(x))
        except ValueError as error:
            raise _NothingShownError(f"the motion has no derivative: {error}") from error
        away = (played.predicted - replay.markers)[:, free]
        r = np.where(np.isfinite(away), away, 0.0).ravel()
        J[~np.isfinite(away).ravel()] = 0.0
        deviation = robust_deviation(r[measured(recording, replay.markers)])
        w = weights(r, deviation) / (deviation**2 * _BLOCK)
        prior = np.linalg.inv(np.linalg.inv(self._precision) + _FORGOTTEN**2 * np.eye(len(x)))
        data = (J * w[:, None]).T @ J
        step = np.clip(-np.linalg.solve(prior + data, J.T @ (w * r)), -_STEP, _STEP)
        for j, p in enumerate(self._chosen):
            value = p.value(float(x[j] + step[j]))
            self._candidate = p.put(self._candidate, value if p.logarithmic else max(value, p.least))
        # neighbouring windows share most frames: only what is new counts
        self._precision = prior + data / self._frames
        spread = np.sqrt(np.diag(np.linalg.inv(self._precision)))
        return Update(
            values={p.name: p.get(self._candidate) for p in self._chosen},
            deviations={p.name: float(s) for p, s in zip(self._chosen, spread, strict=True)},
            distance=float(np.nanmedian(np.linalg.norm(away, axis=2))),
            seconds=perf_counter() - began,
        )
