"""How commands fail: the error, and the exit codes."""

from collections.abc import Sequence

from app.http.fields import BadField

FAILED, BAD_INPUT, NOT_CONVERGED = 1, 2, 3  # exit codes


class CommandError(Exception):
    """A command can't continue; the message is for the person who ran it."""

    def __init__(self, message: str, exit_code: int = BAD_INPUT) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def in_lines(fields: Sequence[BadField]) -> str:
    """Return what is wrong with the input, one line for each field."""
    return "\n     ".join(f"{field.field}: {field.message}" for field in fields)
