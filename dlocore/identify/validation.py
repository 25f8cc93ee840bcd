"""Validation against measurements: parameters are fitted on some windows of a set, and the others are predicted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import process_time
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dlocore.compiling.interrupts import interruptible
from dlocore.identify.candidate import Candidate
from dlocore.identify.datasets import HangingWire, MovedCable
from dlocore.identify.estimate import identify
from dlocore.identify.identification import Identification
from dlocore.identify.replay import Replay, Resolution, common_references
from dlocore.recordings import Recording
from dlocore.scene.scene import Environment

Floats = NDArray[np.float64]
Model = Literal["scalars", "bends"]

PROTOCOL = Resolution(n_u=11, step=0.01, start_frames=2)  # state from frames 0 and 1, then open loop
SCALARS = ("bending_stiffness", "drag", "bending_damping", "length_ratio")
BENDS = (*SCALARS, "drag_quadratic", "clamp_angles", "marker_offsets", "turn", "torsional_stiffness", "rest_curvature")
WIRE_GRID = 33  # control points along a wire


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedWindow:
    """One window predicted open loop.

    Attributes:
        name: of the window.
        l1: mean |dx| over frames, all markers (the held ones included) and coordinates [m].
        distance: mean distance of a free marker from its prediction [m].
        seconds: processor time of the prediction.
        recorded: predicted time [s].
        stalled: the prediction ended before the window.
        over_time: mean distance of the free markers at each frame (k,) [m].
    """

    name: str
    l1: float
    distance: float
    seconds: float
    recorded: float
    stalled: bool
    over_time: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class CableValidation:
    """A cable fitted on some windows and tested on others."""

    name: str
    model: Model
    found: Identification
    windows: tuple[PredictedWindow, ...]
    seconds: float

    @property
    def l1(self) -> Floats:
        """L1 of the windows (k,) [m]."""
        return np.array([w.l1 for w in self.windows])


@dataclass(frozen=True, kw_only=True, eq=False)
class WireValidation:
    """A hanging wire fitted with some parameters: rms distance of each repeat (k,) [m]."""

    name: str
    names: tuple[str, ...]
    found: Identification
    rms: Floats


def validate_cable(
    cable: MovedCable,
    model: Model = "scalars",
    start: Candidate | None = None,
) -> CableValidation:
    """Fit a cable on the windows for that, and predict the others.

    Args:
        cable: windows of one cable.
        model: "scalars": EI, drag, bending damping, length; "bends": also how the cable leaves its clamps, the offsets
            of the markers, its rest curvature, and the twist that these need.
        start: a candidate to begin with.
    """
    began = process_time()
    names = SCALARS if model == "scalars" else BENDS
    found = identify(cable.fit, names=names, start=start, resolution=PROTOCOL)
    fitted = process_time() - began
    references = common_references(cable.fit)
    windows = tuple(predicted(w, found.candidate, references) for w in cable.test)
    return CableValidation(name=cable.name, model=model, found=found, windows=windows, seconds=fitted)


@interruptible
def predicted(recording: Recording, candidate: Candidate, references: Floats | None) -> PredictedWindow:
    """Predict a window open loop, from its first two frames."""
    replay = Replay(recording, PROTOCOL, references)
    began = process_time()
    played = replay.play(candidate)
    seconds = process_time() - began
    away = played.predicted - replay.markers
    over_time = np.nanmean(np.linalg.norm(away[:, recording.free], axis=2), axis=1)
    return PredictedWindow(
        name=recording.name,
        l1=float(np.nanmean(np.abs(away))),
        distance=float(np.nanmean(over_time)),
        seconds=seconds,
        recorded=replay.horizon,
        stalled=played.stopped,
        over_time=over_time,
    )


def validate_wire(wire: HangingWire, names: Sequence[str]) -> WireValidation:
    """Fit the hanging shapes of a wire."""
    found = identify(
        [wire.recording], environment=Environment(), names=tuple(names), resolution=Resolution(n_u=WIRE_GRID)
    )
    distances = np.concatenate([fit.distances for fit in found.fits])
    return WireValidation(name=wire.name, names=tuple(names), found=found, rms=np.sqrt((distances**2).mean(axis=1)))


def each_repeat(wire: HangingWire) -> Floats:
    """Return the rms distance (k,) [m] of each repeat when stiffness and clamps are fitted on that repeat alone."""
    whole, out = wire.recording, []
    for shape in np.asarray(whole.markers):
        alone = replace(whole, times=[0.0], markers=shape[None])
        found = identify(
            [alone],
            environment=Environment(),
            names=("bending_stiffness", "clamp_angles"),
            resolution=Resolution(n_u=WIRE_GRID),
        )
        out.append(np.sqrt((found.fits[0].distances ** 2).mean()))
    return np.array(out)
