"""The energies of a rod: of its motion and of its strains."""

from typing import Any

import numpy as np

from dlocore.reference.body import EA, EI, GJ, REAL, SOFTENED
from dlocore.reference.compile import compiled
from dlocore.reference.hinge import cross, strains


@compiled
def energies(body: Any, state: Any) -> tuple[float, float, float, float]:
    """Return the kinetic energy and the energies of stretch, bend and twist [J] of a state at the end of a step."""
    kinetic = stretch = bend = twist = 0.0
    n = len(body.rest) + 1
    b = np.empty((n - 1, 3))
    s = np.empty(3)
    law = body.law
    for k in range(n):
        for d in range(4):
            kinetic += 0.5 * body.mass[k, d] * state.v[k, d] ** 2
    for e in range(n - 1):
        cross(state.t[e], state.a[e], b[e])
        if body.kind[e] == REAL:
            length = 0.0
            for d in range(3):
                length += (state.q[e + 1, d] - state.q[e, d]) ** 2
            strain = np.sqrt(length) / body.rest[e] - 1.0 - law[SOFTENED] * state.axial[e]
            stretch += 0.5 * law[EA] * body.rest[e] * strain * strain
    for k in range(n - 2):
        w = body.width[k]
        f = k + 1
        strains(state.t[k], state.a[k], b[k], state.t[f], state.a[f], b[f], state.turn[k], s)
        for d in range(3):
            free = body.natural[k, d] + law[SOFTENED] * (state.memory[k, d] - body.natural[k, d])
            energy = 0.5 * (law[EI] if d < 2 else law[GJ]) * w * (s[d] / w - free) ** 2
            if d < 2:
                bend += energy
            else:
                twist += energy
    return kinetic, stretch, bend, twist
