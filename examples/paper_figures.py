"""The paper's figures: four grasps of a straight cable as surfaces (Fig. 1), and the convergence of the solve (Fig. 2).

Usage: python examples/paper_figures.py [FOLDER]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap

import dlocore as dlo

GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m]
BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"  # Okabe-Ito
TIME = LinearSegmentedColormap.from_list("time", ["#56B4E9", BLUE, "#CC79A7", VERMILION, ORANGE])


def scene(grasp: float, method: str) -> dlo.Scene:
    return dlo.Scene(
        cable=dlo.Cable.preset("paper"),
        shape=dlo.Straight(),
        grasps=[dlo.Grasp(u=grasp, path=dlo.Move(displacement=(0.0, 0.5, 0.0), duration=1.6))],
        environment=dlo.Environment(drag=0.05, table=dlo.Table()),
        quality=dlo.Quality(n_u=9, n_t=13, delta=1e-5, method=method, keep_grid=True),
    )


def draw_motions(motions: list[dlo.Prediction], file: Path) -> None:
    figure = plt.figure(figsize=(13, 7))
    figure.subplots_adjust(left=0.05, right=0.98, bottom=0.19, top=0.93, wspace=0.22, hspace=0.08)
    for column, (grasp, motion) in enumerate(zip(GRASPS, motions, strict=True)):
        t = np.linspace(0.0, motion.surface.horizon, 41)
        x, y, _ = np.moveaxis(motion.surface.positions(np.linspace(0.0, 1.0, 61), t), -1, 0)
        late = np.broadcast_to(t[:, None] / t[-1], x.shape)
        over = figure.add_subplot(2, 4, column + 1, projection="3d")
        over.plot_surface(x, y, late * t[-1], facecolors=TIME(late), rstride=1, cstride=1, shade=False)
        over.set(xlabel="x [m]", ylabel="y [m]", zlabel="t [s]", yticks=(0.0, 0.5), xticks=(0.0, 0.5, 1.0))
        over.set_title(f"grasped at u = {grasp:g} m", y=1.02)
        over.view_init(elev=26, azim=-58)
        plane = figure.add_subplot(2, 4, column + 5)
        for k in range(0, len(t), 4):
            plane.plot(x[k], y[k], color=TIME(late[k, 0]), linewidth=1.6)
        plane.plot([grasp, grasp], [0.0, 0.5], "o:", color="black", linewidth=1, markersize=5, markevery=[1])
        plane.set(xlabel="x [m]", ylabel="y [m]", xlim=(-0.05, 1.05), ylim=(-0.3, 0.8), aspect="equal")
        plane.grid(alpha=0.25)
    worst = 1e3 * max(motion.accuracy.error_estimate or np.inf for motion in motions)
    figure.suptitle(f"9 × 13 control points are the whole motion; estimated error at most {worst:.1f} mm")
    colors = plt.cm.ScalarMappable(plt.Normalize(0.0, motions[0].surface.horizon), TIME)
    figure.colorbar(colors, cax=figure.add_axes((0.3, 0.075, 0.4, 0.018)), label="t [s]", orientation="horizontal")
    figure.savefig(file, dpi=110)
    print("drew", file)


def draw_convergence(motions: list[dlo.Prediction], printed: list[dlo.Prediction], file: Path) -> None:
    figure, axes = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
    for grasp, color, good, bad in zip(GRASPS, (BLUE, ORANGE, GREEN, VERMILION), motions, printed, strict=True):
        for motion, style in ((good, "o-"), (bad, ":")):
            updates = [iteration.update for iteration in motion.iterations]
            axes.semilogy(range(1, len(updates) + 1), updates, style, color=color)
        axes.plot([], [], "-", color=color, label=f"grasped at u = {grasp:g} m")
    for style, label in (("o-", "weighted, from a march"), (":", "as printed, from rest")):
        axes.plot([], [], style, color="black", label=label)
    axes.axhline(1e-5, color="grey", linewidth=1, label="δ")
    counts = [len(motion.iterations) for motion in motions]
    solved = sum(motion.status == "converged" for motion in printed)
    finding = f"converges in {min(counts)} to {max(counts)} iterations,\nas printed in {solved} of {len(printed)} cases"
    axes.set_title(f"The weighted least squares {finding}")
    axes.set(xlabel="iteration", ylabel="norm of the control-point update [m]", xlim=(0.5, 50.5))
    axes.legend(ncols=2, fontsize=8, loc="center right")
    axes.grid(alpha=0.25)
    figure.savefig(file, dpi=110)
    print("drew", file)


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path()
    solutions = [dlo.predict(scene(grasp, "spacetime")) for grasp in GRASPS]
    draw_motions(solutions, folder / "paper-fig1.png")
    draw_convergence(solutions, [dlo.predict(scene(grasp, "paper")) for grasp in GRASPS], folder / "paper-fig2.png")
