"""Assembly of forces and tangents over the quadrature points: the only place that knows the sparsity.

Control points q are (n, nc): nc = 2 in the plane, 3 in space, 4 in space with twist. `axes` is the tuple (0, 1), (0, 1,
2) or (0, 1, 2, 3), so that the compiler knows nc and unrolls. A symmetric banded matrix is stored by column below its
diagonal, A[j, i - j], with the degree of freedom i * nc + d and the half-bandwidth 4 nc - 1.

`scales` = (stiffness, viscosity, geometric) selects a tangent. These are the factors of dF/dstrain, of dF/d(strain
rate) and of the part due to the current stress:

- (1, c, 1): the full tangent of a step where dv/dq = c
- (1, c, 0): its positive semidefinite part
- (0, 1, 0): the damping matrix alone
- (0, 0, 0): forces only
"""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import kernel, leaf, part
from dlocore.effects.laws import (
    BEND,
    CONTACT,
    DAMPING,
    FRICTION,
    QUADRATIC_DRAG,
    STRETCH_DAMPING,
    STRETCH_MEMORY,
    axial_memory,
)
from dlocore.kernels import contact, plane, space, twisted
from dlocore.kernels.banded import clear
from dlocore.kernels.basis import row_of
from dlocore.kernels.strain import space_curvature, squared_slope
from dlocore.kernels.twisted_rows import PAST

PAST_IN_PLANE, PAST_IN_SPACE = 2, 9  # columns of `History.past`, in the plane and in space without twist
MEMORY_IN_PLANE, MEMORY_IN_SPACE = 2, 6  # columns of `History.memory`
NO_RATES = (0.0, 0.0, 0.0, 0.0)  # `rates` of `assemble` where the strain rate comes from v and nothing yields


class History(NamedTuple):
    """State that earlier steps left behind, at the quadrature points.

    Attributes:
        memory: (points, 2 m) stress-free strain, and its value before anything yielded: m = 1 in the plane (curvature),
            3 in space (two curvatures of the sections and the twist rate) [1/m].
        past: (points, 2, 9 or 17) strain, and with twist frames, of the last steps: see `plane.remember`,
            `space.remember`, `twisted.py`; (0, ...) where no law reads it.
        axial: (axial points, 3) stress-free axial strain, and the axial strain of the last two steps.
        stick: (contact nodes, 3) anchors of friction [m]; (0, 3) without friction.
        slide: (lying points, 2) anchors of the friction of a cable that lies on the table [m]; (0, 2) without it.
        pressing: (contact nodes,) weights [m] of contact at its nodes, zero where another node stands for this one.
        tension: (axial points, 4) what the tangent of a march knows of the tension, see `tension.py`; (0, 4) elsewhere.
        room: workspace of assemblies in space, where nothing is kept: `ROOM` numbers in `space` or `twisted_rows`, and
            `ROOM_OF_POINT` for each point; (0,) in the plane. A kernel that releases the GIL needs a workspace of its
            own.
    """

    memory: Any
    past: Any
    axial: Any
    stick: Any
    slide: Any
    pressing: Any
    tension: Any
    room: Any


@kernel
def history_at(histories: Any, k: int) -> Any:
    """Return the `History` of time k from one whose arrays hold one or more times (1 or more, ...)."""
    at = min(k, len(histories.memory) - 1)
    h = histories
    axial = h.axial[min(k, len(h.axial) - 1)]
    return History(h.memory[at], h.past[at], axial, h.stick, h.slide, h.pressing, h.tension, h.room)


@leaf
def assemble(
    axes: Any, q: Any, v: Any, tables: Any, active: Any, p: Any, history: Any, rates: Any, scales: Any, f: Any, K: Any
) -> None:
    """Write internal forces minus body forces f (n, nc) [N] and their tangent K (n nc, 4 nc) [N/m].

    Args:
        axes: (0, 1), (0, 1, 2) or (0, 1, 2, 3).
        q, v: control points and their velocities (n, nc) [m, m/s].
        tables: `basis.Tables`.
        active: switches of the laws (laws.COUNT,).
        p: parameters of the laws, and obstacles (laws.COUNT + obstacles, laws.PARAMETERS).
        history: `History`.
        rates: (now, last, before, h): coefficients that give the rate of a strain from its values now and at the last
            two steps, and the time step in which strain yields. Zeros: the rate comes from v, and nothing yields.
        scales: (stiffness, viscosity, geometric) factors of the tangent.
        f, K: outputs; K is untouched where all scales are zero.
    """
    points = tables.curvature
    tangent = scales[0] != 0.0 or scales[1] != 0.0
    clear(f)
    if tangent:
        clear(K)
    bends = active[BEND] or active[DAMPING]
    if len(axes) == 2:
        plane.axial(q, v, tables.axial, active, p, history.axial, history.tension, rates, scales, tangent, f, K)
        if bends:
            plane.curvature(q, v, points, active, p, history.memory, history.past, rates, scales, tangent, f, K)
        if active[QUADRATIC_DRAG]:
            plane.body(q, v, points, active, p, scales, tangent, f, K)
    else:
        past, tension = history.axial, history.tension
        space.axial(len(axes), q, v, tables.axial, active, p, past, tension, rates, scales, tangent, f, K)
        if len(axes) == 4:
            memory, room = history.memory, history.room
            twisted.curvature(q, v, points, active, p, memory, history.past, rates, scales, tangent, room, f, K)
        elif bends:
            space.curvature(q, v, points, active, p, history.past, rates, scales, tangent, history.room, f, K)
        if active[QUADRATIC_DRAG]:
            space.body(len(axes), q, v, points, active, p, scales, tangent, f, K)
    if active[CONTACT]:
        contact.contact(
            len(axes), q, v, tables.contact, active, p, history.stick, history.pressing, rates[3], scales, tangent, f, K
        )
    if active[FRICTION] and p[FRICTION, 2] > 0.0:
        contact.lying(len(axes), q, v, tables.lying, p, history.slide, rates[3], scales, tangent, f, K)


@part
def remember(axes: Any, q: Any, tables: Any, active: Any, p: Any, history: Any, h: float, loose: bool) -> float:
    """Record in `history` the strain of q (n, nc) as that of the last step, and what yielded and slipped in that step.

    The step has the length h; with h = 0 nothing yields. `loose` places the anchors of friction at the cable, as at the
    start.

    Returns:
        the largest depth of the cable in an obstacle or the table [m].
    """
    deepest = 0.0
    if active[CONTACT]:
        deepest = contact.remember(len(axes), q, tables.contact, p, history.stick, history.pressing, loose)
    if active[FRICTION] and p[FRICTION, 2] > 0.0:
        contact.drag_anchors(len(axes), q, tables.lying, p, history.slide, loose)
    if active[STRETCH_MEMORY] or active[STRETCH_DAMPING]:
        for n in range(len(tables.axial.w)):
            slope = squared_slope(q, tables.axial.first[n], row_of(tables.axial.b1, n), min(len(axes), 3))
            strain = np.sqrt(slope) - 1.0
            kept, share = history.axial[n, 0], tables.axial.share[n]
            free, _ = axial_memory(active, p, strain, kept, history.axial[n, 1], h, share)
            history.axial[n, 0] = free
            history.axial[n, 2] = history.axial[n, 1]
            history.axial[n, 1] = strain
    if len(history.past) == 0:
        return deepest
    if len(axes) == 2:
        plane.remember(q, tables.curvature, active, p, history.memory, history.past, h)
    elif len(axes) == 3:
        space.remember(q, tables.curvature, history.past, history.room)
    else:
        twisted.remember(q, tables.curvature, active, p, history.memory, history.past, h, history.room)
    return deepest


@leaf
def note(axes: Any, history: Any, out: Any) -> None:
    """Write to out (points, columns) the memory, preceded in space with twist by the frames.

    Rows beyond the curvature points hold the stress-free axial strain in their first column.
    """
    frames = PAST if len(axes) == 4 else 0
    points = len(history.memory)
    for n in range(points, len(out)):
        out[n, 0] = history.axial[n - points, 0]
    for n in range(points):
        for d in range(frames):
            out[n, d] = history.past[n, d]
        for d in range(out.shape[1] - frames):
            out[n, frames + d] = history.memory[n, d]


@leaf
def stored_energy(axes: Any, q: Any, tables: Any, active: Any, p: Any, history: Any) -> float:
    """Return the elastic energy [J] of the control points q (n, nc)."""
    if len(axes) == 2:
        return plane.energy(q, tables, active, p, history.memory, history.axial)
    total = space.axial_energies(q, tables.axial, active, p, history.axial)
    if len(axes) == 4:
        return total + twisted.energy(q, tables.curvature, active, p, history.memory, history.past)
    return total + space.energy(q, tables.curvature, active, p)


@leaf
def contact_energy(axes: Any, q: Any, tables: Any, active: Any, p: Any) -> float:
    """Return the potential of contact [J] at the control points q (n, nc)."""
    return contact.energy(len(axes), q, tables.contact, active, p) if active[CONTACT] else 0.0


@leaf
def slopes(states: Any, every: int, first: Any, b1: Any) -> tuple[float, float]:
    """Return the smallest and the largest |r'| over every `every`-th of the states (k, n, nc).

    The points are given by the derivatives b1 (points, 4) of the basis functions from control point `first` (points,)
    on.
    """
    least, largest = np.inf, 0.0
    for s in range(0, len(states), every):
        for n in range(len(first)):
            square = squared_slope(states[s], first[n], row_of(b1, n), min(states.shape[2], 3))
            least, largest = min(least, square), max(largest, square)
    return np.sqrt(least), np.sqrt(largest)


@leaf
def largest_curvature(axes: Any, states: Any, points: Any, memory: Any) -> float:
    """Return the largest |kappa - kappa_0| [1/m] at the curvature points over the states (k, n, nc).

    In space without twist the stress-free shape is straight. With twist, kappa_0 is left out.
    """
    largest = 0.0
    for s in range(len(states)):
        for n in range(len(points.w)):
            k = points.first[n]
            if len(axes) == 2:
                kappa = plane.curvature_at(states[s], points, n) - memory[n, 0]
                largest = max(largest, abs(kappa))
            else:
                a = space.combine(states[s], k, row_of(points.b1, n))
                bend = space_curvature(a, space.combine(states[s], k, row_of(points.b2, n)))[3]
                largest = max(largest, np.sqrt(bend[0] * bend[0] + bend[1] * bend[1] + bend[2] * bend[2]))
    return largest


@leaf
def multiply_scalar_band(band: Any, x: Any, scale: float, out: Any) -> None:
    """Add scale * B x to out (n, nc) for the symmetric banded B (n, 4), which is the same for every coordinate."""
    n, nc = x.shape
    for i in range(n):
        for d in range(nc):
            out[i, d] += scale * band[i, 0] * x[i, d]
        for o in range(1, min(4, n - i)):
            factor = scale * band[i, o]
            for d in range(nc):
                out[i, d] += factor * x[i + o, d]
                out[i + o, d] += factor * x[i, d]


@kernel
def times_scalar_band(band: Any, x: Any) -> Any:
    """Return B x (n, nc) for the symmetric banded B (n, 4), which is the same for every coordinate."""
    out = np.zeros_like(x)
    multiply_scalar_band(band, x, 1.0, out)
    return out


@leaf
def add_scalar_band(nc: int, band: Any, scale: float, K: Any) -> None:
    """Add scale * B to K (n nc, 4 nc) for the symmetric banded B (n, 4), which is the same for every coordinate."""
    for i in range(len(band)):
        for o in range(min(4, len(band) - i)):
            factor = scale * band[i, o]
            for d in range(nc):
                K[i * nc + d, o * nc] += factor
