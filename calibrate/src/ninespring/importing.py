"""Other people's files into logs: column names and units by a mapping file, camera frames by a region per spring."""

from __future__ import annotations

import io
import math
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .errors import InputError
from .logs import COLUMN, LIMITS, MAX_SPRINGS, log_text, read_bytes

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

BUILT_IN: dict[str, dict[str, Any]] = {
    "tclab": {
        "columns": {
            "time_s": "Time (sec)",
            "u1": {"column": ["Heater 1 (%)", "Heater 1"], "unit": "%"},
            "u2": {"column": ["Heater 2 (%)", "Heater 2"], "unit": "%"},
            "t1_c": ["Temperature 1 (degC)", "Temperature 1"],
            "t2_c": ["Temperature 2 (degC)", "Temperature 2"],
        }
    },
    "tclab-prbs": {
        "columns": {
            "time_s": "t_s",
            "u1": {"column": "Q1_pct", "unit": "%"},
            "u2": {"column": "Q2_pct", "unit": "%"},
            "t1_c": "T1_C",
            "t2_c": "T2_C",
        }
    },
}
"""Mappings that come with the tool: `--map tclab`."""


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file; syntax errors are refused with line and column."""
    try:
        return tomllib.loads(read_bytes(path).decode("utf-8"))
    except UnicodeDecodeError:
        raise InputError("not UTF-8 text", path, 1) from None
    except tomllib.TOMLDecodeError as error:
        match = re.search(r"^(.*) \(at line (\d+), column (\d+)\)$", str(error))
        if match:
            raise InputError(f"this is not TOML: {match[1]}", path, int(match[2]), int(match[3])) from None
        raise InputError(f"this is not TOML: {error}", path) from None


def line_of(path: str | Path, text: str) -> int | None:
    """Return the first 1-based line of a file that holds `text`."""
    for number, line in enumerate(read_bytes(path).decode("utf-8", "replace").splitlines(), 1):
        if text in line:
            return number
    return None


def import_table(path: str | Path, mapping: str | Path) -> str:
    """Return the text of a log made from `path` by a mapping file or the name of a built-in mapping.

    The mapping (TOML): `[columns]` gives for each of the log's columns the source's name, or a table
    {column, unit | scale, offset}; `[file]` may give `separator`, `decimal`, `skip_lines`; `[constants]`
    gives columns of one value.
    """
    if str(mapping) in BUILT_IN:
        rules, place = BUILT_IN[str(mapping)], None
    else:
        rules, place = read_toml(mapping), mapping
    if unknown := set(rules) - {"columns", "file", "constants"}:
        raise InputError(
            f"unknown table [{sorted(unknown)[0]}]: a mapping has [columns], [file], [constants]",
            place,
            line_of(mapping, sorted(unknown)[0]) if place else None,
        )
    options = rules.get("file", {})
    separator = options.get("separator", ",")
    decimal = options.get("decimal", ".")
    skip = int(options.get("skip_lines", 0))
    text = read_bytes(path).decode("utf-8-sig", "replace")
    if not text.strip():
        raise InputError("the file is empty", path)
    try:
        frame = pd.read_csv(
            io.StringIO(text),
            sep=separator,
            decimal=decimal,
            skiprows=skip,
            skipinitialspace=True,
            comment="#",
            dtype=str,
            index_col=False,
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        match = re.search(r"line (\d+)", str(error))
        raise InputError(
            f"cannot be split into columns by '{separator}'", path, int(match[1]) if match else None
        ) from None
    frame.columns = [str(name).strip() for name in frame.columns]
    out: dict[str, np.ndarray] = {}
    for name, rule in rules.get("columns", {}).items():
        if not COLUMN.match(name):
            raise InputError(
                f"'{name}' is not a log's column (time_s, i1_a, v1_v, u1, t1_c, fan, ambient_c)",
                place,
                line_of(mapping, name) if place else None,
            )
        if not isinstance(rule, dict):
            rule = {"column": rule}
        sources = rule["column"] if isinstance(rule["column"], list) else [rule["column"]]
        found = next((one for one in sources if one in frame.columns), None)
        if found is None:
            raise InputError(
                f"no column '{sources[0]}' for {name}: the file has "
                + ", ".join(f"'{one}'" for one in frame.columns[:12]),
                path,
                skip + 1,
            )
        unit = rule.get("unit", "")
        if unit not in UNITS:
            raise InputError(
                f"unknown unit '{unit}' for {name}: " + ", ".join(filter(None, UNITS)),
                place,
                line_of(mapping, name) if place else None,
            )
        factor, offset = UNITS[unit]
        factor, offset = (
            factor * rule.get("scale", 1.0),
            offset * rule.get("scale", 1.0) + (rule.get("offset", 0.0)),
        )
        cells = frame[found].astype(str).str.strip()
        if decimal != ".":
            cells = cells.str.replace(decimal, ".", regex=False)
        empty = cells.isin(["", "nan", "NaN", "NA", "-", "None"])
        values = pd.to_numeric(cells.where(~empty), errors="coerce")
        bad = np.flatnonzero((values.isna() & ~empty).to_numpy())
        if bad.size:
            raise InputError(
                f"'{cells.iloc[bad[0]]}' in column '{found}' is not a number",
                path,
                skip + 2 + int(bad[0]),
            )
        out[name] = values.to_numpy(float) * factor + offset
    if "time_s" not in out:
        raise InputError("the mapping has no time_s under [columns]", place or str(mapping))
    for name, value in rules.get("constants", {}).items():
        out[name] = np.full(len(frame), float(value))
    time_s = out.pop("time_s")
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
    data = read_toml(path)
    regions: list[Region] = []

    def number(table: dict[str, Any], key: str, where: str) -> float:
        value = table.get(key)
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise InputError(f"{where} needs a number '{key}'", path, line_of(path, where))
        return float(value)

    if grid := data.get("grid"):
        rows, cols = int(number(grid, "rows", "[grid]")), int(number(grid, "cols", "[grid]"))
        half_w, half_h = (
            number(grid, "width", "[grid]") / 2,
            number(grid, "height", "[grid]") / 2,
        )
        for k in range(rows * cols):
            x = number(grid, "left", "[grid]") + (k % cols) * number(grid, "step_x", "[grid]")
            y = number(grid, "top", "[grid]") + (k // cols) * number(grid, "step_y", "[grid]")
            regions.append(
                Region(
                    k + 1,
                    round(x - half_w),
                    round(y - half_h),
                    max(round(x + half_w), round(x - half_w) + 1),
                    max(round(y + half_h), round(y - half_h) + 1),
                )
            )
    for one in data.get("region", []):
        left, top = int(number(one, "left", "[[region]]")), int(number(one, "top", "[[region]]"))
        regions.append(
            Region(
                int(number(one, "spring", "[[region]]")),
                left,
                top,
                left + int(number(one, "width", "[[region]]")),
                top + int(number(one, "height", "[[region]]")),
            )
        )
    if not regions:
        raise InputError("no region: give [grid] or [[region]] tables", path, 1)
    seen: set[int] = set()
    for one in regions:
        if not 1 <= one.spring <= MAX_SPRINGS or one.spring in seen:
            raise InputError(f"spring {one.spring} is there twice or not in 1..64", path)
        seen.add(one.spring)
        if one.right <= one.left or one.bottom <= one.top:
            raise InputError(f"the region of spring {one.spring} is empty", path)
    return sorted(regions, key=lambda one: one.spring)


def frames_of(path: str | Path) -> tuple[int, Iterator[np.ndarray]]:
    """Return the count of frames and an iterator over them: .npy (frames, height, width), or a folder of CSVs."""
    path = Path(path)
    if path.is_dir():
        files = sorted(path.glob("*.csv"))
        if not files:
            raise InputError("no .csv frame in this folder", path)

        def read() -> Iterator[np.ndarray]:
            for file in files:
                yield _read_frame(file)

        return len(files), read()
    if path.suffix in (".npy", ".npz"):
        try:
            data = np.load(path, mmap_mode="r" if path.suffix == ".npy" else None)
        except (OSError, ValueError) as error:
            raise InputError(f"not a NumPy array: {error}", path) from None
        if path.suffix == ".npz":
            data = data[data.files[0]]
        if data.ndim == 2:
            data = data[None]
        if data.ndim != 3 or not np.issubdtype(data.dtype, np.number):
            raise InputError(f"shape {data.shape}: frames are (frames, height, width) numbers in degC", path)
        return len(data), (np.asarray(frame, dtype=float) for frame in data)
    return 1, iter([_read_frame(path)])


def _read_frame(file: Path) -> np.ndarray:
    lines = read_bytes(file).decode("utf-8-sig", "replace").splitlines()
    separator = ";" if any(";" in line for line in lines[:3]) else ","
    frame: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        cells = line.strip().strip(separator).split(separator)
        try:
            values = [float(cell.replace(",", ".") if separator == ";" else cell) for cell in cells]
        except ValueError:
            raise InputError("a pixel is not a number", file, number) from None
        if frame and len(values) != len(frame[0]):
            raise InputError(f"{len(values)} pixels where the first row has {len(frame[0])}", file, number)
        frame.append(values)
    if not frame:
        raise InputError("the frame is empty", file)
    return np.asarray(frame)


def read_times(path: str | Path) -> np.ndarray:
    """Read times of frames, s, one a line, rising; # begins a comment."""
    out: list[float] = []
    for number, raw in enumerate(read_bytes(path).decode("utf-8-sig", "replace").splitlines(), 1):
        text = raw.partition("#")[0].strip()
        if not text:
            continue
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
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
    times_s: np.ndarray | None,
    interval_s: float,
    statistic: str = "mean",
    say: Callable[[int], None] = lambda row: None,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times (n,) and {t{k}_c: (n,)} of a frame sequence, a region a spring; `statistic` mean, median, max."""
    if times_s is None:
        times_s = np.arange(count) * interval_s
    elif len(times_s) != count:
        raise InputError(f"{len(times_s)} times for {count} frames", path)
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
    low, high, unit, _ = LIMITS["t"]
    for k, one in enumerate(regions):
        if np.any(bad := (out[:, k] < low) | (out[:, k] > high)):
            row = int(np.flatnonzero(bad)[0])
            raise InputError(
                f"spring {one.spring} shows {out[row, k]:g} in frame {row + 1}: frames are in {unit} (raw counts, "
                "or kelvin times 100?)",
                path,
            )
    return times_s, {f"t{one.spring}_c": out[:, k] for k, one in enumerate(regions)}


def merge_into_log(log_path: str | Path, times_s: np.ndarray, columns: dict[str, np.ndarray]) -> str:
    """Return a log's text with camera temperatures put onto its times (straight lines between frames)."""
    from .logs import read_table

    table = read_table(log_path)
    time_s = table.frame["time_s"].to_numpy(float)
    merged = {n: table.frame[n].to_numpy(float) for n in table.names if n != "time_s"}
    for name, values in columns.items():
        good = np.isfinite(values)
        merged[name] = (
            np.interp(time_s, times_s[good], values[good], left=np.nan, right=np.nan)
            if good.any()
            else np.full(len(time_s), np.nan)
        )
    return log_text(time_s, merged, table.keys | {"temperatures_from": "camera frames"}, 5)
