"""Rods, their equilibria and their motions, for the tests of the reference."""

import numpy as np
from numpy.typing import NDArray

from dlocore import Cable, Environment, Scene
from dlocore.problem.problem import pose
from dlocore.reference.motion import Motion, settled, simulate
from dlocore.reference.rod import Rod, build, nodes_of

Floats = NDArray[np.float64]
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))


class Patient:
    """A watch that never ends a solve."""

    def check(self) -> None:
        pass


def cable(**changes: object) -> Cable:
    values = {
        "length": 1.0,
        "diameter": 0.01,
        "linear_density": 0.05,
        "bending_stiffness": 1e-3,
        "axial_stiffness": 10.0,
    }
    return Cable(**(values | changes))  # type: ignore[arg-type]


def rod(scene: Scene, elements: int, halvings: int = 0, stiffening: float = 1.0) -> Rod:
    problem = pose(scene)
    return build(problem, nodes_of(problem, elements, halvings), stiffening)


def equilibrium(scene: Scene, elements: int) -> Floats:
    """Return the settled nodes (n, 3) [m], extrapolated to a fine rod from `elements` and twice as many."""
    coarse, fine = (rod(scene, elements, k) for k in (0, 1))
    x, y = (r.world(settled(r, Patient())[0].x) for r in (coarse, fine))
    return np.asarray((4.0 * y[::2] - x) / 3.0)


def motion(scene: Scene, elements: int, tolerance: float, halvings: int = 0, stiffening: float = 1.0) -> Motion:
    """Return the motion of one rod, each step to `tolerance` [m]."""
    found = simulate(rod(scene, elements, halvings, stiffening), tolerance, Patient())
    assert not found.stopped
    return found
