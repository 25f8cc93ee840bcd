"""Shapes at rest as recordings: every frame is an equilibrium under the cable's weight, held as its markers show."""

from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.identify.candidate import Candidate
from dlocore.identify.frames import across, tilted, turned_from, with_sections
from dlocore.identify.replay import LIES_SO, Resolution, no_such_cable
from dlocore.identify.span import Span
from dlocore.identify.start import start_fit
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.recordings import Recording
from dlocore.scene.scene import ControlPoints, Grasp, Scene, Switch
from dlocore.solvers.monitor import Monitor
from dlocore.statics.settling import settle

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Settled:
    """Shapes at rest: positions of all markers in every frame (frames, m, 3) [m], and whether each came to rest."""

    predicted: Floats
    stopped: bool


class Rest:
    """Settles the shapes of one recording with any candidate.

    Args:
        recording: of shapes at rest, with every held marker seen in every frame.
        resolution: its n_u.
        references: direction of each clamp about which its frame is chosen (clamps, 3); None: its mean.
    """

    def __init__(self, recording: Recording, resolution: Resolution, references: Floats | None = None) -> None:
        if not recording.holds:
            raise SceneError("held", recording.held, "at least one held marker", "Nothing holds the cable")
        self.recording, self.resolution = recording, resolution
        self.markers = cast(Floats, recording.markers)
        self.compared = np.arange(len(self.markers))
        held = self.markers[:, list(recording.held)]
        if not np.isfinite(held).all():
            frame = int(np.argwhere(~np.isfinite(held))[0, 0])
            raise SceneError(f"markers[{frame}]", "a lost held marker", "held markers seen in every shape at rest")
        self.holds, self.span = recording.holds, Span.of(recording)
        self.references = self._directions().mean(axis=0) if references is None else references

    def _directions(self) -> Floats:
        """Return the unit directions of the clamps (frames, clamps, 3)."""
        at = self.markers
        found = [h.along(at[:, h.marker], at[:, h.towards]) for h in self.holds if h.towards is not None]
        return np.stack(found, axis=1) if found else np.zeros((len(self.markers), 0, 3))

    def play(self, candidate: Candidate) -> Settled:
        """Settle every shape with a candidate.

        Raises:
            SceneError: no cable with these numbers can lie as the markers of a shape show.
        """
        shapes, stopped = [], False
        for frame in range(len(self.markers)):
            scene = self.scene(candidate, frame)
            try:
                problem = pose(scene)
            except SceneError as error:
                raise SceneError(f"markers[{frame}]", "a shape at rest", LIES_SO, no_such_cable(error)) from None
            grid = make_grid(problem, self.resolution.n_u)
            found = settle(problem, grid, 0.0, Monitor(None, None, None))
            stopped |= found.rest != "settled"
            shapes.append(self.span.scaled(candidate.length_ratio).rows(grid.knots) @ problem.world(found.q)[:, :3])
        return Settled(np.array(shapes), stopped)

    def scene(self, candidate: Candidate, frame: int) -> Scene:
        """Return the scene of one shape for a candidate."""
        span = self.span.scaled(candidate.length_ratio)
        length, u = span.length, span.u
        directions = self._directions()[frame]
        grasps, held, targets, frames, clamp = [], [], [], [], 0
        for h in self.holds:
            at = float(np.clip(u[h.marker], 0.0, length))
            kind: Literal["point", "tangent", "clamp"] = "point"
            held.append((at, 0))
            targets.append(self.markers[frame, h.marker])
            if h.towards is not None:
                kind = "clamp" if candidate.twist else "tangent"
                turn = turned_from(self.references[clamp], directions[clamp : clamp + 1])[0]
                angles = candidate.clamp_angles
                reference = self.references[clamp]
                held.append((at, 1))
                targets.append(turn.apply(reference if angles is None else tilted(reference, angles[clamp])))
                frames.append((turn.apply(across(reference)), targets[-1]))
                clamp += 1
            grasps.append(Grasp(u=at, hold=kind))
        cable = span.of_cable(candidate.cable)
        environment = replace(candidate.environment, gravity=self.recording.gravity)
        seen = np.flatnonzero(np.isfinite(self.markers[frame, :, 0]))
        seen = seen[span.inside(seen)]
        fit = start_fit(length, self.resolution.n_u, tuple(held))
        gravity = cast(Floats, environment.gravity)
        q = fit.shape(cable, gravity, u[seen], self.markers[frame, seen], np.array(targets))
        shape = ControlPoints(control_points=q, knots=fit.grid.knots, strain=np.zeros(len(q)))
        if candidate.twist:
            shape = with_sections(shape, candidate.rest_curvature, candidate.turn, frames)
        switches: dict[str, Switch] = {"twist": "on" if candidate.twist else "off"}
        return Scene(
            cable=cable, shape=shape, grasps=tuple(grasps), environment=environment, horizon=1.0, effects=switches
        )
