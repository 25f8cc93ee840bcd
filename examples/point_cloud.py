"""A cable as a camera sees it: it starts from noisy, unevenly spaced points on a table, and one gripper moves it.

Usage: python examples/point_cloud.py [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import dlocore as dlo

BLUE, ORANGE, GREEN, GREY = "#0072B2", "#E69F00", "#009E73", "#999999"  # Okabe-Ito
LENGTH, NOISE, COUNT = 0.8, 0.002, 60  # [m], [m], points

# the true shape, which the solver does not know: its direction swings to and fro along the cable
s = np.linspace(0.0, LENGTH, 2001)
angle = 0.9 * np.sin(2 * np.pi * s / LENGTH) + 0.5 * np.cos(np.pi * s / LENGTH)
true = np.column_stack([np.cos(angle), np.sin(angle)]).cumsum(axis=0) * (s[1] - s[0])

generator = np.random.default_rng(7)
seen = np.sort(generator.choice(len(s), COUNT, replace=False))
seen[[0, -1]] = 0, len(s) - 1
points = true[seen] + NOISE * generator.standard_normal((COUNT, 2))

scene = dlo.Scene(
    cable=dlo.Cable.preset("black-wire", length=LENGTH, rest_shape="initial"),
    shape=dlo.Points(points=points),
    grasps=[dlo.Grasp(u=0.3, hold="tangent", path=dlo.Move(displacement=(0.05, 0.25, 0.0), duration=1.5))],
    environment=dlo.Environment(drag=0.2, table=dlo.Table()),
    horizon=2.0,
)
motion = dlo.predict(scene)
print(motion.message)

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
start = motion.surface.positions(s, [0.0])[0, :, :2]
nearest = np.linalg.norm(start[::10, None] - true[None], axis=-1).min(axis=1)
left.plot(*points.T, ".", color=ORANGE, label=f"{COUNT} points, {1e3 * NOISE:g} mm of noise")
left.plot(*true.T, color=GREY, linewidth=4, alpha=0.5, label="true shape")
left.plot(*start.T, color=BLUE, linewidth=1.5, label="start of the prediction")
left.set_title(f"the start is {1e3 * np.sqrt((nearest**2).mean()):.1f} mm rms from the true shape")

u, t, q = motion.surface.sample(101, 9)
for k, shape in enumerate(q):
    color = BLUE if k == 0 else ORANGE if k == len(q) - 1 else GREY
    right.plot(shape[:, 0], shape[:, 1], color=color, linewidth=2.0 if color != GREY else 0.9)
right.plot([], [], color=BLUE, label="t = 0")
right.plot([], [], color=ORANGE, label=f"t = {t[-1]:g} s")
held = motion.surface.positions([0.3], np.linspace(0.0, t[-1], 33))[:, 0]
right.plot(held[:, 0], held[:, 1], ":", color="black", linewidth=1)
right.plot(*held[-1, :2], "o", color="black", markersize=5, label="gripper, holds the direction")
right.set_title(f"predicted with an estimated error of {1e3 * (motion.accuracy.error_estimate or np.nan):.1f} mm")
for axes in (left, right):
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25)
picture = sys.argv[1] if len(sys.argv) > 1 else "point-cloud.png"
figure.savefig(picture, dpi=110)
print("drew", picture)
