"""Other people's files into logs: column names and units by a mapping file, camera frames by a region per spring."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import InputError
from .logs import COLUMN, LIMITS, MAX_SPRINGS, log_text, number_in, read_bytes, read_table, read_text
from .toml_file import At, TomlFile

UNITS: dict[str, tuple[float, float]] = {
    "": (1.0, 0.0),
    "s": (1.0, 0.0),
    "ms": (1e-3, 0.0),
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

FINITE = 1e300
COLDEST_ROOM_K = LIMITS["ambient_c"][0] + 273.15
"""Springs that are never colder than this number are in kelvin: even the coldest room is above it, in kelvin."""

BUILT_IN = {path.stem: path for path in Path(__file__).with_name("mappings").glob("*.toml")}
"""Mappings that come with the tool: `--map tclab`."""


@dataclass
class _Rule:
    """Where one of the log's columns comes from: names to look for, value = factor * number + offset, or ISO times."""

    sources: list[str]
    factor: float
    offset: float
    iso: bool


@dataclass
class _Mapping:
    """A mapping, checked."""

    columns: dict[str, _Rule] = field(default_factory=dict)
    constants: dict[str, float] = field(default_factory=dict)
    separator: str = ""
    """As is the decimal sign: told by the header where it is empty."""
    decimal: str = ""
    skip_lines: int = 0


def _read_mapping(mapping: str | Path) -> _Mapping:
    """Read a mapping file, or a built-in mapping; refused with file, line and column where it is wrong."""
    file, out = TomlFile(BUILT_IN.get(str(mapping), mapping)), _Mapping()
    file.table((), ("columns", "file", "constants"))
    given = file.table(("file",), ("separator", "decimal", "skip_lines"))
    for key in ("separator", "decimal"):
        if key in given and len(file.text_at(("file", key))) != 1:
            raise file.refuse(f"{key} must be one character in quotes", ("file", key))
    out.separator, out.decimal = given.get("separator", ""), given.get("decimal", "")
    if out.decimal and out.separator == out.decimal:
        raise file.refuse("separator and decimal cannot be the same", ("file", "separator"))
    if "skip_lines" in given:
        out.skip_lines = file.whole(("file", "skip_lines"), 0, 10**9)
    for kind in ("columns", "constants"):
        for name in file.table((kind,), file.get((kind,)) or ()):
            if not COLUMN.match(name):
                said = f"'{name}' is not a log's column (time_s, i1_a, v1_v, u1, t1_c, fan, ambient_c)"
                raise file.refuse(said, (kind, name), True)
            if kind == "columns":
                out.columns[name] = _read_rule(file, name)
            else:
                out.constants[name] = file.number((kind, name), -FINITE, FINITE, name)
    if "time_s" not in out.columns:
        raise file.refuse("the mapping has no time_s under [columns]", ("columns",))
    return out


def _read_rule(file: TomlFile, name: str) -> _Rule:
    at = ("columns", name)
    rule = file.get(at)
    given = file.table(at, ("column", "unit", "scale", "offset")) if isinstance(rule, dict) else {"column": rule}
    sources = given.get("column")
    sources = sources if isinstance(sources, list) else [sources]
    if not sources or not all(isinstance(one, str) for one in sources):
        raise file.refuse(f'{name} needs the source\'s column: {name} = {{ column = "its name" }}', at)
    unit = str(given.get("unit", ""))
    iso = name == "time_s" and unit == "iso"
    if unit not in UNITS and not iso:
        known = ", ".join(filter(None, UNITS))
        raise file.refuse(f"unknown unit '{unit}' for {name}: {known}; time_s: iso", at)
    factor, offset = (1.0, 0.0) if iso else UNITS[unit]
    scale = file.number((*at, "scale"), -FINITE, FINITE, "scale") if "scale" in given else 1.0
    shift = file.number((*at, "offset"), -FINITE, FINITE, "offset") if "offset" in given else 0.0
    return _Rule(sources, factor * scale, offset + shift, iso)


def _split(path: str | Path, rules: _Mapping) -> tuple[pd.DataFrame, list[str], list[int]]:
    """Return another logger's cells as text, its lines and their numbers; the header is the first of either."""
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", "replace")
    if not text.strip():
        raise InputError("the file is empty", path)
    numbered = enumerate(text.splitlines(), 1)
    kept = [(n, one) for n, one in numbered if n > rules.skip_lines and one.strip() and one[0] != "#"]
    if not kept:
        raise InputError("only comments and skipped lines: there is no header", path, 1)
    numbers, lines = [n for n, _ in kept], [one for _, one in kept]
    rules.separator = rules.separator or next((one for one in ";\t" if one in lines[0] and "," not in lines[0]), ",")
    rules.decimal = rules.decimal or ("." if rules.separator == "," else ",")
    if len(lines) < 2:
        raise InputError("there is a header but no row", path, numbers[0])
    rows: list[list[str]] = []
    for number, line in kept:
        try:
            (cells,) = csv.reader([line], delimiter=rules.separator, skipinitialspace=True)
        except csv.Error as error:
            raise InputError(f"{error} (separator '{rules.separator}')", path, number, 1) from None
        rows.append(cells)
        if len(cells) != len(rows[0]):
            said = f"{len(cells)} cells where the header has {len(rows[0])} (separator '{rules.separator}')"
            raise InputError(said, path, number, len(line) + 1)
    names = [name.strip() for name in rows[0]]
    for name in names:
        if names.count(name) > 1 and any(name in rule.sources for rule in rules.columns.values()):
            raise InputError(f"column '{name}' is there twice", path, numbers[0], 1)
    return pd.DataFrame(rows[1:], columns=names, dtype=str), lines, numbers


def import_table(path: str | Path, mapping: str | Path) -> str:
    """Return the text of a log made from `path` by a mapping file or the name of a built-in mapping.

    The mapping (TOML): `[columns]` gives for each of the log's columns the source's name, or a table {column, unit, scale,
    offset}: the number times `scale` is in `unit`, and `offset`, in the log's own unit, is added at the end. `[file]`
    may give `separator`, `decimal`, `skip_lines`; `[constants]` gives columns of one value.
    """
    rules = _read_mapping(mapping)
    frame, lines, numbers = _split(path, rules)
    out: dict[str, np.ndarray] = {}
    for name, rule in rules.columns.items():
        found = next((one for one in rule.sources if one in frame.columns), None)
        if found is None:
            has = ", ".join(f"'{one}'" for one in frame.columns[:12])
            raise InputError(f"no column '{rule.sources[0]}' for {name}: the file has {has}", path, numbers[0], 1)
        cells = frame[found].str.strip()
        empty = cells.isin(["", "nan", "NaN", "NA", "-", "None"])
        if rule.iso:
            stamps = pd.to_datetime(cells.where(~empty), errors="coerce", format="ISO8601", utc=True)
            values = (stamps - stamps.iloc[0]).dt.total_seconds()
        else:
            plain = cells.str.replace(rules.decimal, ".", regex=False) if rules.decimal != "." else cells
            values = pd.to_numeric(plain.where(~empty), errors="coerce").replace([math.inf, -math.inf], math.nan)
        bad = np.flatnonzero((values.isna() & (~empty | (name == "time_s"))).to_numpy())
        if bad.size:
            row = int(bad[0]) + 1
            before = lines[row].split(rules.separator)[: list(frame.columns).index(found)]
            raise InputError(
                f"'{cells.iloc[row - 1]}' in column '{found}' is not a {'time' if rule.iso else 'number'}"
                + ("" if rule.iso or rules.decimal == "," or "," not in cells.iloc[row - 1] else ' (decimal = ","?)'),
                path,
                numbers[row],
                1 + sum(len(one) + 1 for one in before),
            )
        out[name] = values.to_numpy(float) * rule.factor + rule.offset
    for name, value in rules.constants.items():
        out[name] = np.full(len(frame), value)
    time_s = out.pop("time_s")
    for name in out:
        if re.fullmatch(r"t\d+_c", name):
            _refuse_kelvin(out[name], f'unit = "K" for {name} in the mapping converts', path)
    return log_text(time_s, out, {"imported_from": Path(path).name, "mapping": Path(str(mapping)).name}, 5)


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
    file = TomlFile(path)
    regions: list[Region] = []

    def pixels(at: At, least: float, *keys: str) -> list[float]:
        """Return numbers of a table, from the least that they may be."""
        file.table(at, file.get(at))
        return [file.number((*at, key), least, 1e5) for key in keys]

    if file.get(grid := ("grid",)):
        rows, cols = (int(one) for one in pixels(grid, 1, "rows", "cols"))
        if rows * cols > MAX_SPRINGS:
            raise file.refuse(f"{rows} x {cols} are more than {MAX_SPRINGS} springs", (*grid, "rows"))
        half_w, half_h = (one / 2 for one in pixels(grid, 1, "width", "height"))
        left, top = pixels(grid, 0, "left", "top")
        (step_x,) = pixels(grid, 1, "step_x") if cols > 1 else (0.0,)
        (step_y,) = pixels(grid, 1, "step_y") if rows > 1 else (0.0,)
        for k in range(rows * cols):
            x, y = left + (k % cols) * step_x, top + (k // cols) * step_y
            x0, y0 = round(x - half_w), round(y - half_h)
            regions.append(Region(k + 1, x0, y0, max(round(x + half_w), x0 + 1), max(round(y + half_h), y0 + 1)))
    for at in file.tables(("region",)):
        left, top = (int(one) for one in pixels(at, 0, "left", "top"))
        width, height, spring = (int(one) for one in pixels(at, 1, "width", "height", "spring"))
        regions.append(Region(spring, left, top, left + width, top + height))
    if not regions:
        raise InputError("no region: give [grid] or [[region]] tables", path, 1)
    seen: set[int] = set()
    for one in regions:
        if not 1 <= one.spring <= MAX_SPRINGS or one.spring in seen:
            raise InputError(f"spring {one.spring} is there twice or not in 1..{MAX_SPRINGS}", path)
        seen.add(one.spring)
    return sorted(regions, key=lambda one: one.spring)


def frames_of(path: str | Path) -> tuple[int, Iterator[np.ndarray]]:
    """Return the count of frames and an iterator over them: .npy (frames, height, width), or a folder of CSVs."""
    path = Path(path)
    if path.is_dir():
        files = sorted(path.glob("*.csv"))
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
    statistic: str = "mean",
    say: Callable[[int], None] = lambda row: None,
    unit: str = "degC",
) -> dict[str, np.ndarray]:
    """Return {t{k}_c: (frames,)} of a frame sequence in `unit`, a region a spring; `statistic` mean, median, max."""
    reduce = {"mean": np.mean, "median": np.median, "max": np.max}[statistic]
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
                out[row, k] = reduce(good)
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
        raise InputError(f"nothing is ever colder than {coldest:.0f}: looks like kelvin, {advice}", path)


def merge_into_log(
    log_path: str | Path,
    times_s: np.ndarray | None,
    interval_s: float,
    offset_s: float,
    columns: dict[str, np.ndarray],
) -> str:
    """Return a log's text with camera temperatures put onto its times (straight lines between frames).

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
    for name, values in columns.items():
        good = np.isfinite(values)
        merged[name] = (
            np.interp(time_s, when[good], values[good], left=np.nan, right=np.nan)
            if good.any()
            else np.full(len(time_s), np.nan)
        )
    return log_text(time_s, merged, table.keys | {"temperatures_from": "camera frames"}, 5)
