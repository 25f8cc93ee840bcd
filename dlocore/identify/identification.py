"""The result of an identification: values with intervals, the recordings they rest on, and progress reports."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dlocore.identify.candidate import Candidate, resized
from dlocore.scene.cable import Cable
from dlocore.scene.scene import Environment

Floats = NDArray[np.float64]

Status = Literal["converged", "max_iterations"]


@dataclass(frozen=True, kw_only=True)
class Estimated:
    """An identified parameter.

    Attributes:
        name, unit: of the parameter.
        value: [unit]; if it is not identifiable, the assumed value.
        low, high: 95 % interval [unit].
        identifiable: whether the data determine it.
        statement: the result in words.
        rests_on: by recording, its share in what is known of the parameter.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    identifiable: bool
    statement: str
    rests_on: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """How well the window of a recording is fitted.

    Attributes:
        name: of the recording.
        begin, end: of the window in it [s].
        static: its frames are shapes at rest, which `times` only number.
        gravity: as recorded (3,) [m/s^2].
        times: of the compared frames in it (k,) [s].
        measured, predicted: (k, m, 3) [m].
        free: the markers that nothing holds.
        stalled: whether the prediction stopped before the end.
    """

    name: str
    begin: float
    end: float
    static: bool
    gravity: Floats
    times: Floats
    measured: Floats
    predicted: Floats
    free: NDArray[np.int64]
    stalled: bool

    @property
    def distances(self) -> Floats:
        """Distance of each free marker from its prediction (k, free) [m]; NaN if the marker was lost."""
        away = self.measured[:, self.free] - self.predicted[:, self.free]
        return np.asarray(np.linalg.norm(away, axis=2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Identification:
    """The result of an identification.

    Attributes:
        status: "converged" or "max_iterations".
        message: the result in words, including what could not be identified.
        candidate: everything that was found, to replay with.
        parameters: as requested, with intervals.
        correlations: between the identified parameters, (n, n), in the order of `parameters`; NaN for others.
        rest_shape: points (k, 3) [m] of the stress-free shape that was found, as it would lie if the first clamp were
            held as on average in the recordings; None: none was sought, straight.
        fits: how well each window is fitted.
        deviation: robust standard deviation of a coordinate of the residuals [m].
        iterations: of Gauss-Newton.
        seconds: time taken.
    """

    status: Status
    message: str
    candidate: Candidate
    parameters: tuple[Estimated, ...]
    correlations: Floats
    rest_shape: Floats | None
    fits: tuple[Fit, ...]
    deviation: float
    iterations: int
    seconds: float

    @property
    def cable(self) -> Cable:
        """The cable for use in scenes, with the length and the stress-free shape that were found."""
        found = self.candidate.cable
        cable = resized(found, found.length * self.candidate.length_ratio)
        return cable if self.rest_shape is None else replace(cable, rest_shape=self.rest_shape)

    @property
    def environment(self) -> Environment:
        """The drag found, with the gravity of the first recording."""
        return self.candidate.environment


@dataclass(frozen=True, kw_only=True)
class Progress:
    """One iteration: its number, the median distance of the free markers [m], and the values by name."""

    iteration: int
    distance: float
    values: dict[str, float]
