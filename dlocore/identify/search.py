"""The search for parameters: robust Gauss-Newton over the windows of some recordings."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import Cancelled, SceneError, within
from dlocore.identify.candidate import Candidate
from dlocore.identify.identification import Progress, Status
from dlocore.identify.parameters import Parameter
from dlocore.identify.replay import Played, Replay, Resolution, common_references
from dlocore.identify.rest import Rest, Settled
from dlocore.identify.tracks import varying
from dlocore.recordings import Recording

Floats = NDArray[np.float64]

_FOLLOWED = 1e-5  # step of a coordinate in which a neighbouring motion is followed
_MARCHED = 2e-2  # the same if it is marched, where the tolerance would hide a smaller step
_KNEE = 1.5  # robust deviations, above which a residual counts by its size instead of its square
_LEAST_DEVIATION = 2e-4  # [m] of the residuals; no tracking is better than this
_MOST_CHANGE = 1.0  # of a coordinate in one iteration
_HOPED = 1e-2  # expected relative decrease below which a search may end when no step is better
_CONVERGED = 1e-3  # relative decrease of the cost


@dataclass(frozen=True, eq=False)
class State:
    """The state of the search: candidate, replays of it, residuals; stuck: no step gave what the slope promised."""

    candidate: Candidate
    played: list[Played | Settled]
    residuals: list[Floats]
    status: Status = "max_iterations"
    iterations: int = 0
    stuck: bool = False
    derivatives: list[Floats] | None = None


class Search:
    """Robust Gauss-Newton over the windows of some recordings."""

    def __init__(
        self,
        windows: Sequence[Recording],
        chosen: tuple[Parameter, ...],
        resolution: Resolution,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        self.windows, self.chosen, self.resolution, self.cancelled = windows, chosen, resolution, cancelled
        self.references = common_references(windows)
        self.replays = [self.replay(w) for w in windows]
        self.measured = [measured(w, replay.markers) for w, replay in zip(windows, self.replays, strict=True)]

    def replay(self, window: Recording, shake: np.random.Generator | None = None) -> Replay | Rest:
        """Return what replays a window, or its shapes at rest; with `shake`, with different noise of what moves it."""
        with within(window.place):
            if window.static:
                return Rest(window, self.resolution, self.references)
            return Replay(window, self.resolution, self.references, shake)

    def check(self) -> None:
        """Raise Cancelled if the search was cancelled."""
        if self.cancelled is not None and self.cancelled():
            raise Cancelled("The identification was cancelled")

    def run(
        self, candidate: Candidate, iterations: int, on_progress: Callable[[Progress], None] | None = None
    ) -> State:
        """Return the best candidate found from the given one, and its derivatives."""
        state = self.play(candidate)
        damping, status, done, stuck = 1e-3, cast(Status, "max_iterations"), 0, False
        even = np.array([not p.logarithmic for p in self.chosen])
        for done in range(1, iterations + 1):
            r = np.concatenate(state.residuals)
            deviation = self.deviation(state)
            state = replace(state, derivatives=self.derivatives(state))
            J = np.concatenate(cast(list[Floats], state.derivatives))
            x = self.coordinates(state.candidate)
            H, g = self._normal(J, r, deviation, x)
            before = self.cost(r, deviation, x)
            free = self._free(x, H, g)
            found: State | None = None
            after, hoped = before, 0.0
            for _ in range(6):
                step = np.zeros(len(x))
                matrix = H[np.ix_(free, free)]
                step[free] = -np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), g[free])
                hoped = hoped or -0.5 * float(g[free] @ step[free])
                most = _MOST_CHANGE * np.maximum(1.0, np.abs(x) * even)
                trial = self._bounded(x + np.clip(step, -most, most))
                candidate = self.candidate(state.candidate, trial)
                try:
                    tried = self.play(candidate)
                except SceneError:
                    damping *= 10.0
                    continue
                after = self.cost(np.concatenate(tried.residuals), deviation, trial)
                if after < before:
                    found = tried
                    break
                damping = max(10.0 * damping, 1e-2)
            if found is None:  # there is no better one nearby; if a large decrease was expected, this is no minimum
                stuck = hoped >= _HOPED * before
                status = "max_iterations" if stuck else "converged"
                break
            damping = max(0.2 * damping, 1e-7)
            state = found
            if on_progress is not None:
                values = {p.name: p.get(state.candidate) for p in self.chosen}
                on_progress(Progress(iteration=done, distance=self.distance(state), values=values))
            if before - after < _CONVERGED * before:
                status = "converged"
                break
        if state.derivatives is None:
            state = replace(state, derivatives=self.derivatives(state))
        return replace(state, status=status, iterations=done, stuck=stuck)

    def play(self, candidate: Candidate) -> State:
        """Return all windows replayed with a candidate."""
        played: list[Played | Settled] = []
        residuals = []
        for replay in self.replays:
            self.check()
            with within(replay.recording.place):
                one = replay.play(candidate)
            played.append(one)
            residuals.append(self._residuals(replay, one.predicted))
        return State(candidate, played, residuals)

    def _residuals(self, replay: Replay | Rest, predicted: Floats) -> Floats:
        free = replay.recording.free
        away = (predicted - replay.markers)[:, free]
        return np.where(np.isfinite(away), away, 0.0).ravel()

    def derivatives(self, state: State) -> list[Floats]:
        """Return the derivatives (residuals, parameters) of the residuals of each window."""
        x = self.coordinates(state.candidate)
        out = []
        for replay, played in zip(self.replays, state.played, strict=True):
            J = np.zeros((len(self._residuals(replay, played.predicted)), len(x)))
            known = self._followed(replay, played, state.candidate)
            for j in range(len(x)):
                self.check()
                J[:, j] = self._column(replay, played, state.candidate, x, j, known)
            lost = ~np.isfinite(replay.markers[:, replay.recording.free]).ravel()
            J[lost] = 0.0
            out.append(J)
        return out

    def _followed(self, replay: Replay | Rest, played: Played | Settled, candidate: Candidate) -> Floats | None:
        """Return the prediction, followed to rounding; None if it can't be followed."""
        if isinstance(replay, Rest) or isinstance(played, Settled) or not replay.differentiable(played):
            return None
        try:
            return replay.play_beside(played, candidate)
        except ValueError:
            return None

    def _column(
        self,
        replay: Replay | Rest,
        played: Played | Settled,
        candidate: Candidate,
        x: Floats,
        j: int,
        known: Floats | None,
    ) -> Floats:
        free = replay.recording.free
        if known is not None and isinstance(replay, Replay) and isinstance(played, Played):
            moved = x.copy()
            moved[j] += _FOLLOWED
            if self.chosen[j].name.startswith("marker_offsets"):  # the start moves with it too, and is soon forgotten
                placed = (played.problem, played.grid, played.motion.times, played.motion.states)
                change = replay.positions(self.candidate(candidate, moved), *placed) - played.predicted
                return (change[:, free] / _FOLLOWED).ravel()
            try:
                change = replay.play_beside(played, self.candidate(candidate, moved)) - known
                return (change[:, free] / _FOLLOWED).ravel()
            except ValueError:
                pass  # it departed: marched instead
        for step in (_MARCHED, -_MARCHED):
            moved = x.copy()
            moved[j] += step
            beside = self.candidate(candidate, moved)
            try:
                if isinstance(replay, Replay) and isinstance(played, Played):
                    change = replay.play(beside, played).predicted - played.predicted
                else:
                    change = replay.play(beside).predicted - played.predicted
            except SceneError:  # no such cable has this start
                continue
            return (change[:, free] / step).ravel()
        return np.zeros(played.predicted[:, free].size)  # the window says nothing about it

    def coordinates(self, candidate: Candidate) -> Floats:
        """Return the parameters of a candidate on the scales on which they are sought."""
        return np.array([p.coordinate(p.get(candidate)) for p in self.chosen])

    def candidate(self, base: Candidate, x: Floats) -> Candidate:
        """Return the candidate of coordinates."""
        for p, value in zip(self.chosen, x, strict=True):
            base = p.put(base, p.value(float(value)))
        return base

    def _bounded(self, x: Floats) -> Floats:
        least = [-np.inf if p.logarithmic else p.least / p.scale for p in self.chosen]
        return np.maximum(x, least)

    def _free(self, x: Floats, H: Floats, g: Floats) -> NDArray[np.int64]:
        """Return the parameters that affect the measurements, or have a prior, and are not held at their bound."""
        held = [not p.logarithmic and x[j] <= p.least / p.scale and g[j] > 0 for j, p in enumerate(self.chosen)]
        return np.flatnonzero((np.diag(H) > 0.0) & ~np.array(held))

    def _normal(self, J: Floats, r: Floats, deviation: float, x: Floats) -> tuple[Floats, Floats]:
        """Return the normal matrix and gradient of the cost."""
        w = weights(r, deviation) / deviation**2
        H = (J * w[:, None]).T @ J + np.diag(1.0 / self.prior() ** 2)
        return H, J.T @ (w * r) + self._pull(x)

    def prior(self) -> Floats:
        """Return the standard deviation of the prior of each coordinate; infinite if there is none."""
        return np.array([p.prior for p in self.chosen])

    def _pull(self, x: Floats) -> Floats:
        """Return the gradient of the prior, which is zero for parameters that it does not pull."""
        return np.where([p.centred for p in self.chosen], x / self.prior() ** 2, 0.0)

    def cost(self, r: Floats, deviation: float, x: Floats) -> float:
        """Return the robust cost of residuals and prior."""
        return self.misfit(r, deviation) + 0.5 * float(x @ self._pull(x))

    @staticmethod
    def misfit(r: Floats, deviation: float) -> float:
        """Return the robust cost of residuals."""
        return float((np.sqrt(1.0 + (r / (_KNEE * deviation)) ** 2) - 1.0).sum()) * _KNEE**2

    def away(self, state: State, window: int) -> Floats:
        """Return the distances of the predicted free markers of a window from where they were seen (k, 3) [m]."""
        seen = np.isfinite(self.replays[window].markers[:, self.windows[window].free, 0]).ravel()
        return state.residuals[window].reshape(-1, 3)[seen]

    def distance(self, state: State) -> float:
        """Return the median distance of the free markers from their predictions [m]."""
        every = np.concatenate([self.away(state, i) for i in range(len(self.windows))])
        return float(np.median(np.linalg.norm(every, axis=1)))

    def deviation(self, state: State) -> float:
        """Return the robust deviation of a coordinate of the measured residuals [m]."""
        return robust_deviation(np.concatenate(state.residuals)[np.concatenate(self.measured)])


def measured(recording: Recording, markers: Floats) -> NDArray[np.bool_]:
    """Tell which coordinates (k,) of the free `markers` (frames, m, 3) [m] of a recording were measured.

    Not measured are those of lost markers and those that never change, such as z of 2D markers.
    """
    known = np.isfinite(markers) & varying(cast(Floats, recording.markers))
    return np.asarray(known[:, recording.free].ravel())


def robust_deviation(r: Floats) -> float:
    """Return the standard deviation of residuals (k,) [m], not inflated by outliers."""
    return max(1.4826 * float(np.median(np.abs(r))) if len(r) else 0.0, _LEAST_DEVIATION)


def weights(r: Floats, deviation: float) -> Floats:
    """Return the weights of residuals: 1 for small ones, falling as 1/|r| for large ones."""
    return np.asarray(1.0 / np.sqrt(1.0 + (r / (_KNEE * deviation)) ** 2))
