"""Memory of a space-time solve: `python -m benchmarks.memory [--n-u N] [--n-t N]`.

Each row is the largest resident memory of fresh processes that do one solve: on 9 x 13 control points, which is mostly
Python, its packages and the compiled code, and on 65 x 513 unless told otherwise. The scenes are the paper's case in
the plane, and a cable between two grippers in space, without and with twist. Beside them is the size of the normal
matrix, which is factored in its place: 4 (n_t - 2) m^2 numbers for the m = n_u x (2, 3 or 4) coordinates at a time.
"""

import argparse
import resource
import subprocess
import sys
from dataclasses import replace

from benchmarks.machine import machine_line
from dlocore import Quality, predict
from dlocore.study.scenes import hanging, paper_case

SCENES = {
    "in the plane": (paper_case(0.25), 2),
    "in space": (hanging(), 3),
    "in space, with twist": (hanging("clamp"), 4),
}
SMALL = (9, 13)
UNIT = 1e6 if sys.platform == "darwin" else 1e3  # of what `ru_maxrss` tells in 1 MB


def solve(name: str, n_u: int, n_t: int) -> None:
    """Solve a scene in this process, and print the largest memory that it took [MB] and how the solve ended."""
    quality = Quality(n_u=n_u, n_t=n_t, method="spacetime", estimate=False, keep_grid=True)
    status = predict(replace(SCENES[name][0], quality=quality)).status
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / UNIT, status)


def measure(name: str, n_u: int, n_t: int) -> tuple[float, str]:
    """Return the largest memory [MB] of a fresh process that solves a scene, and how the solve ends.

    On Linux a process begins with the memory of the one that starts it, which therefore solves and compiles nothing.
    """
    command = [sys.executable, "-m", "benchmarks.memory", "--only", name, "--n-u", str(n_u), "--n-t", str(n_t)]
    memory, status = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(memory), status


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n-u", type=int, default=65, help="control points along the cable (default 65)")
    parser.add_argument("--n-t", type=int, default=513, help="control points in time (default 513)")
    parser.add_argument("--only", choices=SCENES, help="solve this scene in this process and print its memory")
    options = parser.parse_args()
    if options.only is not None:
        solve(options.only, options.n_u, options.n_t)
        return
    subprocess.run([sys.executable, "-c", "import dlocore; dlocore.warm_up()"], check=True)  # see `measure`
    grid = f"{options.n_u} x {options.n_t}"
    print(f"| scene | 9 x 13 [MB] | {grid} [MB] | normal matrix [MB] | status |")
    print("|---|---|---|---|---|")
    for name, (_, nc) in SCENES.items():
        least, most = measure(name, *SMALL)[0], measure(name, options.n_u, options.n_t)
        matrix = 4 * (options.n_t - 2) * (options.n_u * nc) ** 2 * 8 / 1e6
        print(f"| {name} | {least:.0f} | {most[0]:.0f} | {matrix:.0f} | {most[1]} |", flush=True)
    print(machine_line())


if __name__ == "__main__":
    main()
