"""What a target error costs: `python -m benchmarks.targets [--repeats N] [--cases]`.

- In the plane, to one millimetre: a straight cable of one metre on a frictionless table is moved sideways by half a
  metre in 1.6 s, with three bending stiffnesses, four grasps and two drags, held at a point or also by its direction.
- In space with twist, to two millimetres: a cable hangs between two clamps, one of which moves by 0.3 m in 1 s and may
  turn, with three bending stiffnesses, from its equilibrium or from points near it.

Times are medians of whole calls of `predict` on one core. The error is the largest distance to a march that is refined
until it no longer changes.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from benchmarks.machine import machine_line
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict, warm_up
from dlocore.scene.scene import Hold
from dlocore.study.judge import finest_march, largest_error
from dlocore.study.scenes import hanging

TARGET = 1e-3  # [m] in the plane
IN_SPACE = 2e-3  # [m]
BENDING = (1e-4, 1e-3, 1e-2)  # [N m^2]
GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m]
DRAGS = (0.05, 0.5)  # [N s/m^2]
HOLDS: tuple[Hold, ...] = ("point", "tangent")
PLANE = "in the plane"
TURNS = {"carried": None, "turned too": (0.3, -0.4, 0.9)}  # rotation of the gripper [rad]
STARTS = {"in equilibrium": True, "as given": False}
STILL = 5e-6  # of the length: a refinement that moves the truth by less is the last


@dataclass(frozen=True, kw_only=True)
class Row:
    """One case: the time [s], the error and what the answer says of it [m], the grids and whether it was reached."""

    case: str
    group: str
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


def between_clamps(bending: float, turn: str, start: str) -> Scene:
    hung = hanging("clamp")
    first, last = hung.grasps
    path = Move(displacement=(-0.2, 0.2, 0.1), rotation=TURNS[turn], duration=1.0)
    return replace(
        hung,
        cable=replace(hung.cable, bending_stiffness=bending, torsional_stiffness=bending, axial_stiffness=None),
        shape=replace(hung.shape, settle=STARTS[start]),
        grasps=(first, replace(last, path=path)),
        quality=Quality(target_error=IN_SPACE),
    )


def row(name: str, group: str, make: Callable[[], Scene], repeats: int) -> Row:
    """Measure one case."""
    times = []
    for _ in range(repeats):
        case = make()
        began = time.thread_time()
        answer = predict(case)
        times.append(time.thread_time() - began)
    error = largest_error(answer, finest_march(case, still=STILL))
    accuracy = answer.accuracy
    return Row(
        case=name,
        group=group,
        time=float(np.median(times)),
        error=error,
        estimate=accuracy.error_estimate or np.nan,
        grids=len(answer.iterations),
        grid=f"{accuracy.n_u} x {accuracy.n_t}, {accuracy.steps} steps",
        met=answer.status == "converged" and error <= (case.quality.target_error or 0.0),
    )


def table(rows: list[Row]) -> str:
    """Return a Markdown table with a row for each group of cases, and one for all of those in the plane."""
    lines = [
        "| group | cases | met | ms, median | 90 % | worst | grids, median | estimate/true, least | median | largest |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    groups = {name: [r for r in rows if r.group == name] for name in dict.fromkeys(r.group for r in rows)}
    for name, group in (groups | {f"{PLANE}, all": [r for r in rows if r.group.startswith(PLANE)]}).items():
        times = 1e3 * np.quantile([r.time for r in group], [0.5, 0.9, 1.0])
        ratios = np.quantile([r.estimate / r.error for r in group], [0.0, 0.5, 1.0])
        lines.append(
            f"| {name} | {len(group)} | {sum(r.met for r in group)} | {times[0]:.2f} | {times[1]:.1f} | {times[2]:.0f} "
            f"| {np.median([r.grids for r in group]):g} | {ratios[0]:.2f} | {ratios[1]:.2f} | {ratios[2]:.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=11, help="timed calls of each case (default 11)")
    parser.add_argument("--cases", action="store_true", help="print every case")
    options = parser.parse_args()
    warm_up()
    rows = []
    for bending, grasp, drag, hold in product(BENDING, GRASPS, DRAGS, HOLDS):
        name = f"EI {bending:g}, at {grasp:g} m, drag {drag:g}"
        make = partial(scene, bending, grasp, drag, hold)
        rows.append(row(name, f"{PLANE}, {hold}", make, options.repeats))
    for bending, turn, start in product(BENDING, TURNS, STARTS):
        make = partial(between_clamps, bending, turn, start)
        rows.append(row(f"EI {bending:g}, {turn}", f"between two clamps, {start}", make, options.repeats))
    for r in rows if options.cases else ():
        said = f"error {1e3 * r.error:.2f} mm, estimate {1e3 * r.estimate:.2f} mm, {r.grids} grids, the last {r.grid}"
        print(f"{r.case}, {r.group}: {1e3 * r.time:.2f} ms, {said}{'' if r.met else ', not met'}")
    print(table(rows))
    print(machine_line())


if __name__ == "__main__":
    main()
