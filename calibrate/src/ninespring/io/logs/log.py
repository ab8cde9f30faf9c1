"""Logs (docs/files.md): which columns there are, their units and limits, and what is refused.

A log that cannot be used is refused whole with file, line, column and advice.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..ranges import LOG_TIME_S
from ..statistics import last_digit, rounding
from . import mending
from .run import SENSORS, DriveMode, Run
from .table import Table
from .writing import sha256_of

if TYPE_CHECKING:
    import pandas as pd

MAX_SPRINGS = 64
COLUMN = re.compile(r"^(?:time_s|fan|ambient_c|([ivtf])([1-9][0-9]?)_([avcn])|u([1-9][0-9]?))$")
EXTRA = re.compile(r"^(?:[mpy][1-9][0-9]?_c|(?:[xd]|px|limits)[1-9][0-9]?|(?:s|cut)[1-9][0-9]?_a|state|note_.*)$")
"""Columns that the simulator and the board write beside the measured ones: skipped."""
UNIT_OF = {"i": "a", "v": "v", "t": "c", "f": "n"}
LIMITS = {
    "time_s": (
        LOG_TIME_S.low,
        LOG_TIME_S.high,
        "s",
        "not a time in seconds: milliseconds are divided by 1000 (`ninespring import --map`)",
    ),
    "i": (-0.5, 20.0, "A", "looks like milliamperes: divide by 1000 (`ninespring import --map`)"),
    "v": (-0.5, 60.0, "V", "looks like millivolts: divide by 1000 (`ninespring import --map`)"),
    "u": (
        -1e-9,
        1.0 + 1e-9,
        "",
        "commands run from 0 to 1: a command in % is divided by 100, what a controller asks beyond that is cut off",
    ),
    "t": (-60.0, 400.0, "degC", "not a spring's temperature: leave the cell empty if not measured"),
    "f": (-0.5, 100.0, "N", "looks like millinewtons or grams: a load is in N (`ninespring import --map`)"),
    "fan": (-1e-9, 1.0 + 1e-9, "", "the fan runs from 0 to 1: a fan in % is divided by 100"),
    "ambient_c": (-40.0, 60.0, "degC", "looks like Fahrenheit or kelvin: give degC"),
}
"""Per kind of column: lowest, highest, unit, and what to do about a value beyond them."""
BELOW = {
    "i": "a negative current: the leads of that sensor are swapped? Turn the sign (`ninespring import --map`, scale = -1)",
    "v": "a negative voltage: the leads of that sensor are swapped? Turn the sign (`ninespring import --map`, scale = -1)",
    "f": "a negative load: turn the sign (`ninespring import --map`, scale = -1), 0 is no load",
    "u": "a negative command: commands run from 0 to 1",
}
"""What to do about a value below the lowest, where that is another thing."""

NAMES_OF = (
    (
        r"t(?:emp|emperature)?_?([1-9][0-9]?)_(?:deg)?f",
        "t{}_c",
        "temperatures are in degC: convert with (F - 32) / 1.8",
    ),
    (r"t(?:emp|emperature)?_?([1-9][0-9]?)_k", "t{}_c", "temperatures are in degC: subtract 273.15"),
    (r"t(?:emp|emperature)?_?([1-9][0-9]?)(?:_(?:deg)?c)?", "t{}_c", "if it is in degC"),
    (r"(?:i|current)_?([1-9][0-9]?)_ma", "i{}_a", "currents are in ampere: divide by 1000"),
    (r"(?:i|current)_?([1-9][0-9]?)(?:_a)?", "i{}_a", "if it is in ampere"),
    (r"(?:v|voltage)_?([1-9][0-9]?)_mv", "v{}_v", "voltages are in volt: divide by 1000"),
    (r"(?:v|voltage)_?([1-9][0-9]?)(?:_v)?", "v{}_v", "if it is in volt"),
    (r"[uq]([1-9][0-9]?)(?:_pct|_percent)", "u{}", "a command is 0 to 1: divide by 100"),
    (r"[uq]([1-9][0-9]?)", "u{}", "a command is 0 to 1: divide by 100 if it is in percent"),
    (r"(?:time|t)_ms|ms", "time_s", "times are in seconds: divide by 1000"),
    (r"(?:time|t)_min", "time_s", "times are in seconds: multiply by 60"),
    (r"time|t|t_s|time_sec|seconds|time \(sec\)|timestamp", "time_s", "if it is in seconds"),
    (r"(?:ambient|t_air|air)_f", "ambient_c", "temperatures are in degC: convert with (F - 32) / 1.8"),
    (r"(?:ambient|t_air|air)(?:_c)?", "ambient_c", "if it is in degC"),
    (r"fan_(?:pct|percent)", "fan", "the fan runs from 0 to 1: divide by 100"),
)
"""Names that others give to a log's columns: what they are called here, and what to do with their numbers."""


def _advice(name: str) -> str:
    plain = re.sub(r"[\s_]*[(\[]\W*(\w+)[)\]]", r"_\1", name).lower()  # Time (s), T1 [°C]
    if COLUMN.match(plain):
        return f"name it {plain}"
    for other, ours, todo in NAMES_OF:
        if found := re.fullmatch(other, plain):
            return f"{todo},{'' if todo.startswith('if ') else ' and'} name it {ours.format(*found.groups())}"
    return "a log has time_s, i1_a, v1_v, u1, t1_c, f1_n ..., fan, ambient_c; note_... is skipped"


def _check_range(table: Table, name: str, kind: str, notes: list[str]) -> None:
    low, high, unit, advice = LIMITS[kind]
    values = table.frame[name].to_numpy()
    beyond = (values < low) | (values > high)
    bad = np.flatnonzero(beyond)
    if kind == "t" and 0 < bad.size <= mending.FEW * len(values):
        # what a thermometer's chip says of a reading that failed (-127, 1372): no unit is wrong of one cell in a hundred
        first = f"{values[bad[0]]:g} degC in line {table.lines[bad[0]]}"
        notes.append(
            f"{name}: {bad.size} cell{'s' * (bad.size > 1)} that no spring can have left out, the first {first}"
        )
        table.frame[name] = np.where(beyond, np.nan, values)
    elif bad.size:
        if values[bad[0]] < low and abs(values[bad[0]]) <= high:
            advice = BELOW.get(kind, advice)
        said = f"{name} = {values[bad[0]]:g} {unit}".rstrip()
        raise table.refuse_cell(f"{said}: {advice}", int(bad[0]), name)


def _driving_columns(table: Table, springs: int | None, temperatures: bool, why: str) -> tuple[str, int, bool]:
    """Return by what a log is driven ('i' or 'u'), its number of springs, whether it has voltages; refuse a wrong header."""
    groups: dict[str, set[int]] = {"i": set(), "v": set(), "t": set(), "u": set(), "f": set()}
    because = f" ({why})" if why else ""
    for name in table.names:
        if EXTRA.match(name):
            continue
        match = COLUMN.match(name)
        if not match or (match[1] and UNIT_OF.get(match[1]) != match[3]):
            said = f"unknown column '{name}': {_advice(name)} (`ninespring import --map` converts and renames)"
            raise table.refuse_header(said, name)
        if number := int(match[2] or match[4] or 0):
            if number > min(springs or MAX_SPRINGS, MAX_SPRINGS):
                has = f"the array has {springs}" if springs else f"a log has at most {MAX_SPRINGS}"
                said = f"column '{name}' but {has} springs{because}"
                raise table.refuse_header(said, name)
            groups[match[1] or "u"].add(number)
    if "time_s" not in table.names:
        raise table.refuse_header("no column time_s")
    if temperatures and not groups["t"]:
        more = ": with currents and voltages alone, `ninespring fit` tells what they do" if groups["v"] else ""
        raise table.refuse_header(f"no temperature column (t1_c ...){more}")
    count = springs or max(set().union(*groups.values()), default=0)
    everyone = set(range(1, count + 1))
    letter = "i" if groups["i"] else "u"
    if not groups[letter]:
        raise table.refuse_header("neither currents (i1_a ...) nor commands (u1 ...)")
    if missing := sorted(everyone - groups[letter]):
        example = f"i{missing[0]}_a" if letter == "i" else f"u{missing[0]}"
        said = f"spring {missing[0]} has no column {example}: add it (0 where the spring is not driven){because}"
        raise table.refuse_header(said)
    if letter == "i" and groups["v"] and (missing := sorted(everyone - groups["v"])):
        said = f"spring {missing[0]} has no column v{missing[0]}_v but others have: log all voltages or none"
        raise table.refuse_header(said)
    return letter, count, bool(groups["v"])


def _layers(table: Table, springs: int) -> int:
    given = table.keys.get("layers", "1")
    if given not in ("1", "2"):
        raise table.refuse(f"layers: {given}; there are 1 or 2", 1)
    if given == "2" and springs % 2:
        raise table.refuse(f"layers: 2, but {springs} springs: a stiffness spring below each is an even number", 1)
    return int(given)


BOARD_STEP_V = 4e-3
"""Of a board's voltages."""
CUT_SHORT = "a fault cut this run short"
"""So begins what is said first of a log whose springs a fault switched off."""


def _cut_short(table: Table, frame: pd.DataFrame) -> list[str]:
    """Return what is to be said of the board's faults: what its recorder wrote, or what the state of the rows shows."""
    said = [fault.removeprefix("fault ") for fault in table.faults]
    if not said and "state" in frame:
        state = frame["state"].astype(str)
        bad = np.flatnonzero(state.str.startswith("fault_") & (state != state.shift()))
        said = [f"at {frame['time_s'].iloc[k]:.1f} s: {state.iloc[k].replace('_', ' ')}" for k in bad]
    more = f" and {len(said) - 1} more" if len(said) > 1 else ""
    return [f"{CUT_SHORT}, {said[0]}{more}: its springs were off from then on"] if said else []


def read_log(
    path: str | Path, springs: int | None = None, temperatures: bool = True, why: str = "", or_resistance: bool = False
) -> Run:
    """Read and check one log; `springs` is the array's number (`why` says whose), None to take what the header says.

    `temperatures`: refuse a log without any, unless `or_resistance` and it has currents and voltages.
    """
    table = Table(path)
    kinds = {found[1] for name in table.names if (found := COLUMN.match(name))}
    wanted = temperatures and not (or_resistance and {"i", "v"} <= kinds and "t" not in kinds)
    letter, count, has_voltages = _driving_columns(table, springs, wanted, why)
    table.read_rows()
    notes: list[str] = []
    _check_cells(table, notes)
    frame = _kept_rows(table, notes)
    run = _run_of(table, frame, letter, count, has_voltages, notes)
    without = [str(k) for k in range(1, count + 1) if f"t{k}_c" not in frame]
    if without and temperatures and len(without) < count:
        notes.append(f"no temperature of spring {', '.join(without)}: simulated, but not compared")
    mending.mend_placeholders(run)
    mending.refuse_wrong_units(run, table)
    mending.mend_swapped(run)
    mending.mask_bad_sensors(run)
    mending.mend_first_reading(run)
    mending.mask_glitches(run)
    mending.mend_ambient(run)
    mending.find_gaps(run)
    run.warm = mending.begins_warm(run)
    run.rounding_c = rounding(run.temperature_c, run.starts)
    mending.doubt_units(run)
    if wanted and not np.isfinite(run.temperature_c).any():
        why = f" ({notes[-1]})" if notes else ""
        raise table.refuse(f"no usable temperature in the whole log{why}")
    return run


def _check_cells(table: Table, notes: list[str]) -> None:
    """Refuse a number out of its range, or an empty cell where something must stand; leave a few temperatures out that are none."""
    for name in table.names:
        if EXTRA.match(name):
            continue
        _check_range(table, name, name if name in LIMITS else name[0], notes)
        if name == "time_s" or name[0] in "iuvf":
            holes = np.flatnonzero(table.frame[name].isna().to_numpy())
            if holes.size:
                said = f"{name} is empty: only temperatures and ambient_c may be"
                raise table.refuse_cell(said, int(holes[0]), name)


def _kept_rows(table: Table, notes: list[str]) -> pd.DataFrame:
    """Return the rows that count: time rises, and the last one is whole."""
    rows = len(table.frame)
    keep = mending.rising_rows(table, notes)
    if table.unfinished and rows > 3:
        keep[-1] = False
    if table.cut_off or (table.unfinished and rows > 3):
        notes.append("the last line has no end, it may be cut off: left out")
    frame = table.frame.iloc[keep]
    notes[:0] = _cut_short(table, frame)
    if len(frame) < 3:
        raise table.refuse(f"{len(frame)} rows: too short to say anything", int(table.lines[-1]))
    return frame


def _run_of(table: Table, frame: pd.DataFrame, letter: str, count: int, has_voltages: bool, notes: list[str]) -> Run:
    """Return a run of the rows as they are: what drives the springs is a power, a current or a command."""
    nothing = np.full(len(frame), np.nan)

    def matrix(pattern: str, missing: np.ndarray = nothing) -> np.ndarray:
        names = [pattern.format(k) for k in range(1, count + 1)]
        return np.column_stack([frame[name].to_numpy(float) if name in frame else missing for name in names])

    mode: DriveMode
    current = voltage = None
    if letter == "i":
        current = matrix("i{}_a")
        if has_voltages:
            voltage = matrix("v{}_v")
            mode, drive = "power", np.maximum(current * voltage, 0.0)  # offsets about zero heat nothing
        else:
            mode, drive = "current", np.maximum(current, 0.0)
    else:
        mode, drive = "command", np.clip(matrix("u{}"), 0.0, 1.0)
        if has_voltages:
            notes.append("voltages without currents say nothing of the power: not used")
    ambient = None
    if "ambient_c" in frame and frame["ambient_c"].notna().any():
        ambient = frame["ambient_c"].ffill().bfill().to_numpy(float)
    load = None
    if any(f"f{k}_n" in frame for k in range(1, count + 1)):
        # a spring without a column carries none; a balance's offset is no pull
        load = np.maximum(matrix("f{}_n", np.zeros(len(frame))), 0.0)
    return Run(
        name=table.path,
        sha256=sha256_of(table.path),
        time_s=frame["time_s"].to_numpy(float),
        mode=mode,
        drive=drive,
        temperature_c=matrix("t{}_c"),
        fan=np.clip(frame["fan"].to_numpy(float), 0.0, 1.0) if "fan" in frame else np.zeros(len(frame)),
        ambient_c=ambient,
        current_a=current,
        voltage_v=voltage,
        layers=_layers(table, count),
        load_n=load,
        notes=notes,
        sensor=next((one for one in SENSORS if one == table.keys.get("sensor")), ""),
        step_v=BOARD_STEP_V if table.keys.get("version", "").startswith("ninespring ") else last_digit(voltage),
    )
