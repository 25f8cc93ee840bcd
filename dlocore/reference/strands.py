"""Whether strands of a motion meet: contact of the cable with itself is not simulated by the reference."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dlocore.errors import SceneError
from dlocore.reference.refine import Refined

Floats = NDArray[np.float64]

APART = 4.0  # diameters along the cable, from which on two parts of it count as two strands
MEET = 1.0  # diameters between them
FINE = 0.25  # diameters between the points that are checked
MOST_POINTS = 4000
TIMES = 65


def refuse_meeting(refined: Refined) -> None:
    """Refuse a motion in which strands would touch.

    Raises:
        SceneError: they do, off a table, where one could lie over the other, and their contact is not switched off.
    """
    problem = refined.problem
    if problem.on_table or problem.scene.effects.get("self_contact") == "off":
        return
    cable = problem.scene.cable
    u = np.linspace(0.0, cable.length, min(MOST_POINTS, 1 + int(np.ceil(cable.length / (FINE * cable.diameter)))))
    for t in np.linspace(0.0, problem.horizon, TIMES):
        nodes = refined.positions(np.array([t]))[0]
        if _meet(u, np.column_stack([np.interp(u, refined.u, nodes[:, d]) for d in range(3)]), cable.diameter):
            reason = f"At {t:.3g} s strands of the cable meet, and the reference does not simulate contact between them"
            given = problem.scene.effects.get("self_contact", "auto")
            raise SceneError("effects.self_contact", given, '"off", or another method', reason)


def _meet(u: Floats, points: Floats, diameter: float) -> bool:
    pairs = cKDTree(points).query_pairs(MEET * diameter, output_type="ndarray")
    return bool((np.abs(u[pairs[:, 0]] - u[pairs[:, 1]]) > APART * diameter).any())
