"""Identify the parameters of a real cable from recordings of its motion or of its shapes at rest."""

from dlocore.identify.candidate import Candidate
from dlocore.identify.estimate import identify
from dlocore.identify.identification import Estimated, Fit, Identification, Progress
from dlocore.identify.replay import Replay, Resolution

__all__ = ["Candidate", "Estimated", "Fit", "Identification", "Progress", "Replay", "Resolution", "identify"]
