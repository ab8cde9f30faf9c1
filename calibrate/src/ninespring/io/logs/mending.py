"""What is mended of a log without guessing, and what is doubted of it: both are said in `Run.notes`.

Repeated rows, placeholders, gaps, glitches, swapped readings, a saturated, dead or frozen sensor are mended; wrong units are refused or doubted.
"""

from __future__ import annotations

import itertools
import warnings

import numpy as np

from ...errors import InputError
from ..statistics import noise_floor, rounding
from .branch import BEGINS_S, FEWEST, STEADY_K, hotter_before, moved_k
from .run import Run
from .table import Table

JUMP_K = 5.0
"""The air of a room does not go so far from one row to the next."""
LONGEST_S = 60.0 * 86400.0
"""No bench logs two months in one go: a longer log is in milliseconds."""
SPARSE_S = 100.0
"""Rows so far apart show no spring's warming, which takes a minute: of days of them, none is a second's."""
DAY_S = 86400.0
FEW = 0.01
"""Part of the rows: so many times may be there twice, as programs log that simulate by steps. More are of a clock that is too coarse."""
STOPPED_ROWS = 30
"""In so many rows before it stays where it is a sensor that something stops has moved by more than its steps."""
SWITCHED = 0.05
"""Of a spring's range of drive: what changes by more is switched, and no noise of what measured it."""
RESTED_K = 3.0
"""How far below its first readings a spring may come that began at its room: a room drifts, in Fahrenheit twice as far."""
ROOM_C, ROOM_K = 22.0, 6.0
"""A room of which nothing is known: most are within so many kelvin of it."""
QUICKER = 4.0
"""Times as far as from row to row afterwards a thermometer may go in its first row, rows being as far apart as its spring is slow."""
QUICKEST_S = 15.0
"""In which a spring answers at the soonest: 0.17 J/K that lose 11 mW/K to a fan's air."""
RUN_IN_S = 120.0
"""After a gap: how long the noise of the temperatures that the simulation starts from is still felt."""


def rising_rows(table: Table, notes: list[str]) -> np.ndarray:
    """Rows whose time rises. Exact repeats are dropped and said, and a few rows that hold for no time; anything else is refused."""
    time_s = table.frame["time_s"].to_numpy(float)
    keep = np.ones(len(time_s), dtype=bool)
    if (np.diff(time_s) > 0).all():
        return keep
    again = table.frame.duplicated().to_numpy()
    keep = ~again
    rows = np.flatnonzero(keep)
    step = np.diff(time_s[rows])
    if 0 < (none := int(np.count_nonzero(step == 0))) < FEW * step.size:
        keep[rows[:-1][step == 0]] = False
        rows, step = np.flatnonzero(keep), step[step != 0]
        notes.append(f"{none} row{'s' * (none > 1)} at the next one's time dropped: a later row counts")
    if (step <= 0).any():
        at = int(np.flatnonzero(step <= 0)[0])
        before, now = time_s[rows[at]], time_s[rows[at + 1]]
        said = (
            f"time_s repeats {now:.10g} with other values"
            if now == before
            else f"time_s falls from {before:.10g} to {now:.10g} (two runs in one file? Make two files)"
        )
        raise table.refuse_cell(f"{said}: times must rise strictly", int(rows[at + 1]), "time_s")
    if repeated := int(again.sum()):
        notes.append(f"{repeated} repeated row{'s' * (repeated > 1)} dropped")
    return keep


def refuse_wrong_units(run: Run, table: Table) -> None:
    """Months in one log, or days of rows minutes apart: milliseconds. Springs above 45 degC though nothing is driven: Fahrenheit or kelvin."""
    usual = float(np.median(np.diff(run.time_s)))
    if run.duration_s > LONGEST_S or (usual > SPARSE_S and run.duration_s > DAY_S):
        days = run.duration_s / DAY_S
        said = (
            f"the log spans {days:.3g} days, its rows {usual:g} s apart: if its time is in ms, divide by 1000 "
            "(`ninespring import --map` converts)"
        )
        raise table.refuse_cell(said, len(table.lines) - 1, "time_s")
    if not np.isfinite(run.temperature_c[:5]).any():
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may be empty
        lowest = np.nanmin(run.temperature_c, axis=0)
        first = np.nanmedian(run.temperature_c[:5], axis=0)
    quiet = not np.any(run.drive[0] > 0)
    ambient = None if run.ambient_c is None else float(run.ambient_c[0])

    def refuse(k: int, said: str) -> InputError:
        return table.refuse_cell(f"{said}, a log has degC (`ninespring import --map` converts)", 0, f"t{k + 1}_c")

    seen = np.flatnonzero(np.isfinite(lowest))
    coldest = float(lowest[seen].min())
    begins = f"nothing is driven yet the springs start at {coldest:.0f}: looks like"
    if coldest > 240.0:
        raise refuse(int(seen[0]), f"{begins} kelvin")
    together = float(np.nanmax(first) - np.nanmin(first)) < 8.0
    # nothing is colder than its room: springs that fall below where they began were warm
    rested = float(np.nanmax(first - lowest)) < RESTED_K
    if quiet and coldest > 45.0 and together and rested and (ambient is None or abs(coldest - ambient) > 20.0):
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


def doubt_units(run: Run) -> None:
    """Say what is possible but unlikely: it may be so, or a unit or a column is wrong."""
    usual = float(np.median(np.diff(run.time_s)))
    if usual > SPARSE_S:
        run.notes.append(f"the rows are {usual:g} s apart: is the time in milliseconds?")
    if run.duration_s < 60.0 and len(run.time_s) >= 60:
        run.notes.append(f"the whole log lasts {run.duration_s:.3g} s: is the time in minutes or hours?")
    read = run.temperature_c[np.isfinite(run.temperature_c).any(axis=1)]
    if read.size:
        coldest = float(np.nanmin(read))
        ambient, within = (ROOM_C, ROOM_K) if run.ambient_c is None else (float(np.median(run.ambient_c)), 5.0)
        # what only rises from where it begins begins at its room
        begins = run.ambient_c is not None or float(np.nanmin(read[:5])) - coldest < RESTED_K
        if coldest > 45.0 and begins and abs((coldest - 32.0) / 1.8 - ambient) < within:
            room = "a room" if run.ambient_c is None else f"the ambient, {ambient:.0f} degC"
            run.notes.append(
                f"no spring is ever below {coldest:.0f}, which in Fahrenheit would be {room}: "
                "are the temperatures in Fahrenheit?"
            )
    if run.ambient_c is not None and np.any(jumps := np.abs(np.diff(run.ambient_c)) > JUMP_K):
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


def mask_bad_sensors(run: Run) -> None:
    """Saturated and dead sensors are not measurements: masked, and said."""
    noise = np.nan_to_num(noise_floor(run.temperature_c))
    for k in range(run.springs):
        seen = np.flatnonzero(np.isfinite(run.temperature_c[:, k]))
        if seen.size < 10:
            continue
        measured = run.temperature_c[seen, k]
        begins, lengths = _stands(measured)
        if len(lengths) == 1 and np.ptp(run.drive.sum(axis=1)) > 0:
            others = np.delete(run.temperature_c, k, axis=1)
            moved = [np.ptp(one[np.isfinite(one)]) for one in others.T if np.isfinite(one).any()]
            if np.ptp(run.drive[:, k]) > 0 or max(moved, default=0.0) > 5.0:
                run.temperature_c[:, k] = np.nan
                run.notes.append(f"t{k + 1}_c never moves ({measured[0]:g} degC): dead sensor, left out")
                continue
        for edge, extreme in (("highest", measured.max()), ("lowest", measured.min())):
            at = int(np.argmax(np.where(measured[begins] == extreme, lengths, 0)))
            begin, longest, inner = int(begins[at]), int(lengths[at]), measured[measured != extreme]
            elsewhere = int(_stands(inner)[1].max(initial=0))
            switched = _switches(run, k, seen[begin : begin + longest - elsewhere]).size > 0
            # Ordinary quantisation also repeats values; a clipped sensor stays at ITS extreme far longer
            # than it ever stays at any other value.
            if (
                inner.size >= 10
                and longest >= 15
                and longest > 4 * elsewhere
                and _is_stopped(measured, begin, switched)
            ):
                # near the limit only what the noise carried down is seen: those rows would pull the fit
                run.temperature_c[seen[np.abs(measured - extreme) <= 4.0 * noise[k]], k] = np.nan
                run.notes.append(
                    f"t{k + 1}_c stays at its {edge} value {extreme:g} degC for {longest} rows: "
                    "saturated, those rows left out"
                )
        _mask_frozen(run, k)


def _is_stopped(measured: np.ndarray, begin: int, switched: bool) -> bool:
    """Return whether something stopped a sensor where it begins to stay at an extreme: it was on its way there, or its spring's drive changes
    meanwhile, and it stays for longer than it ever does elsewhere. A spring that has settled stays where it is, too."""
    moves = np.abs(np.diff(measured))
    step = float(moves[moves > 0].min(initial=np.inf))
    return switched or (begin > 0 and float(np.ptp(measured[max(0, begin - STOPPED_ROWS) : begin])) > 3.0 * step)


def _switches(run: Run, k: int, rows: np.ndarray) -> np.ndarray:
    """Return after which of some rows a spring's drive changes by more than the noise of what measured it."""
    return np.flatnonzero(np.abs(np.diff(run.drive[rows, k])) > SWITCHED * np.ptp(run.drive[:, k]))


def _stands(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return at which of some values a new one begins, and for how many of them it stays."""
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    return begins, np.diff(begins, append=len(values))


def _mask_frozen(run: Run, k: int) -> None:
    """A sensor that goes on showing one value after its spring's drive has changed, far longer than it ever shows another."""
    seen = np.flatnonzero(np.isfinite(run.temperature_c[:, k]))
    begins, lengths = _stands(run.temperature_c[seen, k])
    if len(lengths) < 2:
        return
    longest = int(np.argmax(lengths))
    rows = seen[begins[longest] :][: lengths[longest]]
    moved = _switches(run, k, rows)
    since = len(rows) - int(moved[0]) if moved.size else 0
    if since >= 30 and since > 4 * np.delete(lengths, longest).max():
        shown = run.temperature_c[rows[0], k]
        run.temperature_c[rows[1:], k] = np.nan
        run.notes.append(
            f"t{k + 1}_c shows {shown:g} degC from {run.time_s[rows[0]]:g} to {run.time_s[rows[-1]]:g} s "
            "whatever its spring is given: frozen, those rows left out"
        )


def mend_placeholders(run: Run) -> None:
    """A logger that has read nothing yet shows the same in all its first rows; then all thermometers jump at once, as no spring can.

    The run starts at what is read then.
    """
    seen = np.flatnonzero(np.isfinite(run.temperature_c[0]))
    values = run.temperature_c[:, seen]
    moved = np.flatnonzero((values[:-1] != values[1:]).any(axis=1))
    if not seen.size or not moved.size or moved[0] + 1 > 0.1 * len(values):
        return
    first = int(moved[0]) + 1
    noise = np.maximum(np.nan_to_num(noise_floor(values)), 0.02)
    usual = np.quantile(np.nan_to_num(np.abs(np.diff(values[first:], axis=0))), 0.99, axis=0)
    if (np.abs(values[first] - values[0]) > 10.0 * noise + 3.0 * usual).all():
        run.temperature_c[0, seen] = values[first]
        run.temperature_c[1:first, seen] = np.nan
        run.notes.append(
            f"all thermometers jump at once after the first {first} row(s): those are no readings, left out"
        )


def mend_swapped(run: Run) -> None:
    """Two thermometers that show from one row to the next what the other did, and later their own again: a logger mixed up its lines.

    Each is put back. Of those that stay so nobody knows when they were right.
    """
    values = run.temperature_c
    moved = np.abs(np.diff(values, axis=0))
    noise = np.maximum(np.nan_to_num(noise_floor(values)), 0.02)
    most = 10.0 * noise + 3.0 * np.quantile(np.nan_to_num(moved), 0.99, axis=0)
    # between rows further apart a spring may well come to where another was
    jumps = (moved > most) & (np.diff(run.time_s) < QUICKEST_S / 3.0)[:, None]
    for a, b in itertools.combinations(np.flatnonzero(jumps.any(axis=0)), 2):
        crossed = np.abs(values[1:, [a, b]] - values[:-1, [b, a]]) <= most[[a, b]]
        rows = 1 + np.flatnonzero(jumps[:, [a, b]].all(axis=1) & crossed.all(axis=1))
        for begin, end in zip(rows[::2], rows[1::2], strict=False):
            values[begin:end, [a, b]] = values[begin:end, [b, a]]
        if times := len(rows) // 2:
            run.notes.append(
                f"t{a + 1}_c and t{b + 1}_c change places {times} time{'s' * (times > 1)}, the first at "
                f"{run.time_s[rows[0]]:g} s: put back"
            )


def mask_glitches(run: Run) -> None:
    """Up to four rows far from the straight line between those around them, and from those that lead there and away.

    No spring moves like that; one that is switched goes on in another direction, and is where one of the lines leads.
    """
    noise = np.maximum(noise_floor(run.temperature_c), rounding(run.temperature_c))
    for k in range(run.springs):
        values = run.temperature_c[:, k]
        if np.isfinite(values).sum() < 30 or not np.isfinite(noise[k]):
            continue
        whole = np.isfinite(values)
        for stride in (1, 2, 4):  # so many rows are one of every stride-th
            for begin in range(stride):
                part = values[begin::stride]
                part[_spikes(part, run.time_s[begin::stride], max(float(noise[k]), 0.02))] = np.nan
        bad = np.flatnonzero(whole & np.isnan(values))
        if bad.size:
            run.notes.append(
                f"t{k + 1}_c: {bad.size} isolated spike(s) left out, the first at {run.time_s[bad[0]]:g} s"
            )


def _spikes(values: np.ndarray, time_s: np.ndarray, noise: float) -> np.ndarray:
    """Return which single values are spikes: far by what is usual around, for a thermometer may be restless for a while."""
    import pandas as pd

    if len(values) < 4:
        return np.zeros(0, dtype=int)
    before, after = values[:-2], values[2:]
    away = np.abs(values[1:-1] - 0.5 * (before + after))
    away[1:] = np.fmin(away[1:], np.abs(values[2:-1] - 2.0 * values[1:-2] + values[:-3]))
    away[:-1] = np.fmin(away[:-1], np.abs(values[1:-2] - 2.0 * values[2:-1] + values[3:]))
    usual = pd.Series(away).rolling(15, center=True, min_periods=1).median().to_numpy()
    moved = np.abs(np.diff(values))
    # where rows are far apart a spring comes a part of its way and goes again
    goes = 0.5 * (time_s[2:] - time_s[:-2]) / QUICKEST_S * np.fmax(moved[1:], moved[:-1])
    bad = np.flatnonzero(away > 10.0 * np.fmax(usual, noise) + 2.0 * np.abs(after - before) + goes) + 1
    # where a log ends or has a hole a spike also lifts its neighbours' distance: keep the largest of three in a row
    peak = np.zeros(len(values))
    peak[1:-1] = np.nan_to_num(away)
    return bad[(peak[bad] >= peak[bad - 1]) & (peak[bad] >= peak[np.minimum(bad + 1, len(values) - 1)])]


def mend_first_reading(run: Run) -> None:
    """A first reading that the next ones know nothing of: where it is not, a spring could not have come from it in one row.

    The thermometer then begins at its next one: a simulation starts there.
    """
    noise = np.maximum(noise_floor(run.temperature_c), rounding(run.temperature_c))
    for k in range(run.springs):
        values = run.temperature_c[:4, k]
        if len(values) < 4 or not np.isfinite([*values, noise[k]]).all():
            continue
        jump = float(values[1] - values[0])
        moves = np.abs(np.diff(run.temperature_c[1:, k]))
        # what begins to move goes on moving; what is heated from the first row on answers as quickly as it ever does, too
        heated = run.drive[0, k] > 0 and jump > 0
        usual = float(np.nanquantile(moves, 0.99)) if heated else 0.0
        most = QUICKER * max(usual, float(moves[:2].max()))
        if abs(jump) > 10.0 * max(float(noise[k]), 0.02) + most:
            run.notes.append(f"t{k + 1}_c: the first reading, {values[0]:g} degC, is a spike, left out")
            run.temperature_c[0, k] = values[1]


def mend_ambient(run: Run) -> None:
    """A few rows of an ambient far from those around them: the air of a room does not jump and come back."""
    if run.ambient_c is None or len(run.ambient_c) < 9:
        return
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(run.ambient_c, 4, mode="reflect"), 9)
    around = np.median(windows, axis=1)
    bad = np.abs(run.ambient_c - around) > JUMP_K
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        said = f"ambient_c: {bad.sum()} isolated spike(s) left out, the first, {run.ambient_c[first]:g} degC, at {run.time_s[first]:g} s"
        run.notes.append(said)
        run.ambient_c = np.where(bad, around, run.ambient_c)


def begins_warm(run: Run) -> bool:
    """Driven from the first row on, the same for half a minute, and no spring moves by more than half a degree."""
    first = run.time_s - run.time_s[0] <= BEGINS_S
    if first.sum() < FEWEST or not np.any(run.drive[0] > 0) or np.ptp(run.drive[first], axis=0).max() > 0:
        return False
    seen = run.temperature_c[first]
    seen = seen[:, np.isfinite(seen).all(axis=0)]
    if not seen.shape[1]:
        return False
    return bool(np.abs(moved_k(seen)).max() < STEADY_K)


def longest_step(time_s: np.ndarray) -> float:
    """Return how far two of these times may lie apart, s: what is longer is a gap, and nothing is known of what was in it."""
    return max(10.0, 5.0 * float(np.median(np.diff(time_s))))


def find_gaps(run: Run) -> None:
    """Find gaps in time: after each the simulation starts again from what is measured."""
    step = np.diff(run.time_s)
    usual, limit = float(np.median(step)), longest_step(run.time_s)
    gaps = np.flatnonzero(step > limit)
    run.starts += [int(row) + 1 for row in gaps]
    run.hotter = hotter_before(run)  # while the first readings after a gap are there
    for begin in run.starts[1:]:
        forgotten = np.searchsorted(run.time_s, run.time_s[begin] + RUN_IN_S)
        run.temperature_c[begin + 1 : forgotten] = np.nan
    if gaps.size:
        longest = float(step[gaps].max())
        run.notes.append(
            f"{gaps.size} gap(s) in time, the longest {longest:.0f} s: the simulation starts again from the measured "
            f"temperatures after each, and what is measured in the first {RUN_IN_S:.0f} s does not count"
        )
    long = step[(step > 1.5 * usual) & (step <= limit)]
    if long.size:
        run.notes.append(
            f"{long.size} of {step.size} steps from row to row are longer than usual, up to {long.max():.3g} s: an input that changed "
            "meanwhile is taken for the old one until the next row"
        )
