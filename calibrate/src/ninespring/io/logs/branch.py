"""On which branch of the hysteresis springs begin: which were hotter before the first row than anybody saw.

A spring between its transformation points is martensite or austenite by where it comes from. One whose readings rise, or stay, was led
there from the cold. One whose readings fall comes down from somewhere: from austenite, if nothing drives it. Driven, it may also have been
driven harder and be on its way back from half way up; then v / i tells, where it is logged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .run import Run

BEGINS_S = 30.0
"""By what a log shows so long, it begins steady, or with springs that fall or rise."""
FEWEST = 5
"""Rows that tell so."""
STEADY_K = 0.5
"""What moves less is steady."""
SAME = 0.05
"""Part of a spring's drive at most by which it is driven as before: its resistance changes, and what is logged is rounded."""
CROSSED = 0.03
"""Part of its cold resistance by which a spring's v / i must have changed to have passed its transformation."""


def hotter_before(run: Run) -> np.ndarray:
    """Return which springs come down from austenite at each of a run's starts, (starts, springs): as far as their readings say."""
    out = np.zeros((len(run.starts), run.springs), dtype=bool)
    between = _between_phases_ohm(run)
    same = SAME * np.abs(run.drive).max(axis=0)
    for begin, end, found in zip(run.starts, [*run.starts[1:], len(run.time_s)], out, strict=True):
        first = int(np.searchsorted(run.time_s, run.time_s[begin] + BEGINS_S, side="right"))
        rows = slice(begin, min(max(first, begin + FEWEST), end))
        for k in np.flatnonzero(_fall(run, rows, same)):
            found[k] = not run.drive[begin, k] > 0.0 or _reads_austenite(run, int(k), rows, between[k])
    return out


def moved_k(seen: np.ndarray) -> float | np.ndarray:
    """Return how far readings, (rows,) or (rows, springs), go from the first third of them to the last, K."""
    third = max(1, len(seen) // 3)
    return seen[-third:].mean(axis=0) - seen[:third].mean(axis=0)


def _fall(run: Run, rows: slice, same: np.ndarray) -> np.ndarray:
    """Return which springs' readings fall in these rows, as long as they are driven as in the first of them, (springs,)."""
    drive, out = run.drive[rows], np.zeros(run.springs, dtype=bool)
    other = np.abs(drive - drive[0]) > same
    for k in range(run.springs):
        # a row from which on it is driven otherwise shows what was before
        seen = run.temperature_c[rows, k][: int(np.argmax(other[:, k])) + 1 if other[:, k].any() else None]
        seen = seen[np.isfinite(seen)]
        out[k] = len(seen) >= FEWEST and moved_k(seen) < -STEADY_K
    return out


def _between_phases_ohm(run: Run) -> np.ndarray:
    """Return the v / i half way between the lowest and the highest that each spring shows, (springs,), NaN where it shows one phase.

    Of the log itself: what is declared of a wire may be off by as much as its phases are apart, and leads come on top.
    """
    out = np.full(run.springs, np.nan)
    if run.current_a is None or run.voltage_v is None:
        return out
    # where little flows, the steps of a voltage are most of what is read
    strong = run.current_a > 0.5 * run.current_a.max(axis=0)
    for k in np.flatnonzero(strong.any(axis=0)):
        ohm = run.voltage_v[strong[:, k], k] / run.current_a[strong[:, k], k]
        low, high = np.percentile(ohm, [5.0, 95.0])
        out[k] = 0.5 * (low + high) if high - low > CROSSED * low else np.nan
    return out


def _reads_austenite(run: Run, k: int, rows: slice, between_ohm: float) -> bool:
    """Return whether a driven spring's v / i is that of austenite as a log begins; also where nothing shows it."""
    if run.current_a is None or run.voltage_v is None or np.isnan(between_ohm):
        return True
    current, voltage = run.current_a[rows, k][:FEWEST], run.voltage_v[rows, k][:FEWEST]
    return bool(voltage.sum() > between_ohm * current.sum())
