"""The command line: ``dlo serve``, ``dlo predict``, ``dlo warmup``."""

import argparse
import sys
from collections.abc import Sequence
from typing import get_args

from app import commands
from dlocore.scene import Method

_DESCRIPTION = "Predict how a cable moves when grippers move it."
_EPILOG = """examples:
  dlo serve                             page, 3D scene and API on http://127.0.0.1:8000
  dlo predict scene.json -o out.npz     the surface as NumPy arrays
  dlo predict scene.json --json -       the whole answer, as the API gives it
  dlo predict scene.json --rrd out.rrd  a recording for rerun: iterations and motion

Settings come from the environment, e.g. DLO_PORT=9000, DLO_DATA_DIR=/srv/dlo, DLO_WORKERS=4."""
_EXIT = """exit codes: 0 converged; 2 bad input, named on stderr; 3 not converged (the output is still written)"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = argparse.ArgumentParser(
        prog="dlo", description=_DESCRIPTION, epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    subcommands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    serve = subcommands.add_parser("serve", help="run the service", description="Run the service.")
    serve.add_argument("--host", help="address to listen on (DLO_HOST; default 127.0.0.1)")
    serve.add_argument("--port", type=int, help="port to listen on, 0 for a free one (DLO_PORT; default 8000)")
    serve.set_defaults(run=lambda options: commands.serve(options.host, options.port))

    predict = subcommands.add_parser(
        "predict",
        help="predict one scene",
        description="Predict the motion of the cable of one scene, the same JSON as the API takes.",
        epilog=_EXIT,
    )
    predict.add_argument("scene", help='scene as JSON, or "-" for standard input')
    predict.add_argument("-o", "--output", metavar="OUT.npz", help="write the surface, spline and reactions")
    predict.add_argument("--json", metavar="OUT.json", help='write the whole answer, "-" for standard output')
    predict.add_argument("--rrd", metavar="OUT.rrd", help="write a recording for rerun, and its layout as OUT.rbl")
    predict.add_argument(
        "--method",
        choices=get_args(Method),
        help="solve by this method instead of the scene's; reference keeps only its target_error, and takes seconds",
    )
    predict.set_defaults(run=lambda o: commands.predict(o.scene, npz=o.output, json=o.json, rrd=o.rrd, method=o.method))

    warmup = subcommands.add_parser(
        "warmup", help="compile the solver", description="Compile the solver now, so that the first solve is fast."
    )
    warmup.set_defaults(run=lambda options: commands.warmup())
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    options = parser().parse_args(arguments)
    try:
        code: int = options.run(options)
    except commands.CommandError as error:
        print(f"dlo: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return 130
    return code


if __name__ == "__main__":
    sys.exit(main())
