"""Scenes of all kinds that cables are handled in, by name: what the choice of effects is measured on.

They are deterministic, small (mostly 3 s at most) and such as a robot meets them: sliding, lifting, hanging, threading
around pegs, laying down, unwinding. Units are SI, z is up.
"""

from benchmarks.catalogue import in_space, in_the_plane, touching
from benchmarks.premises import Premise
from dlocore import Scene

FILES = (in_the_plane, in_space, touching)


def catalogue() -> dict[str, Scene]:
    """Return every scene by name, in the order of their files."""
    return {name: scene for file in FILES for name, scene in file.entry.scenes().items()}


def premises() -> dict[str, tuple[Premise, ...]]:
    """Return what has to happen in the scenes whose names promise something, by name."""
    return {name: kept for file in FILES for name, kept in file.entry.premises.items()}
