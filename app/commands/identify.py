"""What ``dlo identify`` and ``dlo validate`` do."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np
import orjson
from pydantic import ValidationError

from app.commands.errors import NOT_CONVERGED, CommandError, in_lines
from app.commands.files import check_outputs, for_people, make_folder, read_input, write_output
from app.http.fields import BadField, bad_fields
from app.schemas.cable import CableModel
from app.schemas.convert import cable_of
from dlocore import Cable, SceneError
from dlocore.recordings import Recording, load_recording

if TYPE_CHECKING:
    from dlocore.identify import Progress
    from dlocore.identify.validation import CableValidation, WireValidation


def identify(
    recordings: list[str], *, names: list[str] | None, cable: str | None, output: str, report: str | None, n_u: int
) -> int:
    """Identify a cable from recordings, write it as JSON, and write a report if one is requested.

    Args:
        recordings: files of the recordings.
        names: names of the parameters; None: the default ones.
        cable: file of what is known of the cable; None: only what the recordings say.
        output: file for the cable, "-" for standard output.
        report: file for the report, None for none.
        n_u: control points along the cable.

    Raises:
        CommandError: a recording, or the cable, can't be read or used, or an output can't be written.
    """
    from app.reports.identification import document_of_identification, report_of
    from dlocore.identify import Resolution
    from dlocore.identify import identify as find
    from dlocore.identify.parameters import DEFAULT

    beside = [str(Path(path).with_suffix(".json")) for path in recordings if Path(path).suffix == ".csv"]
    check_outputs({"--output": output, "--report": report}, [*recordings, *beside, *([] if cable is None else [cable])])
    known = None if cable is None else _read_cable(cable)
    try:
        loaded = [_load(path) for path in recordings]
        wanted = DEFAULT if names is None else tuple(names)
        found = find(loaded, known, names=wanted, resolution=Resolution(n_u=n_u), on_progress=_show)
    except SceneError as error:
        raise CommandError(str(error)) from None
    document = document_of_identification(found)
    write_output(output, orjson.dumps(document, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY))
    if report is not None:
        write_output(report, report_of(found, ", ".join(Path(r).stem for r in recordings)).encode())
    for p in found.parameters:
        value = f"{p.value:<10.4g} {p.low:.3g} to {p.high:.3g} {p.unit}" if p.identifiable else "not identifiable"
        print(f"{p.name:<24} {value}", file=sys.stderr)
    print(found.message, file=sys.stderr)
    return 0 if found.status == "converged" else NOT_CONVERGED


def _read_cable(file: str) -> Cable:
    """Return the cable of a JSON file, which is the whole document or its `cable`.

    Raises:
        CommandError: it can't be read, or is not a cable; the message names the file and the fault.
    """
    try:
        body = orjson.loads(read_input(file))
        if isinstance(body, dict) and "cable" in body:
            body = body["cable"]
        return cable_of(CableModel.model_validate(body))
    except orjson.JSONDecodeError as error:
        raise CommandError(f"{file}: it is not JSON: {error}") from None
    except ValidationError as error:
        raise CommandError(f"{file}: {in_lines(bad_fields(error.errors(), body, CableModel))}") from None
    except SceneError as error:
        raise CommandError(f"{file}: {in_lines([BadField.from_scene_error(error)])}") from None


def _load(path: str) -> Recording:
    try:
        return load_recording(path)
    except OSError as error:
        raise CommandError(f"can't read {path}: {error.strerror or error}") from None


def _show(progress: "Progress") -> None:
    values = "  ".join(f"{name} {value:.4g}" for name, value in list(progress.values.items())[:5])
    print(f"{progress.iteration:>3}  median {1e3 * progress.distance:6.2f} mm  {values}", file=sys.stderr, flush=True)


def validate(datasets: list[str], *, fit: int | None, models: list[str], json: str | None, plots: str | None) -> int:
    """Run the published protocols on data sets and print the table.

    Args:
        datasets: files, or folders of files.
        fit: windows of each cable to fit on; None: the default number.
        models: which of "scalars" and "bends".
        json: file for all numbers, "-" for standard output, None for none.
        plots: folder for the plots, None for none.

    Raises:
        CommandError: a data set can't be read or used, or an output can't be written.
    """
    from app.reports.validation_plots import plots_of
    from dlocore.identify.datasets import FIT, PUBLISHED, PUBLISHED_BY, dataset_files, load_datasets
    from dlocore.identify.validation import Model, each_repeat, validate_cable, validate_wire
    from dlocore.machine import machine_line

    files = dataset_files([Path(d) for d in datasets])
    read = [str(file) for npz in files for file in (npz, npz.with_suffix(".json"))]
    check_outputs({"--json": json}, read, {"--plots": plots})
    allowed = get_args(Model)
    if not set(models) <= set(allowed) or len(set(models)) < len(models):
        raise CommandError(
            f"--models: got {','.join(models)!r}. Allowed: {' or '.join(allowed)}, or both, separated by a comma."
        )
    table = partial(print, file=for_people(json), flush=True)
    try:
        cables, wires = load_datasets([Path(d) for d in datasets], FIT if fit is None else fit)
        if plots is not None:
            make_folder(plots)
        table(machine_line())
        out: list[dict[str, Any]] = []
        if cables:
            table(
                f"\nState from frames 0 and 1, all later frames open loop; L1 is the mean |dx| over frames, all "
                f"markers and coordinates [m].\npublished: {PUBLISHED_BY}\n\n"
                f"{'cable':<8}{'model':<9}{'mean':>8}{'median':>8}{'worst':>8}{'publ.':>8}{'mm/free':>9}"
                f"{'ms/seq':>8}{'x real':>8}{'stalled':>8}{'fit s':>7}"
            )
        for cable in cables:
            start = None
            for model in models:
                result = validate_cable(cable, cast(Model, model), start)
                start = result.found.candidate
                table(_row(result, PUBLISHED.get(cable.name)))
                out.append(_document(result))
        if wires:
            table(f"\n{'wire':<8}{'fitted':<50}{'rms mm':>8}{'worst':>8}   EI [N m^2] and interval (published)")
        for wire in wires:
            for names in (("bending_stiffness", "clamp_angles"), ("bending_stiffness", "clamp_angles", *_BENT)):
                settled = validate_wire(wire, names)
                published = wire.published_bending_stiffness
                table(_wire_row(settled, published))
                out.append({"wire": wire.name, "fitted": list(names), "rms": settled.rms.tolist()})
            alone = each_repeat(wire)
            table(f"{wire.name:<8}each repeat alone: {', '.join(f'{1e3 * x:.1f}' for x in alone)} mm")
            out.append({"wire": wire.name, "fitted": ["each repeat alone"], "rms": alone.tolist()})
    except SceneError as error:
        raise CommandError(str(error)) from None
    if json is not None:
        write_output(json, orjson.dumps(out, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY))
    if plots is not None:
        for name, drawn in plots_of(out, PUBLISHED).items():
            write_output(str(Path(plots) / name), drawn.encode())
    return 0


_BENT = ("rest_curvature",)


def _row(result: "CableValidation", published: float | None) -> str:
    l1, windows = result.l1, result.windows
    seconds = float(np.median([w.seconds for w in windows]))
    recorded = float(np.median([w.recorded for w in windows]))
    distance = 1e3 * float(np.mean([w.distance for w in windows]))
    known = "-" if published is None else f"{published:.4f}"
    stalled = sum(w.stalled for w in windows)
    return (
        f"{result.name:<8}{result.model:<9}{l1.mean():>8.4f}{np.median(l1):>8.4f}{l1.max():>8.4f}{known:>8}"
        f"{distance:>9.1f}{1e3 * seconds:>8.0f}{recorded / seconds:>8.0f}{stalled:>8}{result.seconds:>7.0f}"
    )


def _wire_row(result: "WireValidation", published: float | None) -> str:
    stiffness = result.found.parameters[0]
    known = "-" if published is None else f"{published:.3g}"
    return (
        f"{result.name:<8}{', '.join(result.names):<50}{1e3 * np.sqrt((result.rms**2).mean()):>8.2f}"
        f"{1e3 * result.rms.max():>8.2f}   {stiffness.value:.3g} ({stiffness.low:.2g} to {stiffness.high:.2g}; {known})"
    )


def _document(result: "CableValidation") -> dict[str, object]:
    return {
        "cable": result.name,
        "model": result.model,
        "fit_on": [fit.name for fit in result.found.fits],
        "parameters": {p.name: [p.value, p.low, p.high, p.identifiable] for p in result.found.parameters},
        "windows": {w.name: w.l1 for w in result.windows},
        "over_time": {w.name: w.over_time for w in result.windows},
        "milliseconds": {w.name: 1e3 * w.seconds for w in result.windows},
        "stalled": [w.name for w in result.windows if w.stalled],
    }
