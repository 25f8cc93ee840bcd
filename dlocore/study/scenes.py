"""The scenes on which a machine is calibrated."""

from dataclasses import replace
from typing import Any

import numpy as np

from dlocore.scene.cable import Cable
from dlocore.scene.obstacles import Cylinder
from dlocore.scene.paths import Move
from dlocore.scene.scene import Environment, Grasp, Hold, Points, Scene, Straight, Table

GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m] of the paper's case


def plain_cord(**changes: float) -> Cable:
    """Return the cable of the paper's case, with the given fields replaced."""
    values: dict[str, Any] = {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3}
    return Cable(**(values | changes))


def paper_case(grasp: float, **table: float) -> Scene:
    """Return the paper's case: a straight cable on a table that a gripper at `grasp` [m] moves sideways."""
    return Scene(
        cable=plain_cord(),
        shape=Straight(),
        grasps=(Grasp(u=grasp, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6)),),
        environment=Environment(drag=0.05, table=Table(**table)),
    )


def hanging(hold: Hold = "point") -> Scene:
    """Return a cable that hangs between two grippers, one of which moves it out of its plane."""
    angle = np.linspace(-1.2, 1.2, 41)
    radius = 1.0 / 2.4
    arc = radius * np.column_stack([np.sin(angle) - np.sin(angle[0]), 0 * angle, np.cos(angle[0]) - np.cos(angle)])
    end = Move(displacement=(-0.2, 0.2, 0.1), duration=1.0)
    return Scene(
        cable=plain_cord(torsional_stiffness=1e-3),
        shape=Points(points=arc, settle=True),
        grasps=(Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=end)),
        environment=Environment(drag=0.1),
    )


def accuracy_scenes() -> dict[str, Scene]:
    """Return the scenes whose errors are measured, by name."""
    plane = {f"paper's case, grasp at {u:g} m": paper_case(u) for u in GRASPS}
    return plane | {"hanging between two grippers": hanging()}


def effect_scenes() -> dict[str, Scene]:
    """Return, for each effect that costs time by itself, a scene with it, otherwise like the paper's at 0.25 m."""
    plain = paper_case(0.25)
    peg = Cylinder(center=(0.8, 0.12, 0.0), radius=0.02, height=0.1)
    return {
        "friction": paper_case(0.25, friction=0.1),
        "obstacles": replace(plain, environment=replace(plain.environment, obstacles=(peg,))),
        "plasticity": replace(plain, cable=plain_cord(yield_strain=0.004, memory_rate=50.0)),
        "self_contact": replace(plain, effects={"self_contact": "on"}),
    }
