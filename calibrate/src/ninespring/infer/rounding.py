"""What a board's voltages are off by: they step, and where nothing changes the error stays what it is."""

from __future__ import annotations

import math

import numpy as np

from ..io.logs.run import Run

DRIVEN_A = 0.2
"""Currents from which v / i is a measurement of resistance, not of the sensor's offset."""
STEP_V = 4e-3
"""Of the board's sensors."""
ROUNDING_V = STEP_V / math.sqrt(12.0)
"""What rounding leaves in a voltage of the board, rms: where the current is steady so is the error."""
MOST = 300
"""So many errors of a run are followed, the largest: each is a simulation."""


def steady(run: Run) -> np.ndarray:
    """Return where v / i of a run is a resistance, (rows, springs): driven, by a current that does not change in the row.

    A row's current is a mean and its voltage is weighted by it. Half a row at another current, off by some share of the
    mean, makes their ratio wrong by the square of half that share at most: less than rounding does, or the row is left out.
    """
    assert run.current_a is not None and run.voltage_v is not None
    change = np.abs(np.diff(run.current_a, axis=0, prepend=run.current_a[:1], append=run.current_a[-1:]))
    change = np.maximum(change[1:], change[:-1])
    driven = run.current_a > DRIVEN_A
    share = change / np.where(driven, 2.0 * run.current_a, 1.0)
    return driven & (run.voltage_v * share**2 < ROUNDING_V)


def power_errors(run: Run) -> list[np.ndarray]:
    """Return what rounding of the board's voltages makes of the power, one sigma of it each time that a current stays the
    same: (rows, springs), W. None where the power is not of a board's sensors."""
    if not run.of_board or run.current_a is None or run.voltage_v is None:
        return []
    out = []
    here = steady(run)
    for k in range(run.springs):
        bounds = np.flatnonzero(np.diff(here[:, k], prepend=False, append=False))
        for begin, end in zip(bounds[::2], bounds[1::2], strict=True):
            one = np.zeros(run.drive.shape)
            one[begin:end, k] = ROUNDING_V * run.current_a[begin:end, k]
            out.append(one)
    return sorted(out, key=lambda one: -float(one.sum()))[:MOST]
