"""Reading and writing of commands: files, and standard input and output by the name "-"."""

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

from app.commands.errors import FAILED, CommandError
from dlocore.files import write_whole

STANDARD = "-"


def read_input(path: str) -> bytes:
    """Read a file, "-" for standard input.

    Raises:
        CommandError: it can't be read.
    """
    if path == STANDARD:
        if sys.stdin is None:
            raise CommandError("standard input is closed")
        return sys.stdin.buffer.read()
    if path == "":
        raise CommandError('an input needs a name: that of a file, or "-" for standard input')
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise CommandError(f"can't read {path}: {error.strerror}") from None


def check_outputs(
    outputs: Mapping[str, str | None], inputs: Sequence[str] = (), folders: Mapping[str, str | None] | None = None
) -> None:
    """Refuse outputs that can't be written, or that overwrite each other or an input, before any work is done for them.

    Args:
        outputs: files by the option that requests them; None if the option is absent.
        inputs: files that are read.
        folders: folders by their option, which are created if they are missing.

    Raises:
        CommandError: an output can't be written, or is the input or another output.
    """
    taken = {str(Path(path).resolve()): "the input" for path in inputs if path != STANDARD}
    for option, path in outputs.items():
        if path is None:
            continue
        place, shared = path, False
        if path != STANDARD:
            _check_file(path)
            place = str(Path(path).resolve())
            shared = is_device(path)
        elif sys.stdout is None:
            raise CommandError(f"{option}: standard output is closed", FAILED)
        if place in taken and not shared:
            raise CommandError(f"{option}: got {path}. Allowed: a file of its own, not that of {taken[place]}.")
        taken[place] = option
    for path in (folders or {}).values():
        if path is not None:
            _check_folder(path)


def is_device(path: str) -> bool:
    """Return whether the path exists but is no regular file, so that it takes all that is written to it."""
    return Path(path).exists() and not Path(path).is_file()


def _check_file(path: str) -> None:
    file = _named(path)
    if file.is_dir():
        raise _unwritable(path, "Is a directory")
    if not file.parent.exists():
        raise _unwritable(path, f"there is no folder {file.parent}")
    _check_made(path, file.parent, file if file.exists() else file.parent)


def _check_folder(path: str) -> None:
    folder = _named(path)
    made = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    _check_made(path, made, made)


def make_folder(path: str) -> None:
    """Create a folder for outputs if it is missing, before any work is done for them."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(path, error.strerror) from None


def _named(path: str) -> Path:
    if path == "":
        raise CommandError("an output needs a name", FAILED)
    return Path(path)


def _check_made(path: str, folder: Path, written: Path) -> None:
    """Refuse an output if `folder` is no folder, or if `written`, which exists, is not writable."""
    if not folder.is_dir():
        raise _unwritable(path, f"{folder} is not a folder")
    if not os.access(written, os.W_OK):
        raise _unwritable(path, "Permission denied")


def _unwritable(path: str, reason: str | None) -> CommandError:
    return CommandError(f"can't write {path}: {reason}", FAILED)


def write_output(path: str, content: bytes) -> None:
    """Write a file, whole or not at all; "-" for standard output.

    Raises:
        CommandError: it can't be written.
        BrokenPipeError: the reader of standard output has closed it.
    """
    try:
        if path == STANDARD:
            sys.stdout.buffer.write(content)
            sys.stdout.buffer.flush()
        else:
            write_whole(Path(path), content)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise _unwritable("standard output" if path == STANDARD else path, error.strerror) from None


def for_people(*outputs: str | None) -> TextIO:
    """Return where to print a table: standard output, or standard error if data goes to standard output."""
    return sys.stderr if STANDARD in outputs else sys.stdout
