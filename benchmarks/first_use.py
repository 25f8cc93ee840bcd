"""How long a new process waits for its first prediction: `python -m benchmarks.first_use [--repeats N]`.

The times of `import dlocore` and then of the first prediction, which loads the compiled code: for the paper's case on
9 x 13 control points, and for a cable between two grippers in space. Each time is the median over processes that do
nothing else. The code is compiled beforehand.
"""

import argparse
import subprocess
import sys

import numpy as np

from benchmarks.machine import machine_line
from dlocore import warm_up

PROGRAM = """
import time
began = time.perf_counter()
import dlocore
imported = time.perf_counter()
from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, Straight, Table
in_space = {in_space}
if in_space:
    arc = [[0.8 * u, 0.0, -1.1 * u * (1.0 - u)] for u in [0.05 * i for i in range(21)]]
    ends = (Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=(-0.1, 0.1, 0.0), duration=1.6)))
    scene = Scene(cable=Cable.preset("paper"), shape=Points(points=arc), grasps=ends)
else:
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
    grasp = Grasp(u=0.25, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6))
    around = Environment(drag=0.05, table=Table())
    quality = Quality(n_u=9, n_t=13, method="march", estimate=False)
    scene = Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=around, quality=quality)
posed = time.perf_counter()
dlocore.predict(scene)
print(imported - began, time.perf_counter() - posed)
"""


def measure(repeats: int, *, in_space: bool) -> tuple[float, float]:
    """Return the median times of the import and of the first prediction [s]."""
    command = [sys.executable, "-c", PROGRAM.format(in_space=in_space)]
    times = [
        [float(x) for x in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()]
        for _ in range(repeats)
    ]
    imported, first = np.median(times, axis=0)
    return float(imported), float(first)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=9, help="processes of each kind (default 9)")
    options = parser.parse_args()
    warm_up()
    print("| first prediction | import [s] | prediction [s] |")
    print("|---|---|---|")
    for name, in_space in (("in the plane, 9 x 13", False), ("in space, between two grippers", True)):
        imported, first = measure(options.repeats, in_space=in_space)
        print(f"| {name} | {imported:.2f} | {first:.2f} |")
    print(machine_line())


if __name__ == "__main__":
    main()
