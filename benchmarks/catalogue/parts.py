"""What the scenes of the catalogue are made of."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlocore import (
    Cable,
    Cylinder,
    Environment,
    Move,
    Table,
)

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

WEIGHTLESS: Vector = (0.0, 0.0, 0.0)


def cord(**changes: Any) -> Cable:
    """Return a limp cord, 1 m long and 5 mm thick, with the given fields replaced."""
    values = {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3}
    return Cable(**(values | changes))


def move(x: float, y: float, z: float = 0.0, *, time: float, **changes: Any) -> Move:
    return Move(displacement=(x, y, z), duration=time, **changes)


def on_table(friction: float, *, drag: float = 0.02, **changes: Any) -> Environment:
    return Environment(drag=drag, table=Table(friction=friction), **changes)


def hanging(*, drag: float = 0.05, **changes: Any) -> Environment:
    return Environment(drag=drag, **changes)


def wave(length: float, height: float, turns: float) -> Floats:
    """Return points (k, 2) [m] of a sine of the given number of turns whose arclength is `length` [m]."""
    width = length
    for _ in range(50):
        x = np.linspace(0.0, width, 201)
        y = height * np.sin(2 * np.pi * turns * x / width)
        width *= length / float(np.hypot(np.diff(x), np.diff(y)).sum())
    x = np.linspace(0.0, width, 61)
    return np.column_stack([x, height * np.sin(2 * np.pi * turns * x / width)])


def bow(length: float, angle: float) -> Floats:
    """Return points (61, 2) [m] of an arc from the origin that begins along x and turns left by `angle` [rad]."""
    phi = np.linspace(0.0, angle, 61)
    return length / angle * np.column_stack([np.sin(phi), 1.0 - np.cos(phi)])


def sagging(length: float, span: float) -> Floats:
    """Return points (61, 3) [m] of an arc in the x-z plane that hangs between two points of the x-axis."""
    low, high = 1e-3, np.pi - 1e-3  # half of the angle: sin(a)/a = span/length
    for _ in range(60):
        a = 0.5 * (low + high)
        low, high = (a, high) if np.sin(a) / a > span / length else (low, a)
    phi = np.linspace(-a, a, 61)
    radius = length / (2 * a)
    x, z = radius * np.sin(phi), radius * (np.cos(a) - np.cos(phi))
    return np.column_stack([x - x[0], 0 * x, z])


def pegs(*places: tuple[float, float], radius: float = 0.015, friction: float = 0.2) -> tuple[Cylinder, ...]:
    return tuple(Cylinder(center=(x, y, 0.0), radius=radius, height=0.1, friction=friction) for x, y in places)
