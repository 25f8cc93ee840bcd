"""Data of the compiled equations of a rod: its constants over a stretch of time, and its state."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# places of numbers in `Body.law`
EA, EI, GJ, BEND_DAMPING, TWIST_DAMPING, DRAG, DRAG_QUADRATIC = range(7)
YIELD_BEND, YIELD_TWIST, YIELD_STRETCH, MEMORY_RATE, SOFTENED = range(7, 12)
RADIUS, STIFFNESS, PASSAGE, CONTACT_DAMPING, STICK, LYING, GYRATION, DENSITY, AXIAL_DAMPING = range(12, 21)
LAWS = 21

REAL, DIRECTION, CLAMP = range(3)  # kinds of edges: part of the cable, or the direction that a gripper holds


class Body(NamedTuple):
    """A chain of n nodes and n - 1 edges, with a hinge at each inner node.

    A held direction is an edge without length between two nodes in one place; `fixed` marks what a gripper prescribes.
    The fourth coordinate of node i is the spin of edge i about its tangent.

    Attributes:
        dims: coordinates of a node, 2 in the plane and 4 in space.
        rest: lengths of the unstrained edges (n - 1,) [m], 0 for a held direction.
        kind: REAL, DIRECTION or CLAMP (n - 1,).
        fixed: whether a coordinate is prescribed or absent (n, 4).
        mass: of the coordinates (n, 4) [kg, kg, kg, kg m^2].
        cell: length of cable that a node stands for (n,) [m].
        weight: (n, 3) [N].
        width: length of cable that a hinge stands for (n - 2,) [m].
        natural: bends and twist rate of the stress-free cable (n - 2, 3) [1/m, 1/m, rad/m].
        law: coefficients of the laws, see the places above.
        point_edge, point_along, point_length: points that may touch surfaces: edge, fraction along it, and length of
            cable (p,) [m].
        point_lies: whether the table carries the cable there (p,), with the friction `LYING` per length.
        surfaces: (m, surface.ROW).
    """

    dims: int
    rest: Floats
    kind: Integers
    fixed: NDArray[np.bool_]
    mass: Floats
    cell: Floats
    weight: Floats
    width: Floats
    natural: Floats
    law: Floats
    point_edge: Integers
    point_along: Floats
    point_length: Floats
    point_lies: NDArray[np.bool_]
    surfaces: Floats


class State(NamedTuple):
    """The state of a chain.

    Attributes:
        q: positions [m] and spin since the step began [rad] (n, 4).
        v: their rates (n, 4).
        t, a: unit tangents and directors of the edges (n - 1, 3).
        turn: twist of the hinges (n - 2,) [rad], full turns included.
        memory: strain about which a hinge is elastic (n - 2, 3) [1/m, 1/m, rad/m].
        axial: strain about which an edge is elastic (n - 1,).
        anchor: displacement of each point in contact from its anchor (p, 3) [m].
    """

    q: Floats
    v: Floats
    t: Floats
    a: Floats
    turn: Floats
    memory: Floats
    axial: Floats
    anchor: Floats


class Guide(NamedTuple):
    """What grippers and loads prescribe at the s stages of a step.

    Attributes:
        nodes: held nodes (k,); position and velocity: (s, k, 3).
        edges: held directions (j,).
        tangent, director, tangent_rate: of held directions (s, j, 3); only clamps use the director.
        spin: of clamps about the tangent (s, j) [rad/s].
        load: forces (s, n, 3) [N], without weight.
    """

    nodes: Integers
    position: Floats
    velocity: Floats
    edges: Integers
    tangent: Floats
    director: Floats
    tangent_rate: Floats
    spin: Floats
    load: Floats


class Tableau(NamedTuple):
    """A diagonally implicit Runge-Kutta method: coefficients (s, s), times (s,), weights of the error estimate (s,).

    It is stiffly accurate: the last stage is the end of the step.
    """

    coefficients: Floats
    times: Floats
    error: Floats
    order: int
