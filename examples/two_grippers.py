"""Two grippers carry a hanging cable that starts at rest: its motion, and the forces that the grippers must exert.

Usage: python examples/two_grippers.py [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import dlocore as dlo

BLUE, ORANGE, GREEN, GREY = "#0072B2", "#E69F00", "#009E73", "#999999"  # Okabe-Ito
SPAN, DURATION = 0.7, 1.0  # [m], [s]

parabola = np.linspace(0.0, SPAN, 25)
points = np.column_stack([parabola, np.zeros(25), -0.32 * (1 - (2 * parabola / SPAN - 1) ** 2)])
move = dlo.Move(displacement=(-0.2, 0.2, 0.1), rotation=(0.0, 0.0, -0.8), duration=DURATION)
scene = dlo.Scene(
    cable=dlo.Cable.preset("paper", bending_damping=2e-4),
    shape=dlo.Points(points=points, settle=True),
    grasps=[dlo.Grasp(u=0.0, hold="tangent"), dlo.Grasp(u=1.0, hold="tangent", path=move)],
    environment=dlo.Environment(drag=0.1),
    horizon=2.0,
    quality=dlo.Quality(target_error=0.002),
)
motion = dlo.predict(scene)
print(motion.message)

figure = plt.figure(figsize=(11, 4.8), layout="constrained")
space = figure.add_subplot(1, 2, 1, projection="3d")
u, t, q = motion.surface.sample(81, 9)
for k, shape in enumerate(q):
    late = k / (len(q) - 1)
    color = plt.matplotlib.colors.to_hex((1 - late) * np.array((0, 0.447, 0.698)) + late * np.array((0.902, 0.624, 0)))
    space.plot(*shape[:, :3].T, color=color, linewidth=1.8, label=f"{t[k]:.2g} s" if k in (0, 4, 8) else None)
for place in (0.0, 1.0):
    held = motion.surface.positions([place], np.linspace(0.0, 2.0, 65))[:, 0]
    space.plot(*held.T, ":", color="black", linewidth=1)
    space.plot(*held[-1], "o", color="black", markersize=5)
space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="one gripper still, one moves and turns")
space.set(xticks=(0.0, 0.2, 0.4, 0.6), yticks=(0.0, 0.2), zticks=(-0.3, -0.2, -0.1, 0.0, 0.1))
space.set_aspect("equal")
space.legend(fontsize=8, loc="upper left")

force = figure.add_subplot(1, 2, 2)
for grasp, color, name in zip(motion.grasps, (BLUE, ORANGE), ("still", "moving"), strict=True):
    force.plot(grasp.times, np.linalg.norm(grasp.reaction, axis=1), color=color, label=f"{name} gripper")
weight = 0.05 * 1.0 * 9.81
force.axhline(weight / 2, color=GREY, linewidth=1, linestyle="--", label="half the weight")
force.axvline(DURATION, color=GREEN, linewidth=1, linestyle=":", label="end of the move")
peak = max(np.linalg.norm(grasp.reaction, axis=1).max() for grasp in motion.grasps)
force.set(xlabel="time t [s]", ylabel="force of the gripper [N]", ylim=(0.0, None))
force.set_title(f"the grippers give up to {peak:.2f} N, {peak / weight:.1f} times the cable's weight")
force.legend(fontsize=8)
force.grid(alpha=0.25)
accuracy = motion.accuracy
figure.suptitle(
    f"A 1 m cable carried by two grippers, {accuracy.n_u} × {accuracy.n_t} control points, "
    f"estimated error {1e3 * (accuracy.error_estimate or np.nan):.1f} mm"
)
picture = sys.argv[1] if len(sys.argv) > 1 else "two-grippers.png"
figure.savefig(picture, dpi=110)
print("drew", picture)
