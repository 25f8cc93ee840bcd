"""A recording in the scene: the shown window as a scene, and the distance of a prediction from it."""

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from app.schemas.describe import from_cable
from app.viewer.draft import Draft
from app.viewer.rounding import listed, rounded
from dlocore import Environment, Prediction, SceneError, Waypoints
from dlocore.identify import Candidate, Replay, Resolution
from dlocore.identify.estimate import WINDOW, cable_of
from dlocore.identify.windows import cut
from dlocore.recordings import Recording, load_recording
from dlocore.scene.scene import ControlPoints

Floats = NDArray[np.float64]
LARGEST = 20_000_000  # bytes, of a file and of each of its arrays
MOST_WINDOWS = 8  # most windows that identification uses; further ones are only shown
STEP = 0.02  # s between the grippers' waypoints in the document
POINTS_IN_SECOND = 25  # control points in time for each second: enough for a cable that swings at 3 Hz
MOST_IN_TIME = 129
N_U = 13
DIGITS = 7  # of points in the document: to 10⁻⁷ m, finer than tracking can measure


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracked:
    """A recording, cut into windows, of which one is shown.

    Attributes:
        windows: windows of about 5 s.
        candidate: what is known about the cable, or was identified.
        shown: index of the shown window.
        replays: replays of windows by their indices, each made when it is first needed.
    """

    windows: tuple[Recording, ...]
    candidate: Candidate
    shown: int = 0
    replays: dict[int, Replay] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(recording: Recording) -> "Tracked":
        """Return a recording that was just opened, cut into windows.

        Raises:
            SceneError: it contains shapes at rest, which have no motion to show.
        """
        if recording.static:
            raise SceneError("static", True, "a recording of a motion", "Shapes at rest have no motion to show")
        candidate = Candidate(cable=cable_of([recording]), environment=Environment(drag=0.05))
        return Tracked(windows=tuple(cut([recording], WINDOW)), candidate=candidate)

    @property
    def recording(self) -> Recording:
        """The shown window."""
        return self.windows[self.shown]

    def draft(self) -> Draft:
        """Return the scene of the shown window: its start, its grippers' paths, and the cable as far as known."""
        scene = self._replay.scene(self.candidate)
        shape, cable, surroundings = cast(ControlPoints, scene.shape), scene.cable, scene.environment
        start: dict[str, Any] = {
            "kind": "control_points",
            "control_points": listed(shape.control_points, DIGITS),
            "knots": np.asarray(shape.knots).tolist(),
            "settle": shape.settle,
        }
        if shape.velocity is not None:
            velocity = listed(shape.velocity, DIGITS)
            start["velocity"] = {"kind": "control_points", "control_points": velocity}
        return Draft.of(
            {
                "name": self.recording.name[:200],
                "cable": _to_nine_digits(from_cable(cable)),
                "shape": start,
                "primitives": [
                    {"u": grasp.u, "hold": grasp.hold, "path": _path(cast(Waypoints, grasp.path))}
                    for grasp in scene.grasps
                ],
                "environment": {
                    "gravity": np.asarray(surroundings.gravity).tolist(),
                    "drag": rounded(surroundings.drag, 6),
                    "drag_quadratic": rounded(surroundings.drag_quadratic, 6),
                    "table": None,
                },
                "horizon": self._replay.horizon,
                "effects": {"twist": "off"},
                "quality": {
                    "n_u": N_U,
                    "n_t": min(MOST_IN_TIME, 13 + round(POINTS_IN_SECOND * self._replay.horizon)),
                    "method": "march",
                    "keep_grid": True,  # the cable was identified on this grid
                },
            }
        )

    def edited(self, draft: Draft) -> "Tracked":
        """Return the recording with the cable and the drag as edited in its scene.

        Raises:
            SceneError: the edited values are not valid, or the cable yields: a search in the scene is without twist.
        """
        if draft.cable().yields:
            raise SceneError("cable", "a cable that yields", "an elastic one (the scene identifies no other)")
        cable, given = self._replay.span.to_whole(draft.cable()), draft.request().environment
        drag = replace(self.candidate.environment, drag=given.drag, drag_quadratic=given.drag_quadratic)
        return replace(self, candidate=replace(self.candidate, cable=cable, environment=drag))

    def markers_at(self, time: float) -> Floats:
        """Return the markers seen in the frame nearest to a time [s] of the scene, (k, 3) [m]."""
        x = cast(Floats, self.recording.markers)[int(np.argmin(np.abs(self.times - time)))]
        return x[np.isfinite(x[:, 0])]

    @property
    def times(self) -> Floats:
        """The frames' times in the scene (k,) [s]."""
        return np.asarray(cast(Floats, self.recording.times) - self._replay.begin)

    @property
    def _replay(self) -> Replay:
        if self.shown not in self.replays:
            self.replays[self.shown] = Replay(self.recording, Resolution(n_u=N_U, step=STEP))
        return self.replays[self.shown]

    def distances(self, prediction: Prediction) -> Floats:
        """Return the median distance of the free markers from a prediction at every frame (k,) [m]; NaN if unknown."""
        recording, surface, span = self.recording, prediction.surface, self._replay.span
        u = np.clip(span.u[recording.free] * (surface.length / span.length), 0.0, surface.length)
        away = surface.positions(u, np.clip(self.times, 0.0, surface.horizon))[..., :3]
        away = np.linalg.norm(away - cast(Floats, recording.markers)[:, recording.free], axis=2)
        away[(self.times < 0.0) | (self.times > surface.horizon)] = np.nan
        seen = np.isfinite(away).any(axis=1)
        out = np.full(len(away), np.nan)
        out[seen] = np.nanmedian(away[seen], axis=1)
        return out


def opened(name: str, content: bytes, beside: dict[str, bytes]) -> Tracked:
    """Return the recording in a file; `beside` holds files uploaded before it (a .csv needs the .json of its name).

    Raises:
        SceneError: the file is too large, or not a valid recording.
    """
    if len(content) > LARGEST:
        raise SceneError("file", f"{len(content)} bytes", f"at most {LARGEST} bytes")
    with tempfile.TemporaryDirectory() as folder:
        for file, bytes_of in {**beside, name: content}.items():
            (Path(folder) / Path(file).name).write_bytes(bytes_of)
        return Tracked.of(load_recording(Path(folder) / Path(name).name, largest=LARGEST))


def _path(path: Waypoints) -> dict[str, Any]:
    found: dict[str, Any] = {
        "kind": "waypoints",
        "times": listed(path.times, 9),
        "positions": listed(path.positions, DIGITS),
        "start": path.start,
    }
    if path.orientations is not None:
        found["orientations"] = listed(path.orientations, 9)
    return found


def _to_nine_digits(part: Any) -> Any:
    """Return a part of the document with its numbers rounded to nine digits."""
    if isinstance(part, dict):
        return {name: _to_nine_digits(value) for name, value in part.items()}
    if isinstance(part, list):
        return [_to_nine_digits(value) for value in part]
    return rounded(part) if isinstance(part, float) else part
