"""Comma-separated tables of numbers: read whole, or refused with file, line and column."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...errors import DECIMAL_COMMA, InputError
from .writing import read_text

if TYPE_CHECKING:
    import pandas as pd

MAX_LINE = 100_000
"""A line longer than this (characters) is not a log."""
UNMEASURED = ["", "nan", "NaN", "NAN"]
"""Cells of what was not measured, as programs write them."""


class Table:
    """A comma-separated file: what its comments and its header say, and its rows when they have been read."""

    frame: pd.DataFrame
    """The rows: numbers, but for some columns of words."""
    lines: np.ndarray
    """1-based line of each row."""
    unfinished = False
    """The last line has no end: its last number may have been cut off."""
    cut_off = False
    """The last line was cut off in the middle and is left out."""

    def __init__(self, path: str | Path) -> None:
        """Read a file as far as its header."""
        self.path = str(path)
        self.keys: dict[str, str] = {}
        """What `# key: value` lines said above the header."""
        self.faults: list[str] = []
        """What a recorder wrote of the board's faults when they came."""
        text = read_text(self.path)
        if not text.strip():
            raise self.refuse("the file is empty")
        self._ended = text.endswith("\n")
        kept, numbers = self._kept(text)
        self.header_line = numbers[0]
        self.names, self.header_columns = self._header(kept[0])
        """Of each column: its name, and at which character (from 1) that begins."""
        self._body, self._numbers = kept[1:], numbers[1:]

    def refuse(self, message: str, line: int | None = None, column: int | None = None) -> InputError:
        """Return a refusal of the file, at a place in it."""
        return InputError(message, self.path, line, column)

    def refuse_header(self, message: str, name: str = "") -> InputError:
        """Return a refusal of the header, at a name in it."""
        at = self.header_columns[self.names.index(name)] if name else 1
        return self.refuse(message, self.header_line, at)

    def refuse_cell(self, message: str, row: int, name: str) -> InputError:
        """Return a refusal of a cell that has been read."""
        line = int(self.lines[row])
        cells = read_text(self.path).split("\n")[line - 1].split(",")[: self.names.index(name)]
        return self.refuse(message, line, 1 + sum(len(one) + 1 for one in cells))

    def read_rows(self, text_columns: Iterable[str] = ()) -> Table:
        """Read the rows, numbers or empty cells but for some columns; return the table."""
        body, cells = self._body, len(self.names)
        self.cut_off = not self._ended and len(body) > 3 and body[-1].count(",") < cells - 1
        self.unfinished = not self._ended and not self.cut_off
        if self.cut_off:
            body.pop()
        if not body:
            raise self.refuse("there is a header but no row", self.header_line)
        for row, line in enumerate(body):
            if (found := line.count(",") + 1) != cells:
                missing = "a cell is missing: leave it empty between two commas"
                advice = "cut off here?" if row == len(body) - 1 else DECIMAL_COMMA if found > cells else missing
                if found == cells + 1 and line.rstrip().endswith(","):
                    advice = "a comma too many at its end"
                message = f"{found} cells where the header has {cells}: {advice}"
                raise self.refuse(message, self._numbers[row], len(line) + 1)
        self.lines = np.asarray(self._numbers[: len(body)], dtype=np.int64)
        words = {name for name in self.names if name == "state" or name.startswith("note_")} | set(text_columns)
        self.frame = self._frame(words)
        return self

    def _kept(self, text: str) -> tuple[list[str], list[int]]:
        """Return the header and the rows, and the line of each; keep what the comments say."""
        kept: list[str] = []
        numbers: list[int] = []
        for number, line in enumerate(text.removesuffix("\n").split("\n"), start=1):
            if len(line) > MAX_LINE:
                raise self.refuse(f"a line of {len(line)} characters: not a log (line ends missing?)", number)
            if line.startswith("#"):
                name, colon, value = line[1:].partition(":")
                if re.fullmatch(r" ?fault at (?:the end|[\d.]+ s)", name):
                    self.faults.append(f"{name.strip()}: {value.strip()}")
                elif colon and not kept:  # further down a board's status is kept
                    self.keys.setdefault(name.strip().lower(), value.strip())
            elif line.strip():
                kept.append(line)
                numbers.append(number)
        if not kept:
            raise self.refuse("only comments: there is no header line", 1)
        for separator, called in ((";", "semicolons"), ("\t", "tabs"), (" ", "spaces")):
            if separator in kept[0].strip() and "," not in kept[0]:
                raise self.refuse(
                    f"columns are separated by {called}: save with commas and decimal points "
                    "(`ninespring import --map` converts)",
                    numbers[0],
                    kept[0].index(separator) + 1,
                )
        # quotes around plain cells mean nothing; a comma inside of them shows in the count of cells
        return [line.replace('"', "") for line in kept] if '"' in text else kept, numbers

    def _header(self, header: str) -> tuple[list[str], list[int]]:
        """Return the names of a header and the column at which each begins."""
        cells = header.split(",")
        names = [cell.strip() for cell in cells]
        if all(number_in(name) is not None for name in names):
            said = "the first line holds numbers: begin the file with a line of column names (time_s,i1_a,t1_c,...)"
            raise self.refuse(said, self.header_line, 1)
        starts = [1 + sum(len(cell) + 1 for cell in cells[:k]) for k in range(len(cells))]
        for k, name in enumerate(names):
            if name == "":
                too_many = ": a comma too many at the end of the line?" if k == len(names) - 1 else ""
                raise self.refuse(f"column {k + 1} has no name{too_many}", self.header_line, starts[k])
            if name in names[:k]:
                raise self.refuse(f"column '{name}' is there twice", self.header_line, starts[k])
        return names, starts

    def _frame(self, words: set[str]) -> pd.DataFrame:
        """Return the rows as numbers, but for the columns of `words`; the first cell that is none is refused."""
        import pandas as pd

        try:
            frame = pd.read_csv(
                io.StringIO("\n".join(self._body)),
                header=None,
                names=self.names,
                dtype={name: (str if name in words else np.float64) for name in self.names},
                na_values=UNMEASURED,
                keep_default_na=False,
                skipinitialspace=True,
                skip_blank_lines=False,
                quoting=3,
                index_col=False,
                low_memory=False,
            )
        except (ValueError, OverflowError):
            raise self._bad_cell(words) from None
        numeric = frame[[name for name in self.names if name not in words]]
        if np.isfinite(numeric.to_numpy(float)).sum() != int(numeric.notna().to_numpy().sum()):
            raise self._bad_cell(words)
        return frame

    def _bad_cell(self, words: set[str]) -> InputError:
        """Return the refusal of the first cell that is no number."""
        for row, line in enumerate(self._body):
            if [cell.strip() for cell in line.split(",")] == self.names:
                said = "the header is there again: two logs in one file? Make two files"
                return self.refuse(said, self._numbers[row], 1)
            if row == 0 and all(number_in(cell) is None for cell in line.split(",")):
                said = "a line of words under the names: delete it, or begin it with # (what is in other units, `ninespring import --map` converts)"
                return self.refuse(said, self._numbers[row], 1)
            for name, cell in zip(self.names, line.split(","), strict=True):
                value = cell.strip()
                if name in words or value in UNMEASURED or (number_in(value) is not None and "_" not in value):
                    continue
                advice = "leave the cell empty if not measured"
                if re.fullmatch(r"[ivuf][0-9].*|fan", name):
                    advice = "give the number that it was"
                if name == "time_s":
                    advice = "times are seconds (`ninespring import --map`, unit = iso, reads clocks with a date)"
                shown = value if len(value) <= 20 else value[:17] + "..."
                return self.refuse_cell(f"{name} is '{shown}', not a number: {advice}", row, name)
        return self.refuse("a cell is not a number")


def read_table(path: str | Path, text_columns: Iterable[str] = ()) -> Table:
    """Read a comma-separated file with a header, `#` comments, and numbers or empty cells."""
    return Table(path).read_rows(text_columns)


def number_in(text: str) -> float | None:
    """Return the finite number that a text is, None where it is none."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
