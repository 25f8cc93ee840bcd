"""Replay a recording: a scene with its grippers, predicted from its first frames with a candidate's parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from dlocore.answer.frames import unit
from dlocore.errors import SceneError, number, whole
from dlocore.identify.beginning import rests, start_markers
from dlocore.identify.candidate import Candidate, varied
from dlocore.identify.frames import across, carried, tilted, turned_from, with_sections
from dlocore.identify.span import Span
from dlocore.identify.start import start_fit
from dlocore.identify.tracks import held_paths
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem, pose
from dlocore.recordings import Hold, Recording
from dlocore.scene.paths import Waypoints
from dlocore.scene.scene import MAX_N_U, ControlPoints, Grasp, Scene, Switch
from dlocore.sensitivity import KnownMotion, beside, factored, objection
from dlocore.solvers.march import STRONGLY_DAMPED, March, march
from dlocore.solvers.monitor import Monitor
from dlocore.spline import DEGREE, design_matrix
from dlocore.statics.statics import start_grid

Floats = NDArray[np.float64]

LIES_SO = "markers that show how the cable lies, a first guess closer to it, or more control points"
LEAST_STEP = 1e-5  # [s] of a search; the step is halved for the intervals
_SLACK = 1.003  # of the cable between two grippers: held markers farther apart are brought nearer
_REST_FRAMES = 8  # frames from which on it can be seen whether a start is at rest
_CARRIED = 3  # tangents from a marker to the next, over which a frame is carried


@dataclass(frozen=True, kw_only=True, eq=False)
class Resolution:
    """How finely a recording is replayed: control points, time step [s], and frames that its start is taken from.

    Raises:
        SceneError: a value is out of range.
    """

    n_u: int = 13
    step: float = 0.005
    start_frames: int = 12

    def __post_init__(self) -> None:
        whole("n_u", self.n_u, at_least=5, at_most=2 * MAX_N_U - DEGREE)  # that of intervals, too
        number("step", self.step, at_least=0.5 * LEAST_STEP, at_most=1.0, unit="s")
        whole("start_frames", self.start_frames, at_least=2, at_most=1000)


@dataclass(frozen=True, eq=False)
class Played:
    """A replayed recording.

    Attributes:
        candidate: the one it was replayed with.
        predicted: positions of all markers at the compared frames (frames, m, 3) [m].
        problem, grid, motion: what was solved.
    """

    candidate: Candidate
    predicted: Floats
    problem: Problem
    grid: Grid
    motion: March

    @property
    def stopped(self) -> bool:
        """Whether the prediction ended before the recording."""
        return bool(self.motion.stopped)

    @cached_property
    def known(self) -> KnownMotion:
        """The motion with its steps factorised."""
        return factored(self.problem, self.motion)


@dataclass(frozen=True, eq=False)
class _Path:
    """Positions (k, 3) and directions (k, 3) of a gripper at the steps, with their rates at the first."""

    positions: Floats
    directions: Floats | None
    speed: Floats
    turning: Floats


class Replay:
    """Replays one recording of a motion with any candidate; everything that does not depend on it is prepared once.

    Args:
        recording: of a motion.
        resolution: how finely.
        references: direction of each clamp about which its frame is chosen (clamps, 3); None: its mean in this
            recording. Windows of one experiment need the same references, so that angles mean the same in all of them.
        shake: seeds noise of the held markers and of the start, as large as theirs, to see its effect on the
            prediction.
    """

    def __init__(
        self,
        recording: Recording,
        resolution: Resolution,
        references: Floats | None = None,
        shake: np.random.Generator | None = None,
    ) -> None:
        if recording.static:
            raise SceneError("static", True, "a recording of a motion", "Shapes at rest have no motion to replay")
        if not recording.holds:
            raise SceneError("held", recording.held, "at least one held marker", "Nothing shows how the cable is moved")
        self.recording, self.resolution = recording, resolution
        times = cast(Floats, recording.times)
        self.span = Span.of(recording)
        frames = max(2, min(resolution.start_frames, len(times) - 4))
        self.begin = float(times[:frames].mean())
        self.compared = np.arange(frames, len(times))
        self.horizon = float(times[-1] - self.begin)
        self.steps = max(8, round(self.horizon / resolution.step))
        self.step_times = np.linspace(0.0, self.horizon, self.steps + 1)
        self.markers = cast(Floats, recording.markers)[frames:]
        clean = held_paths(recording, shake)
        self.holds = recording.holds
        self.clamps = tuple(h for h in self.holds if h.towards is not None)
        self.references = self._references(clean) if references is None else references
        self.paths = self._reachable(tuple(self._path(h, clean) for h in self.holds))
        self.ways = tuple(self._way(i) for i in range(len(self.holds)))
        self.seen, self.start_markers, self.start_speeds = start_markers(recording, frames, self.begin, shake)
        self.at_rest = frames >= _REST_FRAMES and rests(recording, frames)
        self._guess: Floats | None = None

    def _references(self, clean: dict[int, CubicSpline]) -> Floats:
        t = self.begin + self.step_times
        found = []
        for h in self.clamps:
            mean = self._directions(h, clean, t).mean(axis=0)
            found.append(mean / np.linalg.norm(mean))
        return np.array(found).reshape(-1, 3)

    @staticmethod
    def _directions(h: Hold, clean: dict[int, CubicSpline], t: Floats) -> Floats:
        return h.along(clean[h.marker](t), clean[cast(int, h.towards)](t))

    def _path(self, h: Hold, clean: dict[int, CubicSpline]) -> _Path:
        t = self.begin + self.step_times
        speed = clean[h.marker](self.begin, 1)
        if h.towards is None:
            return _Path(clean[h.marker](t), None, speed, np.zeros(3))
        directions = self._directions(h, clean, t)
        return _Path(clean[h.marker](t), directions, speed, (directions[1] - directions[0]) / self.step_times[1])

    def _reachable(self, paths: tuple[_Path, ...]) -> tuple[_Path, ...]:
        """Bring grippers together that noise has put farther apart than the cable between them reaches."""
        u = self.span.u
        paths = tuple(replace(p, positions=p.positions.copy()) for p in paths)
        for (a, p), (b, q) in pairwise(zip(self.holds, paths, strict=True)):
            across = q.positions - p.positions
            apart = np.linalg.norm(across, axis=1)
            most = _SLACK * (u[b.marker] - u[a.marker])
            over = 0.5 * np.maximum(apart - most, 0.0) / apart
            p.positions[:] += over[:, None] * across
            q.positions[:] -= over[:, None] * across
        return paths

    def _way(self, i: int) -> tuple[Waypoints, Rotation | None]:
        """Return the path of a gripper, and its rotations at its first two instants."""
        path = self.paths[i]
        if path.directions is None:
            return Waypoints(times=self.step_times, positions=path.positions, start="moving"), None
        turns = turned_from(self.references[self.clamps.index(self.holds[i])], path.directions)
        quaternions = (turns * turns[0].inv()).as_quat()[:, [3, 0, 1, 2]]
        way = Waypoints(times=self.step_times, positions=path.positions, orientations=quaternions, start="moving")
        return way, turns[:2]

    def scene(self, candidate: Candidate) -> Scene:
        """Return the scene of the recording for a candidate.

        The fit of its start begins with the start that the last call found, so that its last digits depend on the calls
        before.
        """
        recording = self.recording
        span = self.span.scaled(candidate.length_ratio)
        cable, length, u = span.of_cable(candidate.cable), span.length, span.u
        grasps, held, positions, rates = [], [], [], []
        clamp, angles = 0, candidate.clamp_angles
        frames = []
        for h, path, (way, turns) in zip(self.holds, self.paths, self.ways, strict=True):
            at = float(np.clip(u[h.marker], 0.0, length))
            held.append((at, 0))
            positions.append(path.positions[0])
            rates.append(path.speed)
            kind: Literal["point", "tangent", "clamp"] = "point"
            if turns is not None:
                kind = "clamp" if candidate.twist else "tangent"
                reference = self.references[clamp]
                tangent = reference if angles is None else tilted(reference, angles[clamp])
                first, second = turns.apply(tangent)
                held.append((at, 1))
                positions.append(first)
                rates.append((second - first) / self.step_times[1])
                frames.append((turns[0].apply(across(reference)), first))
                clamp += 1
            grasps.append(Grasp(u=at, hold=kind, path=way))
        environment = replace(candidate.environment, gravity=recording.gravity)
        fit = start_fit(length, self.resolution.n_u, tuple(held))
        on = span.inside(self.seen)
        seen = self.seen[on]
        markers = self.start_markers[on] - self._beside_start(candidate, seen, self.start_markers[on])
        gravity = cast(Floats, environment.gravity)
        q = fit.shape(cable, gravity, u[seen], markers, np.array(positions), self._guess)
        self._guess = q
        v = None if self.at_rest else fit.velocity(q, u[seen], self.start_speeds[on], np.array(rates))
        shape = ControlPoints(
            control_points=q, knots=fit.grid.knots, velocity=v, settle=self.at_rest, strain=np.zeros(len(q))
        )
        if candidate.twist:
            shape = with_sections(shape, candidate.rest_curvature, candidate.turn, frames)
        switches: dict[str, Switch] = {"inertia": "on", "twist": "on" if candidate.twist else "off"}
        if candidate.twist and candidate.yields:
            switches["plasticity"] = "on"
        return Scene(
            cable=cable,
            shape=shape,
            grasps=tuple(grasps),
            environment=environment,
            horizon=self.horizon,
            effects=switches,
        )

    def posed(self, candidate: Candidate) -> tuple[Problem, Grid]:
        """Return the equations of the recorded motion for a candidate, and its grid.

        Raises:
            SceneError: no cable with these numbers can begin as the first frames show.
        """
        try:
            problem = pose(self.scene(candidate))
        except SceneError as error:
            times = cast(Floats, self.recording.times)
            last = self.compared[0] - 1
            given = f"the first frames of {self.recording.name!r}, {times[0]:.4g} to {times[last]:.4g} s"
            raise SceneError("markers", given, LIES_SO, no_such_cable(error)) from None
        return problem, start_grid(problem, self.resolution.n_u, Monitor(None, None, None))

    def play(self, candidate: Candidate, like: Played | None = None) -> Played:
        """Predict the recording with a candidate.

        Args:
            candidate: to predict it with.
            like: a replay with another candidate, whose equations are reused as far as they are the same.
        """
        problem, grid = self.posed(candidate) if like is None else self._posed_beside(like, candidate)
        motion = march(problem, grid, self.steps, Monitor(None, None, None))
        if motion.stopped:
            motion = march(problem, grid, 2 * self.steps, Monitor(None, None, None), rho=STRONGLY_DAMPED)
        predicted = self.positions(candidate, problem, grid, motion.times, motion.states)
        return Played(candidate, predicted, problem, grid, motion)

    def play_beside(self, played: Played, candidate: Candidate) -> Floats:
        """Return the predicted positions (frames, m, 3) [m] with a candidate that differs slightly.

        Raises:
            ValueError: the motion can't be followed from the played one.
        """
        problem, grid = self._posed_beside(played, candidate)
        states, times, _ = beside(played.known, problem, grid)
        return self.positions(candidate, problem, grid, times, states)

    def _posed_beside(self, played: Played, candidate: Candidate) -> tuple[Problem, Grid]:
        """Return the equations for a candidate near the played one, with the same grid if the start is the same."""
        problem = varied(played.problem, played.candidate, candidate)
        return self.posed(candidate) if problem is None else (problem, played.grid)

    def positions(self, candidate: Candidate, problem: Problem, grid: Grid, times: Floats, states: Floats) -> Floats:
        """Return the markers' positions (frames, m, 3) [m] at the compared frames of states (steps + 1, n_u, nc)."""
        B = self.span.scaled(problem.scene.cable.length / self.span.length).rows(grid.knots)
        q = problem.plane.world(states[..., : problem.plane.dimensions])
        x = np.ascontiguousarray(np.tensordot(B, q, axes=(1, 1)).swapaxes(0, 1))
        at = np.clip(np.rint(times / self.step_times[1]).astype(int), 0, self.steps)
        if candidate.marker_offsets is not None:
            x += self._beside(candidate.marker_offsets, grid, self._directors[at], q)
        for h, path in zip(self.holds, self.paths, strict=True):
            if h.towards is not None and not self.span.inside(np.array([h.towards]))[0]:  # on the gripper
                gap = candidate.length_ratio * (self.span.u[h.towards] - self.span.u[h.marker])
                x[:, h.towards] = path.positions[at] + gap * cast(Floats, path.directions)[at]
        t = np.clip(cast(Floats, self.recording.times)[self.compared] - self.begin, 0.0, self.horizon)
        return np.asarray(CubicSpline(times, x)(t))

    def _beside(self, offsets: Floats, grid: Grid, directors: Floats, q: Floats) -> Floats:
        """Return the offsets of the markers from the centreline (k, m, 3) [m] for shapes q (k, n_u, 3)."""
        length = float(grid.knots[-1])
        on = np.clip(self.span.u * (length / self.span.length), 0.0, length)
        ends = np.concatenate([[0.0], on])
        u = np.linspace(ends[:-1], ends[1:], _CARRIED + 1)[1:].T.ravel()  # the last of each _CARRIED is a marker
        tangents = unit(np.tensordot(design_matrix(grid.knots, u, 1), q, axes=(1, 1)))
        first = carried(tangents, directors)[_CARRIED - 1 :: _CARRIED]
        second = np.cross(tangents[_CARRIED - 1 :: _CARRIED], first)
        return np.asarray((offsets[:, :1] * first.swapaxes(0, 1)) + offsets[:, 1:] * second.swapaxes(0, 1))

    @cached_property
    def _directors(self) -> Floats:
        """Direction (steps + 1, 3) across the first clamp that turns with it."""
        directions = cast(Floats, self.paths[self.holds.index(self.clamps[0])].directions)
        return np.asarray(turned_from(self.references[0], directions).apply(across(self.references[0])))

    def _beside_start(self, candidate: Candidate, seen: NDArray[np.int64], markers: Floats) -> Floats:
        """Return the offsets of the seen markers (k, 3) from the centreline at the start, by their own polygon."""
        if candidate.marker_offsets is None:
            return np.zeros((len(seen), 3))
        tangents = unit(np.gradient(markers, self.span.u[seen], axis=0))
        first = carried(tangents, self._directors[0])
        offsets = candidate.marker_offsets[seen]
        return np.asarray(offsets[:, :1] * first + offsets[:, 1:] * np.cross(tangents, first))

    def differentiable(self, played: Played) -> bool:
        """Tell whether motions near the played one can be followed."""
        return not objection(played.problem, played.motion)


def no_such_cable(error: SceneError) -> str:
    """Return a message on why a cable can't lie as its markers show, without the fields of a shape made from them."""
    shaped = error.field.startswith("shape.")
    return f"A cable can't lie like that: {'it would be folded or stretched' if shaped else str(error).rstrip('.')}"


def common_references(recordings: Sequence[Recording]) -> Floats | None:
    """Return the mean direction of each clamp over recordings of one experiment (clamps, 3); None if they differ."""
    if len({(r.holds, cast(Floats, r.markers).shape[1]) for r in recordings}) != 1:
        return None
    found = []
    for h in recordings[0].holds:
        if h.towards is None:
            continue
        tracks = [cast(Floats, r.markers) for r in recordings]
        directions = [h.along(at[:, h.marker], at[:, h.towards]) for at in tracks]
        mean = np.nanmean(np.concatenate(directions), axis=0)
        found.append(mean / np.linalg.norm(mean))
    return np.array(found).reshape(-1, 3)
