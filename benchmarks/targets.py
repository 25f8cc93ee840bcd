"""What a target error of a millimetre costs: `python -m benchmarks.targets [--repeats N] [--cases]`.

A straight cable of a metre on a frictionless table is moved sideways by half a metre in 1.6 s: three bending
stiffnesses, four grasps, two drags, held by a point or by its direction too. Times are medians of whole calls of
`predict`, on one core; the error is the largest distance to a march refined until it stands still.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

import argparse
import time
from dataclasses import dataclass
from itertools import product

import numpy as np

from benchmarks.machine import machine_line
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict, warm_up
from dlocore.scene import Hold
from dlocore.study.judge import finest_march, largest_error

TARGET = 1e-3  # [m]
BENDING = (1e-4, 1e-3, 1e-2)  # [N m^2]
GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m]
DRAGS = (0.05, 0.5)  # [N s/m^2]
HOLDS: tuple[Hold, ...] = ("point", "tangent")
STILL = 5e-6  # of the length: a refinement that moves the truth by less is the last


@dataclass(frozen=True, kw_only=True)
class Row:
    """One case: the time [s], the error and what the answer says of it [m], the grids and whether it was reached."""

    case: str
    hold: Hold
    time: float
    error: float
    estimate: float
    grids: int
    grid: str
    met: bool


def scene(bending: float, grasp: float, drag: float, hold: Hold) -> Scene:
    return Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=bending),
        shape=Straight(),
        grasps=(Grasp(u=grasp, hold=hold, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6)),),
        environment=Environment(drag=drag, table=Table()),
        quality=Quality(target_error=TARGET),
    )


def row(bending: float, grasp: float, drag: float, hold: Hold, repeats: int) -> Row:
    """Measure one case."""
    times = []
    for _ in range(repeats):
        case = scene(bending, grasp, drag, hold)
        began = time.thread_time()
        answer = predict(case)
        times.append(time.thread_time() - began)
    error = largest_error(answer, finest_march(case, still=STILL))
    accuracy = answer.accuracy
    return Row(
        case=f"EI {bending:g}, at {grasp:g} m, drag {drag:g}",
        hold=hold,
        time=float(np.median(times)),
        error=error,
        estimate=accuracy.error_estimate or np.nan,
        grids=len(answer.iterations),
        grid=f"{accuracy.n_u} x {accuracy.n_t}, {accuracy.steps} steps",
        met=answer.status == "converged" and error <= TARGET,
    )


def table(rows: list[Row]) -> str:
    """Return a Markdown table with a row for each way to hold, and one for all."""
    lines = [
        "| held | cases | met | ms, median | 90 % | worst | grids, median | estimate/true, least | median | largest |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for hold in (*HOLDS, "all"):
        group = [r for r in rows if hold in ("all", r.hold)]
        times = 1e3 * np.quantile([r.time for r in group], [0.5, 0.9, 1.0])
        ratios = np.quantile([r.estimate / r.error for r in group], [0.0, 0.5, 1.0])
        lines.append(
            f"| {hold} | {len(group)} | {sum(r.met for r in group)} | {times[0]:.2f} | {times[1]:.1f} | {times[2]:.0f} "
            f"| {np.median([r.grids for r in group]):g} | {ratios[0]:.2f} | {ratios[1]:.2f} | {ratios[2]:.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=11, help="timed calls of each case (default 11)")
    parser.add_argument("--cases", action="store_true", help="print every case")
    options = parser.parse_args()
    warm_up()
    rows = [row(*case, options.repeats) for case in product(BENDING, GRASPS, DRAGS, HOLDS)]
    for r in rows if options.cases else ():
        said = f"error {1e3 * r.error:.2f} mm, estimate {1e3 * r.estimate:.2f} mm, {r.grids} grids, the last {r.grid}"
        print(f"{r.case}, {r.hold}: {1e3 * r.time:.2f} ms, {said}{'' if r.met else ', not met'}")
    print(table(rows))
    print(machine_line())


if __name__ == "__main__":
    main()
