"""How a command fails."""

FAILED, BAD_INPUT, NOT_CONVERGED = 1, 2, 3  # exit codes


class CommandError(Exception):
    """A command that can't go on; the message is for the person who ran it."""

    def __init__(self, message: str, exit_code: int = BAD_INPUT) -> None:
        super().__init__(message)
        self.exit_code = exit_code
