"""Other people's files into logs: column names and units by a mapping file, camera frames by a region per spring."""

from __future__ import annotations

import codecs
import csv
import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from msgspec import Meta

from ..errors import InputError
from .logs import COLUMN, LIMITS, MAX_SPRINGS, SENSORS, log_text, number_in, read_bytes, read_table, read_text
from .logs.mending import longest_step
from .toml_file import Keys, TomlFile, whole
from .toml_file import number as a_number
from .toml_file import table as a_table

UNITS: dict[str, tuple[float, float]] = {
    "": (1.0, 0.0),
    "s": (1.0, 0.0),
    "ms": (1e-3, 0.0),
    "us": (1e-6, 0.0),
    "ns": (1e-9, 0.0),
    "min": (60.0, 0.0),
    "h": (3600.0, 0.0),
    "degC": (1.0, 0.0),
    "degF": (1 / 1.8, -32 / 1.8),
    "K": (1.0, -273.15),
    "A": (1.0, 0.0),
    "mA": (1e-3, 0.0),
    "V": (1.0, 0.0),
    "mV": (1e-3, 0.0),
    "%": (0.01, 0.0),
}
"""Factor and offset from a unit to the log's own."""

SWITCH = {"true": "1", "on": "1", "false": "0", "off": "0"}
"""How a logger may write whether a heater or a fan is on, in any case."""

FINITE = 1e300
MOST_PIXELS = 100_000
COLDEST_ROOM_K, HOTTEST_ROOM_K = (one + 273.15 for one in LIMITS["ambient_c"][:2])
"""Springs that are never colder than the first are in kelvin, as even the coldest room is; than the second: in nothing that a room is told in."""

BUILT_IN = {path.stem: path for path in Path(__file__).with_name("mappings").glob("*.toml")}
"""Mappings that come with the tool: `--map tclab`."""


_CHARACTER = Annotated[str, Meta(min_length=1, max_length=1, description="one character in quotes")]
_NAMES = Annotated[list[str], Meta(min_length=1, description="the source's name for it, or a list of names")]
_NUMBERS = re.compile(r"(?:[\s\d.,;eE+-]|nan)+", re.IGNORECASE)
_RULE = Keys({"unit": str} | dict.fromkeys(("scale", "offset"), a_number(-FINITE, FINITE)), {"column": _NAMES})
_MAPPING = Keys(
    {
        "sensor": a_table({}, {"kind": SENSORS}),
        "columns": Keys(each=_RULE),
        "file": Keys(
            {"separator": _CHARACTER, "decimal": _CHARACTER, "skip_lines": whole(0, 10**9), "names": _NAMES}
            | {"period_s": a_number(1e-6, 1e6)}
        ),
        "constants": Keys(each=a_number(-FINITE, FINITE)),
    }
)
_SIZES, _PLACES = a_number(1, MOST_PIXELS), a_number(0, MOST_PIXELS)
_GRID = Keys(
    {"step_x": _SIZES, "step_y": _SIZES},
    dict.fromkeys(("rows", "cols"), whole(1, MAX_SPRINGS))
    | dict.fromkeys(("width", "height"), _SIZES)
    | dict.fromkeys(("left", "top"), _PLACES),
)
_REGION = Keys(
    must=dict.fromkeys(("left", "top"), whole(0, MOST_PIXELS))
    | dict.fromkeys(("width", "height"), whole(1, MOST_PIXELS))
    | {"spring": whole(1, MAX_SPRINGS)}
)


def _read_mapping(mapping: str | Path) -> dict[str, Any]:
    """Read a mapping file, or a built-in mapping; refused with file, line and column where it is wrong."""
    file = TomlFile(BUILT_IN.get(str(mapping), mapping))
    if isinstance(columns := file.data.get("columns"), dict):
        for name, rule in columns.items():
            columns[name] = rule = rule if isinstance(rule, dict) else {"column": rule}
            if isinstance(rule.get("column"), str):
                rule["column"] = [rule["column"]]
    given = {"columns": {}, "constants": {}, "file": {}} | file.read(_MAPPING)
    for kind in ("columns", "constants"):
        for name in given[kind]:
            if not COLUMN.match(name):
                said = f"'{name}' is not a log's column (time_s, i1_a, v1_v, u1, t1_c, fan, ambient_c)"
                raise file.refuse(said, (kind, name), True)
    for name, rule in given["columns"].items():
        if (unit := rule.setdefault("unit", "")) not in UNITS and not (name == "time_s" and _is_clock(unit)):
            known = ", ".join(filter(None, UNITS))
            raise file.refuse(f"unknown unit '{unit}' for {name}: {known}; time_s: iso, %H:%M:%S", ("columns", name))
    if (timed := "time_s" in given["columns"]) == ("period_s" in given["file"]):
        said = "time_s and a period_s: give one" if timed else "no time_s under [columns], nor a period_s under [file]"
        raise file.refuse(f"the mapping has {said}", ("columns",))
    if "decimal" in given["file"] and given["file"]["decimal"] == given["file"].get("separator"):
        raise file.refuse("separator and decimal cannot be the same", ("file", "separator"))
    return given


def _is_clock(unit: str) -> bool:
    """Return whether this says how a clock's times are written: ISO 8601, or a pattern as of strptime."""
    try:
        pd.to_datetime([""], format="ISO8601" if unit == "iso" else unit, errors="coerce")
    except ValueError:
        return False
    return unit == "iso" or bool(re.search("%[A-Za-z]", unit))


@dataclass
class _Cells:
    """Another logger's table as text: its cells, its lines (the header is the first) and their numbers."""

    frame: pd.DataFrame
    lines: list[str]
    numbers: list[int]
    separator: str
    decimal: str
    nameless: bool
    """The first line is numbers, or a comment that may be anything but names."""


def _split(
    path: str | Path, separator: str = "", decimal: str = "", skip_lines: int = 0, names: Sequence[str] = ()
) -> _Cells:
    """Return a table's cells; what is not said of separator and decimal sign its header tells.

    The header is the first line, or `names`; above numbers it may be the last comment, where NumPy writes it.
    """
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-16" if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", "replace")
    if not text.strip():
        raise InputError("the file is empty", path)
    numbered = [(n, one) for n, one in enumerate(text.splitlines(), 1) if n > skip_lines and one.strip()]
    kept = [(n, one) for n, one in numbered if one[0] != "#"]
    if not kept:
        raise InputError("only comments and skipped lines: there is no header", path, 1)
    first, above = kept[0][1], numbered[: numbered.index(kept[0])]
    remark = above[-1][1].lstrip("# ") if above and not names and _NUMBERS.fullmatch(first) else ""
    separator = separator or next(
        (one for one in ";\t " if one in (remark or first) and "," not in (remark or first)), ","
    )
    if remark.count(separator) >= first.count(separator) > 0:
        kept.insert(0, (above[-1][0], remark))
    if len(kept) < 2 - bool(names):
        raise InputError("there is a header but no row", path, kept[0][0])
    rows: list[list[str]] = []
    for number, line in kept:
        try:
            (cells,) = csv.reader([line.strip(" ")], delimiter=separator, skipinitialspace=True)
        except csv.Error as error:
            raise InputError(f"{error} (separator '{separator}')", path, number, 1) from None
        rows.append(cells)
    if names:
        kept.insert(0, (kept[0][0], separator.join(names)))
        rows.insert(0, list(names))
    elif kept[0][1] is remark:
        del rows[0][len(rows[1]) :]
    for (number, line), cells in zip(kept, rows, strict=True):
        if len(cells) != len(rows[0]):
            said = f"{len(cells)} cells where the header has {len(rows[0])} (separator '{separator}')"
            raise InputError(said, path, number, len(line) + 1)
    frame = pd.DataFrame(rows[1:], columns=[name.strip() for name in rows[0]], dtype=str)
    numbers, lines = [n for n, _ in kept], [one for _, one in kept]
    nameless = lines[0] is remark or bool(_NUMBERS.fullmatch(lines[0]))
    return _Cells(frame, lines, numbers, separator, decimal or ("." if separator == "," else ","), nameless)


def import_table(path: str | Path, mapping: str | Path) -> str:
    """Return the text of a log made from `path` by a mapping file or the name of a built-in mapping.

    The mapping (TOML): `[columns]` gives for each of the log's columns the source's name, or a table {column, unit, scale,
    offset}: the number times `scale` is in `unit`, and `offset`, in the log's own unit, is added at the end. `[file]`
    may give `separator`, `decimal`, `skip_lines`, `names`, `period_s` where no column is a time; `[constants]` gives columns of one value where the file has none.
    """
    rules = _read_mapping(mapping)
    period_s = rules["file"].pop("period_s", 0.0)
    table = _split(path, **rules["file"])
    constants = rules["constants"]
    out = {
        name: _column(table, name, rule, path)
        for name, rule in rules["columns"].items()
        if name not in constants or not table.frame.columns.intersection(rule["column"]).empty
    }
    out |= {name: np.full(len(table.frame), value) for name, value in constants.items() if name not in out}
    time_s = out.pop("time_s", period_s * np.arange(len(table.frame)))
    if (fell := np.flatnonzero(np.diff(time_s) < 0.0)).size:
        said = (
            f"the time falls by {-np.diff(time_s)[fell[0]]:g} s: two runs in one file? Make two files. "
            "A clock that was set back, as in autumn, has times with their zone: 2026-10-25 02:30:00+01:00"
        )
        raise InputError(said, path, table.numbers[int(fell[0]) + 2], 1)
    for name in out:
        if re.fullmatch(r"t\d+_c", name):
            _refuse_kelvin(
                out[name], f'unit = "K" for {name} in the mapping converts (millivolts: scale, offset)', path
            )
    keys = {"imported_from": Path(path).name, "mapping": Path(str(mapping)).name}
    return log_text(time_s, out, keys | ({"sensor": rules["sensor"]["kind"]} if rules.get("sensor") else {}), 5)


def _column(table: _Cells, name: str, rule: dict[str, Any], path: str | Path) -> np.ndarray:
    """Return a log's column, (rows,), as its rule finds it in another logger's table."""
    has, wanted = list(table.frame.columns), rule["column"]
    found = next((one for one in wanted if one in has), None)
    if found is None:
        known = ", ".join(f"'{one}'" for one in has[:12])
        nameless = '; without a line of names: [file] names = ["time", ...]' * table.nameless
        raise InputError(
            f"no column '{wanted[0]}' for {name}: the file has {known}{nameless}", path, table.numbers[0], 1
        )
    if has.count(found) > 1:
        raise InputError(f"column '{found}' is there twice", path, table.numbers[0], 1)
    cells, unit, clock = table.frame[found].str.strip(), rule["unit"], rule["unit"] not in UNITS
    empty = cells.isin(["", "nan", "NaN", "NA", "-", "None"])
    if clock:
        written = "ISO8601" if unit == "iso" else unit
        stamps = pd.to_datetime(cells.where(~empty), errors="coerce", format=written, utc=True)
        values = (stamps - stamps.iloc[0]).dt.total_seconds()
    else:
        plain = cells.str.replace(table.decimal, ".", regex=False).str.lower().replace(SWITCH)
        values = pd.to_numeric(plain.where(~empty), errors="coerce").replace([math.inf, -math.inf], math.nan)
    bad = np.flatnonzero((values.isna() & (~empty | (name == "time_s"))).to_numpy())
    if bad.size:
        row = int(bad[0]) + 1
        shown, before = cells.iloc[row - 1], table.lines[row].split(table.separator)[: has.index(found)]
        hint = ' (decimal = ","?)' if "," in shown and not clock and table.decimal != "," else ""
        time = "time: 2026-01-31 12:00:00.5 is one" if unit == "iso" else f"time as '{unit}'"
        said = time if clock else 'number; a clock? unit = "iso" or "%H:%M:%S"' if ":" in shown else "number"
        raise InputError(
            f"'{shown}' in column '{found}' is not a {said}{hint}",
            path,
            table.numbers[row],
            1 + sum(len(one) + 1 for one in before),
        )
    factor, offset = (1.0, 0.0) if clock else UNITS[unit]
    return values.to_numpy(float) * factor * rule.get("scale", 1.0) + offset + rule.get("offset", 0.0)


@dataclass
class Region:
    """Pixels of one spring: rectangle with corners (left, top) and (right, bottom), right and bottom excluded."""

    spring: int
    left: int
    top: int
    right: int
    bottom: int


def read_regions(path: str | Path) -> list[Region]:
    """Read a regions file (TOML): [[region]] spring, left, top, width, height; or [grid] rows, cols, ...

    `[grid]`: rows, cols, left, top (centre of spring 1, pixels), step_x, step_y (pixels), width, height.
    """
    file, regions = TomlFile(path), []
    given = file.read(Keys({"grid": _GRID, "region": [_REGION]}))
    if grid := given.get("grid"):
        rows, cols = grid["rows"], grid["cols"]
        if rows * cols > MAX_SPRINGS:
            raise file.refuse(f"{rows} x {cols} are more than {MAX_SPRINGS} springs", ("grid", "rows"))
        for key, count in (("step_x", cols), ("step_y", rows)):
            if count > 1 and key not in grid:
                raise file.refuse(f"[grid] is without {key}; add it", ("grid",))
        for k in range(rows * cols):
            x = grid["left"] + (k % cols) * grid.get("step_x", 0.0) - grid["width"] / 2
            y = grid["top"] + (k // cols) * grid.get("step_y", 0.0) - grid["height"] / 2
            right, bottom = round(x + grid["width"]), round(y + grid["height"])
            regions.append(Region(k + 1, round(x), round(y), max(right, round(x) + 1), max(bottom, round(y) + 1)))
    for one in given.get("region", ()):
        left, top = one["left"], one["top"]
        regions.append(Region(one["spring"], left, top, left + one["width"], top + one["height"]))
    if not regions:
        raise InputError("no region: give [grid] or [[region]] tables", path, 1)
    springs = sorted(one.spring for one in regions)
    if twice := next((k for k, after in itertools.pairwise(springs) if k == after), None):
        raise InputError(f"spring {twice} is there twice", path)
    return sorted(regions, key=lambda one: one.spring)


def _by_numbers(path: Path) -> list[str | int]:
    """Return what sorts names so that frame 10 follows frame 9, whether or not its number is written 010."""
    return [int(one) if one.isdecimal() else one for one in re.split(r"([0-9]+)", path.stem)]


def frames_of(path: str | Path) -> tuple[int, Iterator[np.ndarray]]:
    """Return the count of frames and an iterator over them: .npy (frames, height, width), or a folder of CSVs."""
    path = Path(path)
    if path.is_dir():
        files = sorted(path.glob("*.csv"), key=_by_numbers)
        if not files:
            raise InputError("no .csv frame in this folder", path)
        return len(files), map(_read_frame, files)
    if path.suffix == ".npy":
        try:
            data = np.load(path, mmap_mode="r")
        except (OSError, ValueError) as error:
            raise InputError(f"not a NumPy array: {error}", path) from None
        if data.ndim == 2:
            data = data[None]
        if data.ndim != 3 or not np.issubdtype(data.dtype, np.number):
            raise InputError(f"shape {data.shape}: frames are (frames, height, width) numbers in degC", path)
        return len(data), (np.asarray(frame, dtype=float) for frame in data)
    return 1, iter([_read_frame(path)])


def _read_frame(file: Path) -> np.ndarray:
    lines = read_text(file).splitlines()
    separator = ";" if any(";" in line for line in lines[:3]) else ","
    frame: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        values: list[float] = []
        column = 1 + len(line) - len(line.lstrip(f" \t{separator}"))
        for cell in line.strip().strip(separator).split(separator):
            try:
                values.append(float(cell.replace(",", ".") if separator == ";" else cell))
            except ValueError:
                raise InputError(f"a pixel is '{cell[:20]}', not a number", file, number, column) from None
            column += len(cell) + 1
        if frame and len(values) != len(frame[0]):
            raise InputError(f"{len(values)} pixels where the first row has {len(frame[0])}", file, number)
        frame.append(values)
    if not frame:
        raise InputError("the frame is empty", file)
    return np.asarray(frame)


def read_times(path: str | Path) -> np.ndarray:
    """Read times of frames, s, one a line, rising; # begins a comment."""
    out: list[float] = []
    for number, raw in enumerate(read_text(path).splitlines(), 1):
        text = raw.partition("#")[0].strip()
        if not text:
            continue
        value = number_in(text)
        if value is None:
            raise InputError(f"'{text[:20]}' is not a time in s", path, number, 1)
        if out and value <= out[-1]:
            raise InputError(f"{value:g} s after {out[-1]:g} s: times must rise strictly", path, number, 1)
        out.append(value)
    return np.asarray(out)


def reduce_frames(
    path: str | Path,
    count: int,
    frames: Iterator[np.ndarray],
    regions: list[Region],
    say: Callable[[int], None] = lambda row: None,
    unit: str = "degC",
) -> dict[str, np.ndarray]:
    """Return {t{k}_c: (frames,)} of a frame sequence in `unit`, the mean of a region a spring."""
    out = np.full((count, len(regions)), np.nan)
    for row, frame in enumerate(frames):
        height, width = frame.shape
        for k, one in enumerate(regions):
            if one.left < 0 or one.top < 0 or one.right > width or one.bottom > height:
                raise InputError(
                    f"the region of spring {one.spring} ({one.left},{one.top} to {one.right},"
                    f"{one.bottom}) leaves frame {row + 1} of {width} x {height} pixels",
                    path,
                )
            pixels = frame[one.top : one.bottom, one.left : one.right]
            good = pixels[np.isfinite(pixels)]
            if good.size:
                out[row, k] = good.mean()
        say(row + 1)
    factor, offset = UNITS[unit]
    out = out * factor + offset
    _refuse_kelvin(out, "`--unit K` converts", path)
    low, high, _, _ = LIMITS["t"]
    for k, one in enumerate(regions):
        if np.any(bad := (out[:, k] < low) | (out[:, k] > high)):
            row = int(np.flatnonzero(bad)[0])
            raise InputError(
                f"spring {one.spring} shows {out[row, k]:g} in frame {row + 1}: that is no temperature in degC "
                "(raw counts, or kelvin times 100?)",
                path,
            )
    return {f"t{one.spring}_c": out[:, k] for k, one in enumerate(regions)}


def _refuse_kelvin(temperature: np.ndarray, advice: str, path: str | Path) -> None:
    """Refuse temperatures that are never below a cold room's in kelvin: no array is so hot from beginning to end."""
    if np.isfinite(temperature).any() and (coldest := float(np.nanmin(temperature))) > COLDEST_ROOM_K:
        raw = "that is no room in degC, degF or K: raw counts, millivolts?"
        said = f"looks like kelvin, {advice}" if coldest < HOTTEST_ROOM_K else raw
        raise InputError(f"nothing is ever colder than {coldest:.0f}: {said}", path)


def merge_into_log(
    log_path: str | Path, times_s: np.ndarray | None, interval_s: float, offset_s: float, columns: dict[str, np.ndarray]
) -> str:
    """Return a log's text with camera temperatures put onto its times (straight lines between frames, none across a gap).

    Frames without times of their own begin with the log's first row; `offset_s` is added to either.
    """
    table = read_table(log_path)
    if "time_s" not in table.names:
        raise table.refuse_header("no column time_s")
    time_s = table.frame["time_s"].to_numpy(float)
    count = len(next(iter(columns.values())))
    when = time_s[0] + np.arange(count) * interval_s if times_s is None else times_s
    when = when + offset_s
    meet = int(np.count_nonzero((when >= time_s[0]) & (when <= time_s[-1])))
    if meet < min(2, count):  # between two that are not of it a line says nothing
        raise InputError(
            f"its times are {time_s[0]:g} to {time_s[-1]:g} s, the frames' {when[0]:g} to {when[-1]:g} s: "
            f"{('they never meet', 'only one of them is within')[meet]}, `--offset` moves the frames, `--interval` is between them",
            log_path,
        )
    merged = {name: table.frame[name] for name in table.names if name != "time_s"}
    longest_s = longest_step(when)
    for name, values in columns.items():
        good = np.isfinite(values)
        merged[name] = line = (
            np.interp(time_s, when[good], values[good], left=np.nan, right=np.nan)
            if good.any()
            else np.full(len(time_s), np.nan)
        )
        for before, after in itertools.pairwise(when[good]):
            if after - before > longest_s:
                line[(time_s > before) & (time_s < after)] = np.nan
    return log_text(time_s, merged, table.keys | {"temperatures_from": "camera frames", "sensor": "camera"}, 5)
