"""Compare the explicit rod with stored converged solutions: `python -m benchmarks.rod_reference FOLDER`.

The folder holds pairs of .npz (t, u, pos) and .json (L, D, mu, EI, EA, u_g, c, T, dist, grasp) of a straight planar
cable that is moved sideways at one grasp.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rod import richardson
from dlocore.scene.cable import Cable
from dlocore.scene.paths import Move
from dlocore.scene.scene import Environment, Grasp, Scene, Straight


def scene_of(case: dict[str, Any]) -> Scene:
    cable = Cable(
        length=case["L"],
        diameter=case["D"],
        linear_density=case["mu"],
        bending_stiffness=case["EI"],
        axial_stiffness=case["EA"],
    )
    path = Move(displacement=(0.0, case["dist"], 0.0), duration=case["T"])
    grasp = Grasp(u=case["u_g"], hold="tangent" if case["grasp"] == "clamp" else "point", path=path)
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=case["c"])
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=around)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--elements", type=int, default=400)
    options = parser.parse_args()
    for file in sorted(options.folder.glob("*.json")):
        stored = np.load(file.with_suffix(".npz"))
        began = time.perf_counter()
        scene = scene_of(json.loads(file.read_text()))
        _, u, positions = richardson(scene, elements=options.elements, times=stored["t"])
        spent = time.perf_counter() - began
        at = np.searchsorted(u, stored["u"] - 1e-9)
        error = 1e3 * np.linalg.norm(positions[:, at, :2] - stored["pos"], axis=-1)
        print(f"{file.stem:45s} largest {error.max():.2e} mm  final {error[-1].max():.2e} mm  {spent:.1f} s")


if __name__ == "__main__":
    main()
