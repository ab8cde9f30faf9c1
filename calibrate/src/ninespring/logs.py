"""Logs (design, section 4): reading, checking, writing.

A log that cannot be used is refused whole with file, line, column and advice. What can be mended without
guessing (repeated rows, gaps, glitches, a saturated or dead sensor) is mended and said in `Run.notes`.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from .errors import InputError
from .statistics import noise_floor

DriveMode = Literal["power", "current", "command"]

MAX_LINE = 100_000
"""A line longer than this (characters) is not a log."""
MAX_SPRINGS = 64
RUN_IN_S = 120.0
"""After a gap: how long the noise of the temperatures that the simulation starts from is still felt."""
FINEST_S = 1.0
"""Rows closer than this are averaged where a log is too long to be simulated row by row."""
STRETCH_S = 1500.0
"""Length of the stretches that are taken of a log that is still too long, about."""
COLUMN = re.compile(r"^(?:time_s|fan|ambient_c|([ivtu])([1-9][0-9]?)_([avc])|u([1-9][0-9]?))$")
EXTRA = re.compile(r"^(?:[mpy][1-9][0-9]?_c|(?:[xd]|px|limits)[1-9][0-9]?|(?:s|cut)[1-9][0-9]?_a|state|note_.*)$")
"""Columns that the simulator and the board write beside the measured ones: skipped."""
UNIT_OF = {"i": "a", "v": "v", "t": "c"}
LIMITS = {
    "i": (-0.5, 20.0, "A", "looks like milliamperes: divide by 1000 (`ninespring import --map`)"),
    "v": (-0.5, 60.0, "V", "looks like millivolts: divide by 1000 (`ninespring import --map`)"),
    "u": (-1e-9, 1.0 + 1e-9, "", "commands run from 0 to 1: a command in % is divided by 100"),
    "t": (-60.0, 400.0, "degC", "not a spring's temperature: leave the cell empty if not measured"),
    "fan": (-1e-9, 1.0 + 1e-9, "", "the fan runs from 0 to 1: a fan in % is divided by 100"),
    "ambient_c": (-40.0, 60.0, "degC", "looks like Fahrenheit or kelvin: give degC"),
}
"""Per kind of column: lowest, highest, unit, and what to do about a value beyond them."""
BELOW = {
    "i": "a negative current: the leads of that sensor are swapped? Turn the sign (`ninespring import --map`, scale = -1)",
    "v": "a negative voltage: the leads of that sensor are swapped? Turn the sign (`ninespring import --map`, scale = -1)",
    "u": "a negative command: commands run from 0 to 1",
}
"""What to do about a value below the lowest, where that is another thing."""


@dataclass
class Run:
    """One log, checked. Arrays have one row per time (n) and one column per spring (k)."""

    name: str
    sha256: str
    time_s: np.ndarray
    mode: DriveMode
    drive: np.ndarray
    """(n, k): W, A or 0..1 by `mode`; row r holds until time r + 1."""
    temperature_c: np.ndarray
    """(n, k), NaN where not measured or not trusted."""
    fan: np.ndarray
    ambient_c: np.ndarray | None
    """(n,) or None where the log has none."""
    current_a: np.ndarray | None = None
    voltage_v: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)
    warm: bool = False
    """The run begins warm and steady: hidden heat is in balance with the first inputs."""
    starts: list[int] = field(default_factory=lambda: [0])
    """Rows at which a simulation starts again from the measured temperatures (the first; after gaps)."""

    @property
    def springs(self) -> int:
        """Number of springs."""
        return self.temperature_c.shape[1]

    @property
    def duration_s(self) -> float:
        """From the first row to the last, s."""
        return float(self.time_s[-1] - self.time_s[0])


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def check_folder(*paths: Path | None) -> None:
    """Refuse output files whose folder is not there or cannot be written, before any work is done."""
    for path in paths:
        if path is None:
            continue
        if not path.parent.is_dir():
            raise InputError(f"the folder {path.parent} does not exist: create it first", path)
        if not (path.exists() and not path.is_file()) and not os.access(path.parent, os.W_OK):
            raise InputError(f"the folder {path.parent} cannot be written", path)


def write_atomically(files: Mapping[Path, str]) -> None:
    """Write text files whole or not at all: temporary files beside them, all of them renamed at the end.

    Where a path is a link, what it points to is replaced, not the link. A device or a pipe is written as it is, `-` is
    standard output.
    """
    places = {path: path if str(path) == "-" or not path.is_symlink() else path.resolve() for path in files}
    check_folder(*places.values())
    umask = os.umask(0)
    os.umask(umask)
    made: list[tuple[str, Path]] = []
    try:
        for path, text in files.items():
            place = places[path]
            if str(place) == "-":
                sys.stdout.write(text)
                sys.stdout.flush()
                continue
            if place.exists() and not place.is_file() and not place.is_dir():
                with open(place, "w", encoding="utf-8", newline="\n") as stream:
                    stream.write(text)
                continue
            handle, temporary = tempfile.mkstemp(dir=place.parent, prefix=f".{place.name}.")
            made.append((temporary, place))
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
                stream.write(text)
            os.chmod(temporary, 0o666 & ~umask)
        while made:
            os.replace(*made[0])
            made.pop(0)
    finally:
        for temporary, _ in made:
            os.unlink(temporary)


def read_bytes(path: str | Path) -> bytes:
    """Return the file's bytes, or refuse with what the system says."""
    try:
        with open(path, "rb") as stream:
            return stream.read()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", path) from None


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


def read_table(path: str | Path, text_columns: Iterable[str] = (), header_check: Header | None = None) -> Table:
    """Read a comma-separated file with a header, `#` comments, and numbers or empty cells."""
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
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if lines and lines[-1] == "":
        lines.pop()
    longest = max(map(len, lines))
    if longest > MAX_LINE:
        number = next(k for k, one in enumerate(lines, start=1) if len(one) > MAX_LINE)
        raise InputError(f"a line of {longest} characters: not a log (line ends missing?)", path, number)
    keys: dict[str, str] = {}
    kept: list[str] = []
    numbers: list[int] = []
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            name, colon, value = line[1:].partition(":")
            if colon and not kept:  # further down a board's status is kept
                keys.setdefault(name.strip().lower(), value.strip())
        elif line.strip():
            kept.append(line)
            numbers.append(number)
    if not kept:
        raise InputError("only comments: there is no header line", path, 1)
    header, header_line = kept[0], numbers[0]
    for separator, called in ((";", "semicolons"), ("\t", "tabs")):
        if separator in header and "," not in header:
            raise InputError(
                f"columns are separated by {called}: save with commas and decimal points "
                "(`ninespring import --map` converts)",
                path,
                header_line,
                header.index(separator) + 1,
            )
    if '"' in text:
        # Quotes around plain cells mean nothing. A comma inside of them shows in the count of cells below.
        kept = [line.replace('"', "") for line in kept]
        header = kept[0]
    names = [name.strip() for name in header.split(",")]
    if all(_is_number(name) for name in names):
        raise InputError(
            "the first line holds numbers: begin the file with a line of column names (time_s,i1_a,t1_c,...)",
            path,
            header_line,
            1,
        )
    starts = [1]
    for cell in header.split(",")[:-1]:
        starts.append(starts[-1] + len(cell) + 1)
    for k, name in enumerate(names):
        if name == "":
            raise InputError(f"column {k + 1} has no name", path, header_line, starts[k])
        if name in names[:k]:
            raise InputError(f"column '{name}' is there twice", path, header_line, starts[k])
    if header_check:
        header_check(names, header_line, starts)
    wanted = header.count(",")
    body = kept[1:]
    unfinished = not text.endswith("\n")
    cut_off = unfinished and len(body) > 3 and body[-1].count(",") < wanted
    if cut_off:
        body.pop()
    if not body:
        raise InputError("there is a header but no row", path, header_line)
    for row, line in enumerate(body):
        if (found := line.count(",")) != wanted:
            advice = (
                "cut off here?"
                if row == len(body) - 1
                else "decimal commas? write 20.5, not 20,5"
                if found > wanted
                else "a cell is missing: leave it empty between two commas"
            )
            raise InputError(
                f"{found + 1} cells where the header has {wanted + 1}: {advice}",
                path,
                numbers[row + 1],
                len(line) + 1,
            )
    words = {name for name in names if name == "state" or name.startswith("note_")} | set(text_columns)
    types = {name: (str if name in words else np.float64) for name in names}
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(body)),
            header=None,
            names=names,
            dtype=types,
            na_values=[""],
            keep_default_na=False,
            skipinitialspace=True,
            skip_blank_lines=False,
            quoting=3,
            index_col=False,
            low_memory=False,
        )
    except (ValueError, OverflowError):
        frame = None
    places = np.asarray(numbers[1 : len(body) + 1], dtype=np.int64)
    table = Table(str(path), header_line, names, starts, frame, places, keys)
    table.unfinished = unfinished and not cut_off
    table.cut_off = cut_off
    numeric = [name for name in names if name not in words]
    if frame is None or np.isfinite(frame[numeric].to_numpy(float)).sum() != int(
        frame[numeric].notna().to_numpy().sum()
    ):
        _refuse_first_bad_cell(path, names, words, body, numbers[1:])
    return table


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _refuse_first_bad_cell(
    path: str | Path, names: list[str], words: set[str], body: list[str], numbers: list[int]
) -> None:
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
                    raise InputError(
                        f"{name} is '{shown}', not a number: leave the cell empty if not measured",
                        path,
                        numbers[row],
                        at,
                    )
            at += len(cell) + 1
    raise InputError("a cell is not a number", path)


def _check_range(table: Table, name: str, kind: str) -> None:
    low, high, unit, advice = LIMITS[kind]
    values = table.frame[name].to_numpy()
    bad = np.flatnonzero((values < low) | (values > high))
    if bad.size:
        line, column = table.where(int(bad[0]), name)
        if values[bad[0]] < low and abs(values[bad[0]]) <= high:
            advice = BELOW.get(kind, advice)
        raise InputError(f"{name} = {values[bad[0]]:g} {unit}".rstrip() + f": {advice}", table.path, line, column)


def _driving_columns(
    path: str | Path, names: list[str], line: int, columns: list[int], springs: int | None, temperatures: bool, why: str
) -> tuple[str, int, bool]:
    """Return by what a log is driven ('i' or 'u'), its number of springs, whether it has voltages; refuse a wrong header."""
    groups: dict[str, set[int]] = {"i": set(), "v": set(), "t": set(), "u": set()}
    because = f" ({why})" if why else ""
    for name, at in zip(names, columns, strict=True):
        if EXTRA.match(name):
            continue
        match = COLUMN.match(name)
        kind, number = None, 0
        if match and match[1]:
            kind, number = match[1], int(match[2])
            if UNIT_OF.get(kind) != match[3]:
                match = None
        elif match and match[4]:
            kind, number = "u", int(match[4])
        if not match:
            raise InputError(
                f"unknown column '{name}': a log has time_s, i1_a, v1_v, u1, t1_c ..., fan, ambient_c "
                "(`ninespring import --map` renames)",
                path,
                line,
                at,
            )
        if kind is not None:
            if number > MAX_SPRINGS or (springs is not None and number > springs):
                raise InputError(
                    f"column '{name}' but the array has {springs or MAX_SPRINGS} springs{because}", path, line, at
                )
            groups[kind].add(number)
    if "time_s" not in names:
        raise InputError("no column time_s", path, line, 1)
    if temperatures and not groups["t"]:
        raise InputError("no temperature column (t1_c ...)", path, line, 1)
    count = springs or max(set().union(*groups.values()), default=0)
    everyone = set(range(1, count + 1))
    letter = "i" if groups["i"] else "u"
    if not groups[letter]:
        raise InputError("neither currents (i1_a ...) nor commands (u1 ...)", path, line, 1)
    if missing := sorted(everyone - groups[letter]):
        example = f"i{missing[0]}_a" if letter == "i" else f"u{missing[0]}"
        raise InputError(
            f"spring {missing[0]} has no column {example}: add it (0 where the spring is not driven){because}",
            path,
            line,
            1,
        )
    if letter == "i" and groups["v"] and (missing := sorted(everyone - groups["v"])):
        raise InputError(
            f"spring {missing[0]} has no column v{missing[0]}_v but others have: log all voltages or none",
            path,
            line,
            1,
        )
    return letter, count, bool(groups["v"])


def read_log(path: str | Path, springs: int | None = None, temperatures: bool = True, why: str = "") -> Run:
    """Read and check one log; `springs` is the array's number (`why` says whose), None to take what the header says."""
    found: list[tuple[str, int, bool]] = []

    def check(names: list[str], line: int, columns: list[int]) -> None:
        found.append(_driving_columns(path, names, line, columns, springs, temperatures, why))

    table = read_table(path, header_check=check)
    letter, count, has_voltages = found[0]
    mode: DriveMode
    frame = table.frame
    for name in table.names:
        if EXTRA.match(name):
            continue
        if name != "time_s":
            kind = name if name in LIMITS else name[0]
            _check_range(table, name, kind)
        if name == "time_s" or name[0] in "iu" or name == "fan" or name[0] == "v":
            holes = np.flatnonzero(frame[name].isna().to_numpy())
            if holes.size:
                line, column = table.where(int(holes[0]), name)
                raise InputError(f"{name} is empty: only temperatures and ambient_c may be", path, line, column)
    notes: list[str] = []
    keep = _rising_rows(table, notes)
    if table.unfinished and len(frame) > 3:
        keep[-1] = False
    if table.cut_off or (table.unfinished and len(frame) > 3):
        notes.append("the last line has no end, it may be cut off: left out")
    frame = frame.iloc[keep]
    if len(frame) < 3:
        raise InputError(f"{len(frame)} rows: too short to say anything", path, int(table.lines[-1]))

    def matrix(pattern: str) -> np.ndarray:
        return np.ascontiguousarray(
            np.column_stack(
                [
                    frame[pattern.format(k)].to_numpy(float)
                    if pattern.format(k) in frame
                    else np.full(len(frame), np.nan)
                    for k in range(1, count + 1)
                ]
            )
        )

    time_s = frame["time_s"].to_numpy(float)
    temperature = matrix("t{}_c")
    current = voltage = None
    if letter == "i":
        current = matrix("i{}_a")
        if has_voltages:
            voltage = matrix("v{}_v")
            mode, drive = "power", current * voltage
        else:
            mode, drive = "current", current
    else:
        mode, drive = "command", matrix("u{}")
    ambient = None
    if "ambient_c" in frame and frame["ambient_c"].notna().any():
        ambient = frame["ambient_c"].ffill().bfill().to_numpy(float)
    fan = frame["fan"].to_numpy(float) if "fan" in frame else np.zeros(len(frame))
    run = Run(
        name=str(path),
        sha256=sha256_of(path),
        time_s=time_s,
        mode=mode,
        drive=drive,
        temperature_c=temperature,
        fan=np.clip(fan, 0.0, 1.0),
        ambient_c=ambient,
        current_a=current,
        voltage_v=voltage,
        notes=notes,
    )
    if mode == "command":
        run.drive = np.clip(run.drive, 0.0, 1.0)
    without = [str(k) for k in range(1, count + 1) if f"t{k}_c" not in frame]
    if without and temperatures:
        notes.append(f"no temperature of spring {', '.join(without)}: simulated, but not compared")
    _refuse_wrong_units(run, table)
    _mask_bad_sensors(run)
    _mask_glitches(run)
    _find_gaps(run)
    run.warm = _begins_warm(run)
    _doubt_units(run)
    if temperatures and not np.isfinite(run.temperature_c).any():
        why = f" ({notes[-1]})" if notes else ""
        raise InputError(f"no usable temperature in the whole log{why}", path)
    return run


def _rising_rows(table: Table, notes: list[str]) -> np.ndarray:
    """Rows whose time rises. Exact repeats are dropped and said; anything else is refused."""
    time_s = table.frame["time_s"].to_numpy(float)
    keep = np.ones(len(time_s), dtype=bool)
    if (np.diff(time_s) > 0).all():
        return keep
    keep = ~table.frame.duplicated().to_numpy()
    rows = np.flatnonzero(keep)
    step = np.diff(time_s[rows])
    if (step <= 0).any():
        at = int(np.flatnonzero(step <= 0)[0])
        before, now = time_s[rows[at]], time_s[rows[at + 1]]
        line, column = table.where(int(rows[at + 1]), "time_s")
        said = (
            f"time_s repeats {now:.10g} with other values"
            if now == before
            else f"time_s falls from {before:.10g} to {now:.10g}"
        )
        raise InputError(f"{said}: times must rise strictly", table.path, line, column)
    notes.append(f"{int((~keep).sum())} repeated rows dropped")
    return keep


def _refuse_wrong_units(run: Run, table: Table) -> None:
    """Springs that start above 45 degC though nothing is driven, and never get colder: Fahrenheit or kelvin."""
    if not np.isfinite(run.temperature_c[:5]).any():
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may be empty
        lowest = np.nanmin(run.temperature_c, axis=0)
        first = np.nanmedian(run.temperature_c[:5], axis=0)
    quiet = not np.any(run.drive[0] > 0)
    ambient = None if run.ambient_c is None else float(run.ambient_c[0])

    def refuse(k: int, said: str) -> InputError:
        line, column = table.where(0, f"t{k + 1}_c")
        return InputError(f"{said}, a log has degC (`ninespring import --map` converts)", run.name, line, column)

    seen = np.flatnonzero(np.isfinite(lowest))
    coldest = float(lowest[seen].min())
    begins = f"nothing is driven yet the springs start at {coldest:.0f}: looks like"
    if coldest > 240.0:
        raise refuse(int(seen[0]), f"{begins} kelvin")
    together = float(np.nanmax(first) - np.nanmin(first)) < 8.0
    if quiet and coldest > 45.0 and together and (ambient is None or abs(coldest - ambient) > 20.0):
        raise refuse(int(seen[0]), f"{begins} degrees Fahrenheit")
    for k in seen:
        others = first[seen[seen != k]]
        usual = ambient if ambient is not None else float(np.nanmedian(others)) if len(others) > 1 else None
        if not quiet or usual is None or lowest[k] - usual < 20.0:
            continue
        for name, celsius in (("degrees Fahrenheit", (lowest[k] - 32.0) / 1.8), ("kelvin", lowest[k] - 273.15)):
            if abs(celsius - usual) < 8.0:
                raise refuse(
                    int(k),
                    f"nothing is driven, the rest is at {usual:.0f} degC, yet spring {k + 1} starts at "
                    f"{first[k]:.0f} and never falls below {lowest[k]:.0f}: looks like {name}",
                )


def _doubt_units(run: Run) -> None:
    """Say what is possible but unlikely: it may be so, or a unit or a column is wrong."""
    usual = float(np.median(np.diff(run.time_s)))
    if usual > 100.0:
        run.notes.append(f"the rows are {usual:g} s apart: is the time in milliseconds?")
    if run.duration_s < 60.0 and len(run.time_s) >= 60:
        run.notes.append(f"the whole log lasts {run.duration_s:.3g} s: is the time in minutes or hours?")
    if run.ambient_c is not None and np.isfinite(run.temperature_c).any():
        coldest, ambient = float(np.nanmin(run.temperature_c)), float(np.median(run.ambient_c))
        if coldest > 45.0 and abs((coldest - 32.0) / 1.8 - ambient) < 5.0:
            run.notes.append(
                f"no spring is ever below {coldest:.0f}, which in Fahrenheit would be the ambient, {ambient:.0f} degC: "
                "are the temperatures in Fahrenheit?"
            )
    if run.ambient_c is not None and np.any(jumps := np.abs(np.diff(run.ambient_c)) > 5.0):
        at = int(np.flatnonzero(jumps)[0])
        run.notes.append(
            f"ambient_c jumps from {run.ambient_c[at]:g} to {run.ambient_c[at + 1]:g} degC at {run.time_s[at + 1]:g} s: "
            "the air of a room does not, is the column right?"
        )
    if run.voltage_v is not None and run.current_a is not None and np.any(driven := run.current_a > 0.05):
        ohm = float(np.median(run.voltage_v[driven] / run.current_a[driven]))
        if not 0.02 < ohm < 2.0:
            run.notes.append(
                f"v/i is {ohm:.2g} ohm, and a spring like the paper's has 0.2: if yours has not, currents and voltages "
                "are swapped or in another unit"
            )


def _mask_bad_sensors(run: Run) -> None:
    """Saturated and dead sensors are not measurements: masked, and said."""
    noise = np.nan_to_num(noise_floor(run.temperature_c))
    for k in range(run.springs):
        values = run.temperature_c[:, k]
        seen = np.flatnonzero(np.isfinite(values))
        if seen.size < 10:
            continue
        measured = values[seen]
        if np.all(measured == measured[0]) and np.ptp(run.drive.sum(axis=1)) > 0:
            others = [
                np.nanmax(run.temperature_c[:, j]) - np.nanmin(run.temperature_c[:, j])
                for j in range(run.springs)
                if j != k and np.isfinite(run.temperature_c[:, j]).any()
            ]
            if np.ptp(run.drive[:, k]) > 0 or (others and max(others) > 5.0):
                run.temperature_c[:, k] = np.nan
                run.notes.append(f"t{k + 1}_c never moves ({measured[0]:g} degC): dead sensor, left out")
                continue
        for edge, extreme in (("highest", measured.max()), ("lowest", measured.min())):
            flat = measured == extreme
            longest = _longest_run(flat)
            typical = _longest_run(np.diff(measured) == 0) + 1
            inner = measured[~flat]
            if inner.size < 10:
                continue
            # Ordinary quantisation also repeats values; a clipped sensor stays at ITS extreme far longer
            # than it ever stays at any other value.
            elsewhere = _longest_run(np.diff(inner) == 0) + 1
            if longest >= 15 and longest > 4 * elsewhere and longest >= typical:
                # near the limit only what the noise carried down is seen: those rows would pull the fit
                run.temperature_c[seen[np.abs(measured - extreme) <= 4.0 * noise[k]], k] = np.nan
                run.notes.append(
                    f"t{k + 1}_c stays at its {edge} value {extreme:g} degC for {longest} rows: "
                    "saturated, those rows left out"
                )


def _longest_run(flags: np.ndarray) -> int:
    if not flags.any():
        return 0
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return int((edges[1::2] - edges[::2]).max())


def _mask_glitches(run: Run) -> None:
    """Single samples far from the straight line between their neighbours: no spring moves like that."""
    noise = noise_floor(run.temperature_c)
    for k in range(run.springs):
        values = run.temperature_c[:, k]
        if np.isfinite(values).sum() < 30 or not np.isfinite(noise[k]):
            continue
        before, after = values[:-2], values[2:]
        away = np.abs(values[1:-1] - 0.5 * (before + after))
        limit = 10.0 * max(float(noise[k]), 0.02) + 2.0 * np.abs(after - before)
        bad = np.flatnonzero(away > limit) + 1
        # a spike of one sample also lifts its neighbours' distance: keep the largest of three in a row
        peak = np.zeros(len(values))
        peak[1:-1] = np.nan_to_num(away)
        bad = bad[(peak[bad] >= peak[bad - 1]) & (peak[bad] >= peak[np.minimum(bad + 1, len(values) - 1)])]
        if 0 < bad.size <= max(3, 0.01 * len(values)):
            run.temperature_c[bad, k] = np.nan
            run.notes.append(
                f"t{k + 1}_c: {bad.size} isolated spike(s) left out, the first at {run.time_s[bad[0]]:g} s"
            )


def _begins_warm(run: Run) -> bool:
    """Driven from the first row on, the same for half a minute, and no spring moves by more than half a degree."""
    first = run.time_s - run.time_s[0] <= 30.0
    if first.sum() < 5 or not np.any(run.drive[0] > 0) or np.ptp(run.drive[first], axis=0).max() > 0:
        return False
    seen = run.temperature_c[first]
    seen = seen[:, np.isfinite(seen).all(axis=0)]
    if not seen.shape[1]:
        return False
    third = max(1, len(seen) // 3)
    moved = np.abs(seen[-third:].mean(axis=0) - seen[:third].mean(axis=0))
    return bool(moved.max() < 0.5)


def _find_gaps(run: Run) -> None:
    step = np.diff(run.time_s)
    usual = float(np.median(step))
    limit = max(10.0, 5.0 * usual)
    gaps = np.flatnonzero(step > limit)
    for row in gaps:
        run.starts.append(int(row) + 1)
        _mask_run_in(run, int(row) + 1)
    if gaps.size:
        longest = float(step[gaps].max())
        run.notes.append(
            f"{gaps.size} gap(s) in time, the longest {longest:.0f} s: the simulation starts again from the measured "
            f"temperatures after each, and what is measured in the first {RUN_IN_S:.0f} s does not count"
        )
    missing = int(np.rint(step[(step > 1.5 * usual) & (step <= limit)] / usual - 1.0).sum())
    if missing:
        run.notes.append(
            f"about {missing} rows are missing here and there: an input that changed meanwhile is taken for the old one "
            "until the next row"
        )


def _mask_run_in(run: Run, begin: int) -> None:
    """Leave out what is measured while a simulation that starts at row `begin` forgets how it started."""
    end = int(np.searchsorted(run.time_s, run.time_s[begin] + RUN_IN_S))
    run.temperature_c[begin + 1 : end] = np.nan


def log_text(
    time_s: np.ndarray,
    columns: dict[str, np.ndarray],
    keys: dict[str, str] | None = None,
    decimals: int = 4,
) -> str:
    """Return a log as text: `# key: value` lines, header, rows; NaN becomes an empty cell."""
    frame = pd.DataFrame({"time_s": np.round(time_s, 6)} | columns)
    head = "".join(f"# {key}: {value}\n" for key, value in (keys or {}).items())
    return head + frame.to_csv(index=False, float_format=f"%.{decimals}f", lineterminator="\n")


def condense(run: Run, max_rows: int = 4000) -> Run:
    """Return the run with at most about `max_rows` rows, and say how.

    First rows are averaged to FINEST_S. What is then still too long is cut to stretches, evenly spread from beginning to
    end, at full rate: averaging further would blur what the springs were given. Each stretch starts from the measured
    temperatures, as after a gap; between two of them one row holds the mean of what was given, for air and plate.
    """
    run = _averaged(run, max_rows)
    n = len(run.time_s)
    usual = float(np.median(np.diff(run.time_s)))
    pieces = max(2, round(max_rows * usual / STRETCH_S))
    each = max_rows // pieces
    if n <= max_rows or each < 50:
        return run
    begins = np.linspace(0, n - each, pieces).round().astype(int)
    rows: list[np.ndarray] = []
    starts: list[int] = []
    bridges: list[tuple[int, int, int]] = []
    total = 0
    for begin, following in zip(begins, [*begins[1:], n], strict=True):
        end = int(begin) + each
        starts += [total, *(total + one - int(begin) for one in run.starts if begin < one < end)]
        rows.append(np.arange(begin, min(end + 1, following)))
        total += len(rows[-1])
        if following > end and following < n:
            bridges.append((total - 1, end, int(following)))
    pick = np.concatenate(rows)
    out = replace(
        run,
        time_s=run.time_s[pick],
        drive=run.drive[pick],
        temperature_c=run.temperature_c[pick],
        fan=run.fan[pick],
        ambient_c=None if run.ambient_c is None else run.ambient_c[pick],
        current_a=None,
        voltage_v=None,
        starts=starts,
        notes=[
            *run.notes,
            f"{n} rows: the fit takes {pieces} stretches of {each * usual / 60.0:.0f} min, evenly spread; "
            "what was given between them counts as its mean",
        ],
    )
    weight = np.diff(run.time_s, append=run.time_s[-1] + usual)
    for at, begin, end in bridges:
        span = slice(begin, end)
        out.temperature_c[at] = np.nan
        out.drive[at] = weight[span] @ run.drive[span] / weight[span].sum()
        out.fan[at] = weight[span] @ run.fan[span] / weight[span].sum()
        if out.ambient_c is not None and run.ambient_c is not None:
            out.ambient_c[at] = weight[span] @ run.ambient_c[span] / weight[span].sum()
    for begin in starts[1:]:
        _mask_run_in(out, begin)
    return out


def _averaged(run: Run, max_rows: int) -> Run:
    """Return the run with rows averaged to at most FINEST_S, no more than `max_rows` asks for.

    A row's drive and fan are the means over the time until the next one; its temperature is the mean of an odd number of
    readings around its time, none of them used twice: nothing is shifted, and the noise stays white.
    """
    n = len(run.time_s)
    usual = float(np.median(np.diff(run.time_s)))
    factor = min(-(-n // max_rows), int(FINEST_S / usual + 1e-9))
    if factor <= 1:
        return run
    weight = np.diff(run.time_s, append=run.time_s[-1] + usual)
    pieces: dict[str, list[np.ndarray]] = {"row": [], "drive": [], "fan": [], "temperature": []}
    starts: list[int] = []
    for begin, end in zip(run.starts, [*run.starts[1:], n], strict=True):
        starts.append(sum(map(len, pieces["row"])))
        rows = np.arange(begin, end, factor)
        span = np.add.reduceat(weight[begin:end], rows - begin)
        pieces["row"].append(rows)
        pieces["drive"].append(
            np.add.reduceat(weight[begin:end, None] * run.drive[begin:end], rows - begin, axis=0) / span[:, None]
        )
        pieces["fan"].append(np.add.reduceat(weight[begin:end] * run.fan[begin:end], rows - begin) / span)
        measured = pd.DataFrame(run.temperature_c[begin:end])
        smooth = measured.rolling(factor - (factor + 1) % 2, center=True, min_periods=1).mean().to_numpy()
        pieces["temperature"].append(smooth[rows - begin])
    row = np.concatenate(pieces["row"])
    return replace(
        run,
        time_s=run.time_s[row],
        drive=np.ascontiguousarray(np.concatenate(pieces["drive"])),
        temperature_c=np.ascontiguousarray(np.concatenate(pieces["temperature"])),
        fan=np.concatenate(pieces["fan"]),
        ambient_c=None if run.ambient_c is None else run.ambient_c[row],
        current_a=None,
        voltage_v=None,
        starts=starts,
        notes=[*run.notes, f"{n} rows averaged {factor} by {factor} for the fit"],
    )
