"""Where must the gripper go so that the free end of a cable on a table comes to rest at a given place?

Newton's method finds the gripper's target. Every prediction after the first reuses the grid and the error estimate of
the previous one (`predict(..., like=...)`), which takes only part of the time.

Usage: python examples/reach_a_place.py [PICTURE]
"""

import sys
import time

import matplotlib.pyplot as plt
import numpy as np

import dlocore as dlo

GOAL = np.array([0.75, -0.01])  # [m], of the end at u = 1 m
STEP = 0.005  # [m], of the finite differences
FARTHEST = 0.1  # [m], most from one target to the next
BLUE, ORANGE, GREY = "#0072B2", "#E69F00", "#999999"  # Okabe-Ito


def scene(target: np.ndarray) -> dlo.Scene:
    """Return the scene of the cable, grasped at 0.25 m and moved by `target` (2,) [m]."""
    path = dlo.Move(displacement=(*target, 0.0), duration=1.6)
    return dlo.Scene(
        cable=dlo.Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2),
        shape=dlo.Straight(),
        grasps=[dlo.Grasp(u=0.25, path=path)],
        environment=dlo.Environment(drag=0.5, table=dlo.Table()),
        quality=dlo.Quality(target_error=0.001),
    )


def end_of(prediction: dlo.Prediction) -> np.ndarray:
    """Return where the free end is at the end of the motion (2,) [m]."""
    surface = prediction.surface
    return surface.positions([1.0], [surface.horizon])[0, 0, :2]


target = np.array([0.0, 0.3])
known = None
dlo.warm_up()
figure, axes = plt.subplots(figsize=(7, 4.4), layout="constrained")
u = np.linspace(0.0, 1.0, 201)
for number in range(12):
    began = time.perf_counter()
    known = dlo.predict(scene(target), like=known)
    miss = end_of(known) - GOAL
    took = 1e3 * (time.perf_counter() - began)
    off = 1e3 * np.linalg.norm(miss)
    print(f"{number}: target ({target[0]:.3f}, {target[1]:.3f}) m, missed by {off:.1f} mm, {took:.1f} ms")
    x, y, _ = known.surface.positions(u, [known.surface.horizon])[0].T
    arrived = off < 1.0
    color = BLUE if arrived else GREY
    axes.plot(x, y, color=color, linewidth=2.2 if arrived else 1.2)
    axes.annotate(str(number), (x[-1], y[-1]), (4, 4), textcoords="offset points", color=color)
    if arrived:
        break
    beside = dlo.predict_many([scene(target + STEP * axis) for axis in np.eye(2)], like=known)
    jacobian = np.column_stack([(end_of(p) - end_of(known)) / STEP for p in beside])
    step = -np.linalg.solve(jacobian, miss)
    target = target + step * min(1.0, FARTHEST / float(np.linalg.norm(step)))
print(known.message)
axes.plot(*GOAL, "+", color=ORANGE, markersize=16, markeredgewidth=2.5, label="where the free end is to be")
axes.plot(x[50], y[50], "o", color=BLUE, label="the gripper")
axes.set(xlabel="x [m]", ylabel="y [m]", title="The cable after each motion that was tried", aspect="equal")
axes.legend(fontsize=8)
axes.grid(alpha=0.25)
picture = sys.argv[1] if len(sys.argv) > 1 else "reach-a-place.png"
figure.savefig(picture, dpi=110)
print("drew", picture)
