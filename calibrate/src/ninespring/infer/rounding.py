"""What logged voltages are off by: they step, and where nothing changes the error stays what it is."""

from __future__ import annotations

import math

import numpy as np

from ..io.logs.log import BOARD_STEP_V
from ..io.logs.run import Run

DRIVEN_A = 0.2
"""Currents from which v / i is a measurement of resistance, not of the sensor's offset."""
ROUNDING_V = BOARD_STEP_V / math.sqrt(12.0)
"""What rounding leaves in a voltage of the board, rms: where the current is steady so is the error."""
MOST = 300
"""So many errors of a run are followed, the largest: each is a simulation."""
SHOWS = 0.1
"""Of the noise: an error of the power that moves no reading by more is not followed."""


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


def power_errors(run: Run, heat_capacity_j_per_k: float, loss_w_per_k: float, noise_c: np.ndarray) -> list[np.ndarray]:
    """Return what rounding of the voltages makes of the power, one sigma of it each time that a current stays the same: (rows, springs),
    W; of those that could show beside the thermometers' noise (springs,) in springs that hold and lose so much."""
    if run.step_v == 0.0 or run.current_a is None or run.voltage_v is None:
        return []
    out = []
    here = steady(run)
    for k in range(run.springs):
        bounds = np.flatnonzero(np.diff(here[:, k], prepend=False, append=False))
        for begin, end in zip(bounds[::2], bounds[1::2], strict=True):
            one = np.zeros(run.drive.shape)
            one[begin:end, k] = run.step_v / math.sqrt(12.0) * run.current_a[begin:end, k]
            lasts_s = run.time_s[min(end, len(run.time_s) - 1)] - run.time_s[begin]
            moves_k = one[:, k].max() * min(lasts_s / heat_capacity_j_per_k, 1.0 / loss_w_per_k)
            if moves_k > SHOWS * noise_c[k]:
                out.append(one)
    return sorted(out, key=lambda one: -float(one.sum()))[:MOST]
