"""Speed and accuracy on the paper's case: `python -m benchmarks.paper_case [--reference FOLDER] [--json FILE]`.

A straight cable on a frictionless table (L = 1 m, D = 5 mm, 0.05 kg/m, EA = 16 EI/D^2, drag 0.05 N s/m^2) is grasped at
0, 0.25, 0.5 or 0.8 m and moved sideways by 0.5 m in 1.6 s. Times are medians of whole calls of `predict`, each on a new
scene: the kernels are compiled, but nothing is kept from one call to the next. One thread. Errors are distances to the
project's own march, refined until it changes by less than 0.1 mm. The explicit rod is measured for comparison: it is
compiled too, but its time includes building the tables of the grasp's path in Python.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import rod
from benchmarks.machine import machine, machine_line
from benchmarks.rod_reference import scene_of
from dlocore import Cable, Environment, Grasp, Move, Prediction, Quality, Scene, Straight, Table, predict, warm_up

Floats = NDArray[np.float64]

BENDING = (1e-2, 1e-3, 1e-4)  # [N m^2]
GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m]
ON_GRID = partial(Quality, n_u=9, n_t=13, keep_grid=True)  # a row that names a grid is of that grid, however it errs
METHODS = {
    "march": ON_GRID(method="march"),
    "march, no estimate": ON_GRID(method="march", estimate=False),
    "spacetime": ON_GRID(delta=1e-5),
    "spacetime, no estimate": ON_GRID(delta=1e-5, estimate=False),
    "auto": Quality(),
    "paper": ON_GRID(delta=1e-5, method="paper"),
}
RODS = (20, 40)  # elements
REFINEMENTS = ((33, 65), (49, 97), (65, 129), (97, 193), (129, 257), (129, 513))  # (n_u, n_t) of the reference
STILL = 1e-4  # [m]: a refinement that moves the reference by less ends it
PATIENCE = 1.0  # [s] for the repeats of one case, of which there are at least three


@dataclass(frozen=True)
class Result:
    """One method on one case: times [s], errors [m], and what the method said of itself."""

    method: str
    case: str
    bending_stiffness: float
    grasp: float
    grid: str
    median: float
    fastest: float
    repeats: int
    status: str
    iterations: int
    rms: float
    final: float
    worst: float
    estimate: float | None


def paper_scene(bending: float, grasp: float, quality: Quality) -> Scene:
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=bending)
    return Scene(
        cable=cable,
        shape=Straight(),
        grasps=(Grasp(u=grasp, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6)),),
        environment=Environment(drag=0.05, table=Table()),
        quality=quality,
    )


def reference(scene: Scene) -> tuple[Floats, float]:
    """Return the converged motion (33, 101, 3) [m], and by how much the last refinement moved it [m]."""
    before: Floats | None = None
    moved = np.inf
    for n_u, n_t in REFINEMENTS:
        quality = Quality(n_u=n_u, n_t=n_t, method="march", estimate=False)
        prediction = predict(replace(scene, quality=quality), keep_grid=True)
        if prediction.status != "converged":
            raise RuntimeError(f"the reference did not converge: {prediction.message}")
        now = prediction.surface.sample()[2][..., :3]
        if before is not None:
            moved = float(np.linalg.norm(now - before, axis=-1).max())
        if moved < STILL:
            return now, moved
        before = now
    raise RuntimeError(f"the finest reference still moved by {1e3 * moved:.2g} mm")


def timed(call: Callable[[Scene], Any], fresh: Callable[[], Scene], repeats: int) -> tuple[Any, list[float]]:
    """Return the last answer of `call` and the time of each call [s], every one on a new scene."""
    times: list[float] = []
    answer = None
    while len(times) < repeats and (sum(times) < PATIENCE or len(times) < 3):
        scene = fresh()
        began = time.perf_counter()
        answer = call(scene)
        times.append(time.perf_counter() - began)
    return answer, times


def errors(positions: Floats, truth: Floats) -> dict[str, float]:
    """Return the root mean square over the surface, the worst of the final shape and the worst of all [m]."""
    away = np.linalg.norm(positions - truth, axis=-1)
    return {"rms": float(np.sqrt((away**2).mean())), "final": float(away[-1].max()), "worst": float(away.max())}


def measure(method: str, case: str, fresh: Callable[[], Scene], truth: Floats, repeats: int) -> Result:
    """Measure `predict` on the scenes that `fresh` makes."""
    scene = fresh()
    prediction: Prediction
    prediction, times = timed(predict, fresh, repeats)
    accuracy = prediction.accuracy
    return Result(
        method=method,
        case=case,
        bending_stiffness=float(scene.cable.bending_stiffness or 0.0),
        grasp=scene.grasps[0].u,
        grid=f"{accuracy.n_u} x {accuracy.n_t}",
        median=float(np.median(times)),
        fastest=min(times),
        repeats=len(times),
        status=prediction.status,
        iterations=len(prediction.iterations),
        estimate=accuracy.error_estimate,
        **errors(prediction.surface.sample()[2][..., :3], truth),
    )


def measure_rod(elements: int, case: str, scene: Scene, truth: Floats, repeats: int) -> Result:
    """Measure the explicit discrete elastic rod; without a table and its weight, which it does not have."""
    scene = replace(scene, environment=Environment(gravity=(0.0, 0.0, 0.0), drag=scene.environment.drag))
    (_, nodes, positions), times = timed(lambda s: rod.simulate(s, elements=elements), lambda: scene, repeats)
    return Result(
        method=f"explicit rod, {elements} elements",
        case=case,
        bending_stiffness=float(scene.cable.bending_stiffness or 0.0),
        grasp=scene.grasps[0].u,
        grid=str(elements),
        median=float(np.median(times)),
        fastest=min(times),
        repeats=len(times),
        status="converged",
        iterations=0,
        estimate=None,
        **errors(rod.sample(scene, nodes, positions, np.linspace(0.0, scene.cable.length, 101)), truth),
    )


def run_paper(repeats: int) -> tuple[list[Result], float]:
    """Measure every method on the twelve cases; the results, and by how much the references moved last [m]."""
    results = []
    moved = 0.0
    for bending, grasp in product(BENDING, GRASPS):
        case = f"EI {bending:g}, grasp {grasp:g} m"
        truth, last = reference(paper_scene(bending, grasp, Quality()))
        moved = max(moved, last)
        for method, quality in METHODS.items():
            results.append(measure(method, case, partial(paper_scene, bending, grasp, quality), truth, repeats))
        scene = paper_scene(bending, grasp, Quality())
        results += [measure_rod(elements, case, scene, truth, repeats) for elements in RODS]
    return results, moved


def run_stored(folder: Path) -> list[Result]:
    """Measure on stored solutions: pairs of .npz (t, u, pos) and .json as `benchmarks.rod_reference` reads them."""
    results = []
    for file in sorted(folder.glob("*.json")):
        stored = np.load(file.with_suffix(".npz"))
        scene = scene_of(json.loads(file.read_text()))
        truth = np.zeros((*stored["pos"].shape[:2], 3))
        truth[..., :2] = stored["pos"]
        for method in ("march", "spacetime", "auto"):
            asked = replace(scene, quality=METHODS[method])
            results.append(measure(method, file.stem, partial(replace, asked), truth, 3))
        own = errors(reference(scene)[0], truth)["worst"]
        results.append(replace(results[-1], method="own converged march", grid="", rms=own, final=own, worst=own))
    return results


def table(results: list[Result]) -> str:
    """Return a table with one row for each stiffness and method, over the four grasps."""
    lines = [
        f"{'EI':>7} {'method':24} {'largest':>9} {'median':>8} {'slowest':>8}  {'iterations':12} {'solved':>6} "
        f"{'rms':>8} {'final':>8} {'worst':>8} {'estimate':>8}",
        f"{'N m^2':>7} {'':24} {'grid':>9} {'ms':>8} {'ms':>8}  {'by grasp':12} {'':>6} "
        f"{'mm':>8} {'mm':>8} {'mm':>8} {'mm':>8}",
    ]
    for bending in BENDING:
        lines.append("")
        for method in dict.fromkeys(r.method for r in results):
            rows = [r for r in results if r.method == method and r.bending_stiffness == bending]
            medians = [1e3 * r.median for r in rows]
            counts = " ".join(str(r.iterations) for r in rows) if rows[0].iterations else "-"
            estimates = [r.estimate for r in rows if r.estimate is not None]
            lines.append(
                f"{bending:7.0e} {method:24} {max((r.grid for r in rows), key=_size):>9} "
                f"{np.median(medians):8.3f} {max(medians):8.3f}  {counts:12} "
                f"{sum(r.status == 'converged' for r in rows)} of {len(rows)} "
                f"{_mm(max(r.rms for r in rows))} {_mm(max(r.final for r in rows))} {_mm(max(r.worst for r in rows))} "
                f"{_mm(max(estimates)) if estimates else '-':>8}"
            )
    return "\n".join(lines)


def _size(grid: str) -> int:
    return int(grid.split(" ")[0])


def _mm(metres: float) -> str:
    return f"{1e3 * metres:8.2f}" if metres < 10.0 else f"{1e3 * metres:8.0e}"


def stored_table(results: list[Result]) -> str:
    """Return a table with one row for each stored case and method."""
    head = f"{'case':46} {'method':20} {'solved':14} {'rms mm':>8} {'final mm':>8} {'worst mm':>8}"
    rows = [f"{r.case:46} {r.method:20} {r.status:14} {_mm(r.rms)} {_mm(r.final)} {_mm(r.worst)}" for r in results]
    return "\n".join([head, *rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=50, help="most timed calls of each case (default 50)")
    parser.add_argument("--reference", type=Path, help="folder with stored solutions, for a further comparison")
    parser.add_argument("--json", type=Path, help="file to write every result to")
    options = parser.parse_args()
    warm_up()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    results, moved = run_paper(options.repeats)
    print(table(results))
    print()
    grasps = ", ".join(f"{u:g}" for u in GRASPS)
    print(
        f"Medians, slowest and largest over the grasps at {grasps} m; errors against a march that its last refinement"
    )
    print(f"moved by at most {1e3 * moved:.3f} mm; `estimate` is what the predictor says of its worst point.")
    print(f"{machine_line()}, load average {load:.1f} before")
    stored = run_stored(options.reference) if options.reference else []
    if stored:
        print()
        print(stored_table(stored))
    if options.json:
        content = {
            "machine": machine(),
            "load": load,
            "paper": [asdict(r) for r in results],
            "stored": [asdict(r) for r in stored],
        }
        options.json.write_text(json.dumps(content, indent=1))


if __name__ == "__main__":
    main()
