"""A long log made short enough to be fitted: averaged, no row of it left out."""

from __future__ import annotations

import bisect
import itertools
from dataclasses import replace

import numpy as np

from .run import Run

FINEST_S = 1.0
"""Rows closer than this are averaged where a log is too long to be simulated row by row."""
LONGEST_S = 60.0
"""Of a row, however long nothing has happened."""
HAPPENS = 0.05
"""Change of a drive, in parts of its largest, or of the fan, that makes a row begin."""
SHARES = np.geomspace(0.01, 1.0, 25)
"""Of the time since something happened, how long a row may be: the first that makes the log short enough."""


def condense(run: Run, max_rows: int = 4000) -> Run:
    """Return the run with at most about `max_rows` rows, and say how.

    First rows are averaged to FINEST_S. What is then still too long is averaged the more the longer nothing has happened, to
    LONGEST_S at most; where something happens all the time, evenly.
    """
    n = len(run.time_s)
    usual = float(np.median(np.diff(run.time_s)))
    even = min(-(-n // max_rows), int(FINEST_S / usual + 1e-9))
    if even > 1:
        run = _averaged(run, _evenly(run, even), f"{n} rows averaged {even} by {even} for the fit")
    if len(run.time_s) <= max_rows:
        return run
    rows = _where_nothing_happens(run, max_rows)
    said = f"{n} rows averaged to {len(rows)} for the fit, the more the longer nothing was switched"
    return _averaged(run, rows, said)


def _evenly(run: Run, each: int) -> np.ndarray:
    """Return the rows at which a new one begins, so many by so many from each start."""
    return np.concatenate([np.arange(a, b, each) for a, b in itertools.pairwise([*run.starts, len(run.time_s)])])


def _happens(run: Run) -> np.ndarray:
    """Return the rows at which a drive or the fan changes by what counts."""
    given = np.column_stack([run.drive, run.fan])
    most = np.maximum(np.abs(given).max(axis=0), 1e-12)
    most[-1] = 1.0
    return np.flatnonzero((np.abs(np.diff(given, axis=0)) > HAPPENS * most).any(axis=1)) + 1


def _where_nothing_happens(run: Run, max_rows: int) -> np.ndarray:
    """Return the rows at which a new one begins: soon where something has just happened, later where nothing has."""
    events = np.union1d(_happens(run), run.starts)
    if 2 * len(events) > max_rows:
        return _evenly(run, -(-len(run.time_s) // max_rows))
    base = 1
    while True:
        # the larger the share, the shorter the log
        first = bisect.bisect_left(SHARES, -max_rows, key=lambda share: -len(_begins(run, events, base, share)))
        if first < len(SHARES):
            return _begins(run, events, base, float(SHARES[first]))
        base *= 2


def _begins(run: Run, events: np.ndarray, base: int, share: float) -> np.ndarray:
    """Return where rows begin that are `base` long at an event and grow by a share of the time since."""
    out = []
    time_s = run.time_s.tolist()
    for begin, end in itertools.pairwise([*events.tolist(), len(time_s)]):
        at = begin
        while at < end:
            out.append(at)
            long = min(LONGEST_S, share * (time_s[at] - time_s[begin]))
            at = max(at + base, bisect.bisect_left(time_s, time_s[at] + long))
    return np.array(out)


def _averaged(run: Run, rows: np.ndarray, said: str) -> Run:
    """Return the run with a row beginning at each of these.

    A row's drive and fan are the means over the time until the next one; its temperature is the mean of an odd number of
    readings around its time, none of them used twice: nothing is shifted, and the noise stays white. Where something is
    switched it is the one reading: a mean across a kink is beside it.
    """
    n = len(run.time_s)
    usual = float(np.median(np.diff(run.time_s)))
    weight = np.diff(run.time_s, append=run.time_s[-1] + usual)
    for begin in run.starts[1:]:
        weight[begin - 1] = usual  # what was given in a gap nobody knows
    span = np.add.reduceat(weight, rows)

    def mean(values: np.ndarray) -> np.ndarray:
        shape = (-1,) + (1,) * (values.ndim - 1)
        return np.add.reduceat(weight.reshape(shape) * values, rows, axis=0) / span.reshape(shape)

    current = voltage = None
    if run.current_a is not None and run.voltage_v is not None:
        # the voltage weighted by the current, as the board averages it: their product stays the mean power
        current, power = mean(run.current_a), mean(run.current_a * run.voltage_v)
        voltage = np.where(current > 0, power / np.where(current > 0, current, 1.0), 0.0)
    starts = np.searchsorted(rows, run.starts)
    after = np.append(np.diff(rows), n - rows[-1])
    before = np.append(1, np.diff(rows))
    before[starts] = 1
    side = np.where(np.isin(rows, _happens(run)), 0, (np.minimum(before, after) - 1) // 2)
    return replace(
        run,
        time_s=run.time_s[rows],
        drive=np.ascontiguousarray(mean(run.drive)),
        temperature_c=_around(run.temperature_c, rows, side),
        fan=mean(run.fan),
        load_n=None if run.load_n is None else run.load_n[rows],
        ambient_c=None if run.ambient_c is None else run.ambient_c[rows],
        current_a=current,
        voltage_v=voltage,
        starts=[int(one) for one in starts],
        notes=[*run.notes, said],
    )


def _around(readings: np.ndarray, rows: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return the mean of what is there of the readings up to `side` rows before and after each of `rows`."""
    good = np.isfinite(readings)
    sums = np.vstack([np.zeros((1, readings.shape[1])), np.cumsum(np.where(good, readings, 0.0), axis=0)])
    counts = np.vstack([np.zeros((1, readings.shape[1])), np.cumsum(good, axis=0)])
    first, last = rows - side, rows + side + 1
    count = counts[last] - counts[first]
    out = (sums[last] - sums[first]) / np.maximum(count, 1.0)
    # a mean of fewer than half has another middle
    return np.where(2.0 * count > (last - first)[:, None], out, np.nan)
