"""The commands of ``dlo``, their options, and how they end."""

import argparse
import os
import sys
from collections.abc import Sequence
from typing import get_args

from app.commands import commands
from app.commands import identify as identify_commands
from app.commands import study as study_command
from app.commands.errors import FAILED, CommandError
from dlocore.calibration import STAR
from dlocore.machine import program_version
from dlocore.scene.scene import Method

_DESCRIPTION = "Predict how a cable moves when grippers move it."
_EPILOG = """examples:
  dlo serve                             page, 3D scene and API on http://127.0.0.1:8000
  dlo predict scene.json -o out.npz     the surface as NumPy arrays
  dlo predict scene.json --json -       the answer of the API without id, state and links
  dlo predict scene.json --rrd out.rrd  a recording for rerun: iterations and motion
  dlo calibrate                         what accuracy costs in time on this machine
  dlo study -o now.json --plots plots   time and true error in detail, with plots
  dlo identify shaken.npz -o cable.json the parameters of a tracked cable, with intervals
  dlo validate DATASET                  fit and predict published measurements

Settings come from the environment, e.g. DLO_PORT=9000, DLO_DATA_DIR=/srv/dlo, DLO_WORKERS=4."""
_EXIT = """exit codes: 0 converged; 1 an output can't be written; 2 bad input, described on stderr;
3 not converged (the output is still written)"""

READER_LEFT = 128 + 13  # exit code that a shell reports for a program ended by a closed pipe (SIGPIPE)

_STUDY = """examples:
  dlo study -o now.json --plots plots             the standard study, with plots
  dlo study -o now.json --compare before.json     what became slower or less accurate since
  dlo study scene.json --n-u 9 13 --n-t 13 19 25  one scene on six grids

exit codes: 0 done; 1 an output can't be written or drawn; 2 bad input, or --compare found no run in common;
4 with --compare: something changed for the worse"""
_DONE = "exit codes: 0 done; 1 an output can't be written; 2 bad input, described on stderr"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = argparse.ArgumentParser(
        prog="dlo", description=_DESCRIPTION, epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    top.add_argument("--version", action="version", version=f"dlo {program_version()}")
    subcommands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    serve = subcommands.add_parser("serve", help="run the service", description="Run the service.")
    serve.add_argument("--host", help="address to listen on (DLO_HOST; default 127.0.0.1)")
    serve.add_argument("--port", type=int, help="port to listen on, 0 for a free one (DLO_PORT; default 8000)")
    serve.set_defaults(run=lambda options: commands.serve(options.host, options.port))

    predict = subcommands.add_parser(
        "predict",
        help="predict one scene",
        description="Predict the motion of the cable of one scene, given as the JSON that the API takes.",
        epilog=_EXIT,
    )
    predict.add_argument("scene", help='scene as JSON, or "-" for standard input')
    predict.add_argument("-o", "--output", metavar="OUT.npz", help="write the surface, the spline and the reactions")
    predict.add_argument("--json", metavar="OUT.json", help='write the whole answer, "-" for standard output')
    predict.add_argument("--rrd", metavar="OUT.rrd", help="write a recording for rerun, with its layout")
    predict.add_argument(
        "--method",
        choices=get_args(Method),
        help="solve by this method instead of the scene's; of the scene's quality, reference uses only target_error, "
        "and takes seconds",
    )
    predict.add_argument("--deadline", type=float, metavar="S", help="stop after S seconds with the best result so far")
    predict.set_defaults(
        run=lambda o: commands.predict(
            o.scene, npz=o.output, json=o.json, rrd=o.rrd, method=o.method, deadline=o.deadline
        )
    )

    calibrate = subcommands.add_parser(
        "calibrate",
        help="measure what accuracy costs in time on this machine",
        description="Measure the errors and times of both methods on this machine and keep them in the data directory. "
        f"A star in the table: {STAR}.",
        epilog=_DONE,
    )
    calibrate.add_argument("--repeats", type=int, default=5, help="most timed calls of each solve (default 5)")
    calibrate.add_argument("--json", metavar="OUT.json", help="write the result to this file instead")
    calibrate.set_defaults(run=lambda o: commands.calibrate(repeats=o.repeats, json=o.json))

    _add_study(subcommands)

    find = subcommands.add_parser(
        "identify",
        help="identify a cable from recordings",
        description="Identify the parameters of one cable from recordings of its tracked markers.",
        epilog=_EXIT,
    )
    find.add_argument("recordings", nargs="+", metavar="RECORDING", help=".npz, or .csv with a .json of the same name")
    find.add_argument(
        "-o", "--output", metavar="CABLE.json", default="-", help='write the cable; "-" (default) prints it'
    )
    find.add_argument("--report", metavar="OUT.html", help="write a page with fits, errors and intervals")
    find.add_argument(
        "--parameters",
        metavar="NAMES",
        type=_listed,
        help="parameters to identify, separated by commas (default: bending_stiffness, drag, drag_quadratic and "
        "bending_damping); also torsional_stiffness, linear_density, length_ratio, turn, yield_strain, clamp_angles, "
        "marker_offsets, rest_curvature",
    )
    find.add_argument(
        "--cable",
        metavar="KNOWN.json",
        help="what is known of the cable, and first guesses: a cable as in a scene, a scene, or an output of this "
        "command",
    )
    find.add_argument("--n-u", type=int, default=13, help="control points along the cable (default 13)")
    find.set_defaults(
        run=lambda o: identify_commands.identify(
            o.recordings, names=o.parameters, cable=o.cable, output=o.output, report=o.report, n_u=o.n_u
        )
    )

    check = subcommands.add_parser(
        "validate",
        help="compare with published measurements",
        description="Fit cables on some windows of published motion capture and predict the others; fit hanging wires.",
        epilog=_DONE,
    )
    check.add_argument("datasets", nargs="+", metavar="DATASET", help="files, or folders of files (docs/validation.md)")
    check.add_argument("--fit", type=int, help="windows of each cable to fit on (default 4)")
    check.add_argument(
        "--models",
        type=_listed,
        default="scalars,bends",
        help="scalars (four numbers), bends (also the rest shape and the clamps), or both separated by a comma",
    )
    check.add_argument("--json", metavar="OUT.json", help="write all numbers")
    check.add_argument("--plots", metavar="FOLDER", help="write the plots of docs/validation.md, as SVG")
    check.set_defaults(
        run=lambda o: identify_commands.validate(o.datasets, fit=o.fit, models=o.models, json=o.json, plots=o.plots)
    )

    warmup = subcommands.add_parser(
        "warmup", help="compile the solver", description="Compile the solver now, so that the first solve is fast."
    )
    warmup.set_defaults(run=lambda options: commands.warmup())
    return top


def _add_study(subcommands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    study = subcommands.add_parser(
        "study",
        help="measure what accuracy costs in time, draw plots, compare with an earlier study",
        description="Run scenes over grids, thresholds, methods and sets of effects, and measure time and true error.",
        epilog=_STUDY,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    study.add_argument("scenes", nargs="*", help="scenes as JSON; absent: the paper's four grasps and a hanging cable")
    study.add_argument("-o", "--output", metavar="OUT.json", help="write the study, for later comparison")
    study.add_argument(
        "--plots", metavar="FOLDER", help="write plots to this folder (needs matplotlib, the extra `plots`)"
    )
    study.add_argument(
        "--compare", metavar="OLD.json", help="report what became slower or less accurate (then exit code 4)"
    )
    study.add_argument("--grids", nargs="+", metavar="NUxNT", help="grids, e.g. 9x13 17x25")
    study.add_argument("--n-u", nargs="+", type=int, metavar="N", help="with --n-t: every n_u with every n_t")
    study.add_argument("--n-t", nargs="+", type=int, metavar="N", help="with --n-u: every n_u with every n_t")
    study.add_argument("--deltas", nargs="+", type=float, metavar="M", help="thresholds on the update [m]")
    study.add_argument("--methods", nargs="+", metavar="NAME", help="march, spacetime, paper")
    study.add_argument(
        "--effects", nargs="+", metavar="SET", help="sets of effects: auto, all, or switches such as twist=off,drag=on"
    )
    study.add_argument("--parts", nargs="+", metavar="PART", help="runs, scaling, effects; absent: all")
    study.add_argument(
        "--judge", choices=("march", "reference"), default="march", help="solution that errors are distances to"
    )
    study.add_argument("--repeats", type=int, default=5, help="most timed calls of each solve (default 5)")
    study.add_argument("--estimate", action="store_true", help="let the solves also estimate their errors")
    study.set_defaults(run=lambda o: study_command.study(o))


def _listed(given: str) -> list[str]:
    """Return the names of a list separated by commas."""
    return [name.strip() for name in given.split(",")]


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the arguments ask for, and return its exit code."""
    if sys.stderr is None:  # closed by the caller
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 - for as long as the process lives
    options = parser().parse_args(arguments)
    try:
        code: int = options.run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except CommandError as error:
        print(f"dlo: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_LEFT
    except OSError as error:  # a full disk, or a folder of the service that can't be used
        print(f"dlo: {error.filename or 'standard output'}: {error.strerror or error}", file=sys.stderr)
        return FAILED
    return code
