"""A plastic cable is bent around a peg on a rough table, released and grasped elsewhere; it keeps its bend.

Usage: python examples/bend_around_a_peg.py [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import dlocore as dlo

BLUE, ORANGE, GREY = "#0072B2", "#E69F00", "#999999"  # Okabe-Ito

cable = dlo.Cable(
    length=0.8,
    diameter=0.006,
    linear_density=0.06,
    bending_stiffness=2e-3,
    yield_strain=0.01,
    memory_rate=20.0,
)
peg = dlo.Cylinder(center=(0.4, 0.043, 0.0), radius=0.04, height=0.1, friction=0.2)
table = dlo.Environment(drag=0.02, table=dlo.Table(friction=0.3), obstacles=(peg,))
turn = np.linspace(0.0, 1.0, 25)
angle = 2.6 * turn**3 * (10 - 15 * turn + 6 * turn**2)  # [rad], from rest to rest
reach = 0.4 - 0.055 * angle  # of the cable that is not yet wound around the peg [m]
positions = np.column_stack([0.4 + reach * np.cos(angle), reach * np.sin(angle), 0 * angle])
around = dlo.Waypoints(times=1.5 * turn, positions=positions)
bent = dlo.predict(
    dlo.Scene(
        cable=cable,
        shape=dlo.Straight(),
        grasps=[dlo.Grasp(u=0.0), dlo.Grasp(u=0.8, path=around, release_time=1.8)],
        environment=table,
        horizon=2.2,
    )
)
print("bent:", bent.message)
for effect in bent.effects:
    print(f"  {effect.name:13} {'on ' if effect.active else 'off'} {effect.reason}")

# the second motion starts where the first one ended, with the bends that the cable has kept
moved = dlo.predict(
    dlo.Scene(
        cable=cable,
        shape=bent.shape_at(),
        grasps=[dlo.Grasp(u=0.2, path=dlo.Move(displacement=(0.0, -0.25, 0.0), duration=1.5))],
        environment=table,
    )
)
print("moved:", moved.message)

figure, (first, second, curvature) = plt.subplots(1, 3, figsize=(13, 4.4), layout="constrained")
u = np.linspace(0.0, 0.8, 201)
for axes, motion, title in ((first, bent, "bent around a peg"), (second, moved, "grasped elsewhere")):
    times = np.linspace(0.0, motion.surface.horizon, 8)
    for k, shape in enumerate(motion.surface.positions(u, times)):
        late = k / (len(times) - 1)
        color = (1 - late) * np.array((0.0, 0.447, 0.698)) + late * np.array((0.902, 0.624, 0.0))
        axes.plot(shape[:, 0], shape[:, 1], color=color, linewidth=1.8)
    axes.add_patch(plt.Circle((0.4, 0.043), 0.04, color=GREY))
    for grasp in motion.scene.grasps:
        held = motion.surface.positions([grasp.u], times)[:, 0]
        axes.plot(held[:, 0], held[:, 1], ":", color="black", linewidth=1)
        axes.plot(*held[0, :2], "o", color="black", markersize=4)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title, aspect="equal")
for motion, color, label in ((bent, BLUE, "released"), (moved, ORANGE, "after the second move")):
    assert motion.material is not None
    curvature.plot(motion.material.u, motion.material.memory[-1, :, 0], color=color, label=label)
curvature.set(xlabel="material coordinate u [m]", ylabel="curvature that is kept [1/m]")
curvature.set_title("the memory goes on into the second motion")
curvature.legend(fontsize=8)
curvature.grid(alpha=0.25)
picture = sys.argv[1] if len(sys.argv) > 1 else "bend-around-a-peg.png"
figure.savefig(picture, dpi=110)
print("drew", picture)
