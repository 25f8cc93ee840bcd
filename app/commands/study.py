"""What ``dlo study`` does."""

import argparse
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from app.commands.bar import progress_bar
from app.commands.commands import read_scene
from app.commands.errors import FAILED, CommandError
from app.commands.files import check_outputs, for_people, make_folder, write_output
from dlocore import Scene, SceneError
from dlocore.errors import repeated
from dlocore.scene.scene import EFFECTS, Switch

WORSE = 4  # exit code: the comparison found changes for the worse
_GRID = re.compile(r"(\d+)[x×](\d+)")


def study(options: argparse.Namespace) -> int:
    """Run a study, write and draw it, compare it with an earlier one, and print the results."""
    from dlocore.study import record
    from dlocore.study.compare import compare, words
    from dlocore.study.plan import StudyPlan
    from dlocore.study.running import run_study

    read = [*options.scenes, *([] if options.compare is None else [options.compare])]
    check_outputs({"--output": options.output}, read, {"--plots": options.plots})
    before = None if options.compare is None else _earlier(options.compare)
    if options.plots is not None:
        _check_matplotlib()
    try:
        plan = StudyPlan(**_asked(options))
    except SceneError as error:
        raise CommandError(_words(error, options)) from None
    if options.plots is not None:
        make_folder(options.plots)
    reached = "before any part"
    try:
        with progress_bar("measuring") as show:

            def noted(done: int, total: int, what: str) -> None:
                nonlocal reached
                reached = f"after {done} of {total} parts"
                show(done, total, what)

            measured = run_study(plan, on_progress=noted)
    except KeyboardInterrupt:
        print(f"dlo: interrupted {reached}; nothing is kept", file=sys.stderr)
        raise
    table = for_people(options.output)
    print(_table(measured), file=table)
    if options.output is not None:
        write_output(options.output, record.as_json(measured))
    if options.plots is not None:
        from dlocore.study.drawing import draw_all

        for file in draw_all(measured, Path(options.plots)):
            print(f"drew {file}", file=sys.stderr)
    if before is None:
        return 0
    comparison = compare(measured, before)
    print(f"\ncompared with {options.compare}, measured at {before.measured_at}\n{words(comparison)}", file=table)
    if comparison.compared == 0:
        raise CommandError(f"--compare: {options.compare} has no run in common with this study")
    return WORSE if comparison.worse else 0


def _words(error: SceneError, options: argparse.Namespace) -> str:
    """Return what is wrong with the plan, under the name of the option that caused it."""
    name, _, part = error.field.partition(".")
    if getattr(options, name, None) is None or name == "scenes":
        return str(error)
    return f"--{name}{part and f', {part}'}{str(error).removeprefix(error.field)}"


def _earlier(path: str) -> Any:
    from dlocore.study import record

    try:
        return record.load(Path(path))
    except OSError as error:
        raise CommandError(f"can't read {path}: {error.strerror}") from None
    except record.StudyError as error:
        raise CommandError(f"{path}: {error}") from None


def _check_matplotlib() -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise CommandError("--plots needs matplotlib: pip install -e '.[plots]'", FAILED) from None


def _asked(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of a plan that the options set; for the others the plan has its own defaults."""
    asked: dict[str, Any] = {"repeats": options.repeats, "estimate": options.estimate, "judge": options.judge}
    if options.scenes:
        asked["scenes"] = _scenes(options.scenes)
    grids = _grids(options.grids, options.n_u, options.n_t)
    if grids is not None:
        asked["grids"] = grids
    for name in ("deltas", "methods", "parts"):
        if getattr(options, name) is not None:
            asked[name] = tuple(getattr(options, name))
    if options.effects is not None:
        twice = repeated(options.effects)
        if twice is not None:
            raise CommandError(f"--effects: got {twice}. Allowed: each once.")
        asked["effects"] = {given: _switches(given) for given in options.effects}
    return asked


def _scenes(files: list[str]) -> dict[str, Scene]:
    scenes: dict[str, Scene] = {}
    for file in files:
        name = Path(file).stem
        scenes[name if name not in scenes else file] = read_scene(file)
    return scenes


def _grids(grids: list[str] | None, n_u: list[int] | None, n_t: list[int] | None) -> tuple[tuple[int, int], ...] | None:
    if (n_u is None) != (n_t is None) or (grids is not None and n_u is not None):
        raise CommandError("give --grids, or --n-u and --n-t together")
    if n_u is not None and n_t is not None:
        return tuple((u, t) for u in n_u for t in n_t)
    if grids is None:
        return None
    found = [_GRID.fullmatch(grid) for grid in grids]
    for given, match in zip(grids, found, strict=True):
        if match is None:
            raise CommandError(f"--grids: got {given!r}. Allowed: n_u and n_t as in 9x13.")
    return tuple((int(match[1]), int(match[2])) for match in found if match is not None)


def _switches(given: str) -> Mapping[str, Switch]:
    """Return the switches of a set of effects, given as on the command line."""
    if given == "auto":
        return {}
    if given == "all":
        return cast(dict[str, Switch], dict.fromkeys(EFFECTS, "on"))
    pairs = [part.partition("=") for part in given.split(",")]
    if not all(sign for _, sign, _ in pairs):
        raise CommandError(f"--effects: got {given!r}. Allowed: auto, all, or switches as in twist=off,drag=on.")
    twice = repeated(name for name, _, _ in pairs)
    if twice is not None:
        raise CommandError(f"--effects: got {given!r}. Allowed: {twice} once.")
    return cast(dict[str, Switch], {name: value for name, _, value in pairs})


def _table(measured: Any) -> str:
    """Return the results as text: a table of the runs, and lines for the costs by size and by effect.

    The table has thresholds where they differ, and error estimates where there are any.
    """
    thresholds = len({run.delta for run in measured.runs}) > 1
    estimates = any(run.estimate is not None for run in measured.runs)
    head = f"{'scene':32} {'effects':10} {'method':10} {'grid':>9}"
    head += f" {'delta [m]':>9}" if thresholds else ""
    head += f" {'time [ms]':>11} {'error [mm]':>11}"
    head += f" {'estimate [mm]':>13}" if estimates else ""
    lines = [f"{head}  status"] if measured.runs else []
    for run in measured.runs:
        grid = f"{run.n_u} x {run.n_t}"
        line = f"{run.scene[:32]:32} {run.effects[:10]:10} {run.method:10} {grid:>9}"
        line += f" {run.delta:9g}" if thresholds else ""
        line += f" {1e3 * run.wall_time:11.3g} {1e3 * run.error:11.3g}"
        if estimates:
            line += f" {'-' if run.estimate is None else format(1e3 * run.estimate, '.3g'):>13}"
        lines.append(f"{line}  {run.status}")
    for row in measured.scaling:
        part = row.method if row.method == "march" else f"one iteration of {row.method}"
        lines.append(f"cost against {row.variable} = {row.value:g}: {part} takes {1e3 * row.wall_time:.3g} ms")
    for cost in measured.effects:
        times = f"{1e3 * cost.present:.3g} ms, without it {1e3 * cost.absent:.3g} ms"
        lines.append(f"cost of {cost.effect}: a march with it takes {times}")
    lines += [f"not measured: {refused}" for refused in measured.refused]
    return "\n".join(lines)
