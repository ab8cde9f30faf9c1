"""Comma-separated tables of numbers: read whole, or refused with file, line and column."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from ...errors import InputError
from .writing import read_bytes

MAX_LINE = 100_000
"""A line longer than this (characters) is not a log."""


@dataclass
class Table:
    """A comma-separated file of numbers: columns by name, and where each row stood in the file."""

    path: str
    header_line: int
    names: list[str]
    header_columns: list[int]
    """1-based character column of each name."""
    frame: pd.DataFrame
    lines: np.ndarray
    """1-based line of each row."""
    keys: dict[str, str]
    """What `# key: value` lines said above the header."""
    unfinished: bool = False
    """The last line has no end: its last number may have been cut off."""
    cut_off: bool = False
    """The last line was cut off in the middle and is left out."""
    faults: list[str] = field(default_factory=list)
    """What a recorder wrote of the board's faults when they came."""

    def where(self, row: int, name: str) -> tuple[int, int]:
        """Line and 1-based character column of a cell."""
        line = int(self.lines[row])
        with open(self.path, encoding="utf-8-sig", errors="replace", newline="") as stream:
            for number, text in enumerate(stream, start=1):
                if number == line:
                    cells = text.rstrip("\r\n").split(",")
                    return line, 1 + sum(len(c) + 1 for c in cells[: self.names.index(name)])
        return line, 1


Header = Callable[[list[str], int, list[int]], None]
"""Takes names, line and columns of a header; raises InputError where it is not the right one."""


@dataclass
class _Lines:
    """A file's lines: its header and rows, where they stand, and what the comments say."""

    kept: list[str]
    numbers: list[int]
    """1-based line of each."""
    keys: dict[str, str]
    faults: list[str]
    ended: bool
    """The last line has an end."""


def read_table(path: str | Path, text_columns: Iterable[str] = (), header_check: Header | None = None) -> Table:
    """Read a comma-separated file with a header, `#` comments, and numbers or empty cells."""
    lines = _lines_of(path, _text_of(path))
    names, starts = _names_of(path, lines.kept[0], lines.numbers[0])
    if header_check:
        header_check(names, lines.numbers[0], starts)
    body, numbers = lines.kept[1:], lines.numbers[1:]
    cut_off = not lines.ended and len(body) > 3 and body[-1].count(",") < len(names) - 1
    if cut_off:
        body.pop()
    if not body:
        raise InputError("there is a header but no row", path, lines.numbers[0])
    _refuse_ragged(path, len(names), body, numbers)
    words = {name for name in names if name == "state" or name.startswith("note_")} | set(text_columns)
    frame = _frame_of(path, names, words, body, numbers)
    return Table(
        str(path),
        lines.numbers[0],
        names,
        starts,
        frame,
        np.asarray(numbers[: len(body)], dtype=np.int64),
        lines.keys,
        not lines.ended and not cut_off,
        cut_off,
        lines.faults,
    )


def _text_of(path: str | Path) -> str:
    """Return a file's text, lines ended by a line feed; what is no text of lines is refused."""
    raw = read_bytes(path)
    if not raw.strip():
        raise InputError("the file is empty", path)
    if b"\0" in raw:
        kind = "UTF-16 text" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "not a text file (it holds NUL bytes)"
        raise InputError(f"{kind}: save the log as UTF-8 CSV", path, 1)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError("not UTF-8 text: save the log as UTF-8 CSV", path, line) from None
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _lines_of(path: str | Path, text: str) -> _Lines:
    lines = text.split("\n")
    if lines[-1] == "":
        lines.pop()
    longest = max(map(len, lines))
    if longest > MAX_LINE:
        number = next(k for k, one in enumerate(lines, start=1) if len(one) > MAX_LINE)
        raise InputError(f"a line of {longest} characters: not a log (line ends missing?)", path, number)
    out = _Lines([], [], {}, [], text.endswith("\n"))
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            name, colon, value = line[1:].partition(":")
            if re.fullmatch(r" ?fault at (?:the end|[\d.]+ s)", name):
                out.faults.append(f"{name.strip()}: {value.strip()}")
            elif colon and not out.kept:  # further down a board's status is kept
                out.keys.setdefault(name.strip().lower(), value.strip())
        elif line.strip():
            out.kept.append(line)
            out.numbers.append(number)
    if not out.kept:
        raise InputError("only comments: there is no header line", path, 1)
    for separator, called in ((";", "semicolons"), ("\t", "tabs")):
        if separator in out.kept[0] and "," not in out.kept[0]:
            raise InputError(
                f"columns are separated by {called}: save with commas and decimal points "
                "(`ninespring import --map` converts)",
                path,
                out.numbers[0],
                out.kept[0].index(separator) + 1,
            )
    if '"' in text:
        # Quotes around plain cells mean nothing. A comma inside of them shows in the count of cells.
        out.kept = [line.replace('"', "") for line in out.kept]
    return out


def _names_of(path: str | Path, header: str, line: int) -> tuple[list[str], list[int]]:
    """Return a header's names and the column at which each begins."""
    names = [name.strip() for name in header.split(",")]
    if all(_is_number(name) for name in names):
        raise InputError(
            "the first line holds numbers: begin the file with a line of column names (time_s,i1_a,t1_c,...)",
            path,
            line,
            1,
        )
    starts = [1]
    for cell in header.split(",")[:-1]:
        starts.append(starts[-1] + len(cell) + 1)
    for k, name in enumerate(names):
        if name == "":
            raise InputError(f"column {k + 1} has no name", path, line, starts[k])
        if name in names[:k]:
            raise InputError(f"column '{name}' is there twice", path, line, starts[k])
    return names, starts


def _refuse_ragged(path: str | Path, cells: int, body: list[str], numbers: list[int]) -> None:
    for row, line in enumerate(body):
        if (found := line.count(",") + 1) != cells:
            advice = (
                "cut off here?"
                if row == len(body) - 1
                else "decimal commas? write 20.5, not 20,5"
                if found > cells
                else "a cell is missing: leave it empty between two commas"
            )
            message = f"{found} cells where the header has {cells}: {advice}"
            raise InputError(message, path, numbers[row], len(line) + 1)


def _frame_of(path: str | Path, names: list[str], words: set[str], body: list[str], numbers: list[int]) -> pd.DataFrame:
    """Return the rows as numbers, but for the columns of `words`; the first cell that is none is refused."""
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(body)),
            header=None,
            names=names,
            dtype={name: (str if name in words else np.float64) for name in names},
            na_values=[""],
            keep_default_na=False,
            skipinitialspace=True,
            skip_blank_lines=False,
            quoting=3,
            index_col=False,
            low_memory=False,
        )
    except (ValueError, OverflowError):
        _refuse_first_bad_cell(path, names, words, body, numbers)
    numeric = frame[[name for name in names if name not in words]]
    if np.isfinite(numeric.to_numpy(float)).sum() != int(numeric.notna().to_numpy().sum()):
        _refuse_first_bad_cell(path, names, words, body, numbers)
    return frame


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _refuse_first_bad_cell(
    path: str | Path, names: list[str], words: set[str], body: list[str], numbers: list[int]
) -> NoReturn:
    for row, line in enumerate(body):
        at = 1
        if [cell.strip() for cell in line.split(",")] == names:
            raise InputError("the header is there again: two logs in one file? Make two files", path, numbers[row], 1)
        for name, cell in zip(names, line.split(","), strict=True):
            value = cell.strip()
            if name not in words and value:
                try:
                    good = bool(np.isfinite(float(value))) and "_" not in value
                except ValueError:
                    good = False
                if not good:
                    shown = value if len(value) <= 20 else value[:17] + "..."
                    advice = "leave the cell empty if not measured"
                    if name == "time_s":
                        advice = "times are seconds (`ninespring import --map`, unit = iso, reads clocks with a date)"
                    raise InputError(
                        f"{name} is '{shown}', not a number: {advice}",
                        path,
                        numbers[row],
                        at,
                    )
            at += len(cell) + 1
    raise InputError("a cell is not a number", path)
