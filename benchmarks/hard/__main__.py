"""Print and save the results of each method on each named hard case: the table of docs/hard-cases.md.

    python -m benchmarks.hard --json hard.json

`march` is the method of quality "auto" with a target error of 0.5 % of the length, or on the grid of the case.
`reference` takes no grid and always has that target. `spacetime` and `paper` are given grids; where they fail on these,
no other method takes their place. The error is measured against the true answer of the case. `--cases TEXT` runs only
cases whose name contains TEXT.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.hard.cases import CASES, TARGET, Case, posed
from benchmarks.hard.judge import GAINED, HELD, LOST, MOST_STRAIN
from benchmarks.hard.laws import measure
from benchmarks.machine import machine_line
from dlocore import Quality, Scene, SceneError, predict, warm_up

GROUPS = ("geometry", "stiffness", "motion", "effects", "numbers")
METHODS = ("march", "reference", "spacetime", "paper")
GRIDS = {
    "spacetime": Quality(n_u=17, n_t=33, delta=1e-4, method="spacetime"),
    "paper": Quality(n_u=7, n_t=9, delta=1e-4, method="paper"),
}
DEADLINE, OF_REFERENCE = 60.0, 30.0  # [s]


def by_method(case: Case, method: str) -> Scene:
    """Return the scene of a case for a method.

    Raises:
        SceneError: the case must be refused.
    """
    scene = posed(case)
    if method == "reference":
        return replace(scene, quality=Quality(target_error=TARGET * scene.cable.length, method="reference"))
    if scene.quality.n_u is not None:
        return replace(scene, quality=replace(scene.quality, method=method))  # type: ignore[arg-type]
    if method == "march":
        return scene
    quality = GRIDS[method]
    return replace(scene, quality=replace(quality, delta=quality.threshold * scene.cable.length))


def row(case: Case, method: str) -> dict[str, Any]:
    """Solve a case by a method; return the result."""
    began = time.process_time()
    try:
        scene = by_method(case, method)
        deadline = OF_REFERENCE if method == "reference" else DEADLINE
        prediction = predict(scene, deadline=deadline, keep_grid=method in GRIDS)
    except SceneError as error:
        return {"status": "refused", "field": error.field}
    seconds = time.process_time() - began
    found, estimate = measure(prediction), prediction.accuracy.error_estimate
    laws = {
        "strain": found.strain > MOST_STRAIN,
        "grasp": found.held > HELD * scene.cable.length,
        "energy": found.energy is not None and found.energy > GAINED,
        "momentum": found.momentum is not None and found.momentum > LOST,
    }
    return {
        "status": prediction.status,
        "solved_by": prediction.accuracy.method,
        "seconds": seconds,
        "iterations": len(prediction.iterations),
        "estimate": None if estimate is None else estimate / scene.cable.length,
        "error": None if case.error is None else case.error(prediction),
        "within": case.within,
        "finite": found.finite,
        "broken": [name for name, broken in laws.items() if broken],
    }


def cell(found: dict[str, Any]) -> str:
    """Return a row's result as a cell of the table."""
    if found["status"] == "refused":
        return f"refused ({found['field']})"
    words = [found["status"].replace("_", " ")]
    if found["estimate"] is not None:
        words.append(f"{100 * found['estimate']:.2g} %")
    if found["error"] is not None and found["error"] > found["within"]:
        words.append(f"**off by {found['error']:.2g}**")
    if found["status"] == "converged" and found["broken"]:
        words.append("**breaks " + ", ".join(found["broken"]) + "**")
    return ", ".join(words) + f", {1e3 * found['seconds']:.0f} ms"


def table(results: dict[str, dict[str, Any]]) -> str:
    """Return the table in Markdown."""
    lines = []
    for group in GROUPS:
        lines += [
            "",
            f"### {group.capitalize()}",
            "",
            f"| case | truth | {' | '.join(METHODS)} |",
            "|---" * (2 + len(METHODS)) + "|",
        ]
        for case in CASES.values():
            if case.group == group and case.name in results:
                cells = [cell(results[case.name][method]) for method in METHODS]
                lines.append(f"| {case.name} | {case.truth} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path, help="file to write the results to")
    parser.add_argument("--cases", default="", help="only those whose name contains this")
    options = parser.parse_args()
    chosen = [case for name, case in CASES.items() if options.cases in name]
    if not chosen:
        parser.error(f"--cases: got {options.cases!r}. Allowed: a part of the name of one of {', '.join(CASES)}.")
    warm_up()
    results: dict[str, dict[str, Any]] = {}
    for case in chosen:
        results[case.name] = {method: row(case, method) for method in METHODS}
        if options.json is not None:
            options.json.write_text(json.dumps(results, indent=1))
    print(table(results))
    print()
    print(machine_line())


if __name__ == "__main__":
    main()
