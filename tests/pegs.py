"""A cable that lies in a U around a round peg, for tests of what the peg gives to it."""

import math

import numpy as np

from dlocore import Cable, Cylinder, Environment, Grasp, Move, Points, Scene, Table

RADIUS = 0.05  # of the peg [m]


def around_a_peg(
    EI: float, EA: float, ways: tuple[float, float], *, gravity: float = 0.0, friction: float = 0.0
) -> Scene:
    """Return a scene in which the ends of a cable around a peg are pulled from it by two ways [m] in two seconds."""
    cable = Cable(length=0.8, diameter=0.004, linear_density=0.05, bending_stiffness=EI, axial_stiffness=EA)
    radius = RADIUS + 0.5 * cable.diameter
    leg = 0.5 * (cable.length - math.pi * radius)
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 61)[:, None]
    along, beside = np.linspace(-leg, 0.0, 41)[:-1, None], np.full((40, 1), radius)
    turn = radius * np.hstack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([np.hstack([along, -beside]), turn, np.hstack([along[::-1], beside])])
    first, last = (Move(displacement=(-way, 0.0, 0.0), duration=2.0) for way in ways)
    peg = Cylinder(center=(0.0, 0.0, 0.0), radius=RADIUS, height=0.1, friction=friction)
    return Scene(
        cable=cable,
        shape=Points(points=points),
        grasps=[Grasp(u=0.0, path=first), Grasp(u=cable.length, path=last)],
        environment=Environment(drag=0.5, gravity=(0.0, 0.0, -gravity), table=Table(), obstacles=[peg]),
        horizon=4.0,
    )
