"""The one error that a user sees: what is wrong, where, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

DECIMAL_COMMA = "a decimal comma? write 20.5, not 20,5"


class InputError(Exception):
    """Input that cannot be used. Shown as one line; the program ends with exit code 2."""

    def __init__(
        self, message: str, file: str | Path | None = None, line: int | None = None, column: int | None = None
    ) -> None:
        self.message = " ".join(message.splitlines())  # a quoted cell may hold line ends
        self.file = None if file is None else str(file)
        self.line = line
        self.column = column
        super().__init__(str(self))

    def __str__(self) -> str:
        where = [str(part) for part in (self.file, self.line, self.column) if part is not None]
        return f"{':'.join(where)}: {self.message}" if where else self.message


class WorkError(Exception):
    """The input was right but the work failed (a port went away, a fit cannot be done). Exit code 1."""


def in_words(error: BaseException) -> str:
    """Return what a user is told of an error: what is none of these is a defect of the tool."""
    known = isinstance(error, InputError | WorkError)
    return str(error) if known else f"a defect of the tool: {type(error).__name__}: {error}"


class RefusedError(WorkError):
    """The board answered that it does not do what it was asked to: it is there, and goes on.

    `said` are the lines that came before the refusal and belong to it: which settings do not fit, what a self-test found.
    """

    def __init__(self, refusal: str, said: Sequence[str] = ()) -> None:
        self.refusal = refusal
        self.said = list(said)
        super().__init__("; ".join([refusal, *said]))
