"""Stiffness of planar states against a displacement out of their plane."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief


@brief
def stiffness_across(states: Any, tables: Any, bending: float, axial: float) -> Any:
    """Return the stiffness of planar states (k, n, 2) against an out-of-plane displacement w, as lower bands (k, n, 4).

    With a = r', c = r'' and the tension T, it is the stiffness of half the integral of

        EI [(|a|^2 w''^2 + |c|^2 w'^2 - 2 a.c w' w'')/|a|^4 - 2 |a x c|^2 w'^2/|a|^6] + T w'^2/|a|.

    Args:
        states: (k, n, 2) [m].
        tables: `basis.Tables`.
        bending, axial: EI [N m^2] and EA [N].
    """
    bands = np.zeros((len(states), states.shape[1], 4))
    for s in range(len(states)):
        q, band = states[s], bands[s]
        for n in range(len(tables.curvature.w)):
            k = tables.curvature.first[n]
            ax, ay, cx, cy = 0.0, 0.0, 0.0, 0.0
            for i in range(4):
                ax += tables.curvature.b1[n, i] * q[k + i, 0]
                ay += tables.curvature.b1[n, i] * q[k + i, 1]
                cx += tables.curvature.b2[n, i] * q[k + i, 0]
                cy += tables.curvature.b2[n, i] * q[k + i, 1]
            square, along, across = ax * ax + ay * ay, ax * cx + ay * cy, ax * cy - ay * cx
            w = bending * tables.curvature.w[n]
            second, mixed = w / square, -w * along / square**2
            first = w * (cx * cx + cy * cy) / square**2 - 2.0 * w * across * across / square**3
            for j in range(4):
                b, c = tables.curvature.b1[n, j], tables.curvature.b2[n, j]
                for i in range(j, 4):
                    bi, ci = tables.curvature.b1[n, i], tables.curvature.b2[n, i]
                    band[k + j, i - j] += second * ci * c + first * bi * b + mixed * (bi * c + ci * b)
        for n in range(len(tables.axial.w)):
            k = tables.axial.first[n]
            x, y = 0.0, 0.0
            for i in range(4):
                x += tables.axial.b1[n, i] * q[k + i, 0]
                y += tables.axial.b1[n, i] * q[k + i, 1]
            length = np.sqrt(x * x + y * y)
            pull = axial * tables.axial.w[n] * (length - 1.0) / length
            for j in range(4):
                for i in range(j, 4):
                    band[k + j, i - j] += pull * tables.axial.b1[n, i] * tables.axial.b1[n, j]
    return bands
