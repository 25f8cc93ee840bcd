"""Random scenes that are typical of robots, drawn from seeds."""

import numpy as np

from benchmarks.catalogue.parts import bow, sagging
from dlocore import Cable, Environment, Grasp, Move, Points, Scene, Straight, Table

HOLDS = ("point", "tangent", "clamp")


def random_scene(seed: int) -> Scene:
    """Return a scene of a seed: a third on a table, a third between two grippers, a third hung by one."""
    r = np.random.default_rng(seed)
    length = r.uniform(0.4, 2.0)
    cable = Cable(
        length=length,
        diameter=r.uniform(0.002, 0.01),
        linear_density=10 ** r.uniform(-2, -0.5),
        bending_stiffness=10 ** r.uniform(-4, -1.5),
        bending_damping=float(r.choice([0.0, 1e-4])),
    )
    profile = str(r.choice(["minimum_jerk", "cubic"]))
    duration = r.uniform(0.6, 2.0)
    drag = 10 ** r.uniform(-2, -0.3)
    kind = seed % 3
    if kind == 0:
        away = r.normal(0.0, 0.25 * length, 2)
        turn = (0.0, 0.0, r.uniform(-1.0, 1.0))
        hold = HOLDS[r.integers(2)]
        path = Move(
            displacement=(*away, 0.0), rotation=None if hold == "point" else turn, duration=duration, profile=profile
        )
        table = Table(friction=float(r.choice([0.0, 0.0, 0.1, 0.3])))
        return Scene(
            cable=cable,
            shape=Points(points=bow(length, r.uniform(0.2, 2.5))) if r.random() < 0.5 else Straight(),
            grasps=(Grasp(u=r.uniform(0.0, length), hold=hold, path=path),),
            environment=Environment(drag=drag, table=table),
        )
    if kind == 1:
        span = r.uniform(0.4, 0.9) * length
        points = sagging(length, span)
        room = 0.5 * (length - span)
        path = Move(displacement=r.normal(0.0, 0.3 * room, 3), duration=duration, profile=profile)
        hold = HOLDS[r.integers(3)]
        return Scene(
            cable=cable,
            shape=Points(points=points, settle=True),
            grasps=(Grasp(u=0.0, hold=hold), Grasp(u=length, hold=hold, path=path)),
            environment=Environment(drag=drag),
        )
    path = Move(displacement=r.normal(0.0, 0.15 * length, 3), duration=duration, profile=profile)
    return Scene(
        cable=cable,
        shape=Straight(direction=(0, 0, -1)),
        grasps=(Grasp(u=0.0, hold=HOLDS[r.integers(2)], path=path),),
        environment=Environment(drag=drag),
        horizon=duration * r.uniform(1.0, 1.5),
    )
