"""Identify the parameters of a real cable from recordings of its motion or of its shapes at rest."""

from dlocore.identify.estimate import Estimated, Fit, Identification, Progress, identify
from dlocore.identify.replay import Candidate, Replay, Resolution

__all__ = ["Candidate", "Estimated", "Fit", "Identification", "Progress", "Replay", "Resolution", "identify"]
