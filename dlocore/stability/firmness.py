"""How far a motion depends on the contact stiffness, which is numerical: a striking cable sinks in for an instant."""

import numpy as np

from dlocore.problem.problem import Problem, stiffer
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor
from dlocore.words import in_mm

FIRMER = 2.0  # times as stiff


def gives_way(problem: Problem, motion: March, monitor: Monitor) -> float:
    """Return how far a motion that strikes something changes with contact FIRMER times as stiff [m].

    A strike lasts for a time sqrt(mu/k) (docs/model.md eq. 21), however fine the grid is, so no grid shows its effect,
    and a wave that follows may enlarge it. The result is 0 if no step was divided for a strike, or if the march with
    stiffer contact finds no equilibrium.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed.
    """
    strikes = motion.split and (problem.contact is not None or problem.self_contact is not None)
    if motion.stopped or not strikes:
        return 0.0
    firm = march(stiffer(problem, FIRMER), motion.grid, motion.asked, monitor, rho=motion.rho, whole=True)
    if firm.stopped:
        return 0.0
    apart = (firm.states - motion.states)[..., : problem.plane.dimensions]
    return float(np.linalg.norm(apart, axis=-1).max())


def firmness_in_words(moved: float) -> str:
    """Return a message that stiffer contact changes the motion by `moved` [m]."""
    return f"contact twice as stiff changes the motion by up to {in_mm(moved)}"
