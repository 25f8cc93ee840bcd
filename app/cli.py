"""The command line: ``dlo serve``, ``predict``, ``identify``, ``validate``, ``calibrate``, ``study``, ``warmup``."""

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        from app.commands import command_line  # slow to import, and may be interrupted meanwhile

        return command_line.run(arguments)
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
