"""Mistakes in the making of a log that no physics could explain: swapped columns, shifted clocks, missing currents.

Whole logs are judged here, against what any array must obey; single cells and columns are `logs`' affair. Nothing is
changed: what is found is said, in words for `warnings`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import statistics
from ..io.logs.run import Run
from .evidence import UNEXPLAINED

STRETCH_S = 10.0
"""In which a drive shows beside the noise."""
OWN_DRIVE_SHARE = 0.5
"""Standardised coefficient (1 about: the drive alone moves the spring) from which a drive is a spring's own."""
ON_A_STEP = 0.01
"""Of a step, how far from a whole number of them a reading may be: what the digits of a log leave."""
FINE_K = 0.15
"""Steps of a thermometer that matter to nobody: what the chip's arithmetic may be off by."""
SHORT = 0.05
"""Part of the rows that are no longer than the step by which a clock is tried: long logs are averaged, some rows to a minute."""
HOTTER_C = 5.0
"""By how much, degC, a spring that is never driven must outdo all others before its current is called missing."""


def own_drive(runs: Sequence[Run]) -> np.ndarray:
    """Return how strongly each drive (row) moves each temperature (column), (springs, springs).

    Standardised coefficients of a regression of the rise from each stretch of 10 s, or longer row, to the next on the mean drives
    between their middles and on the spring's own temperature: what a neighbour does is not taken for the spring's own drive. Zero
    where the data say nothing.
    """
    springs = runs[0].springs
    total, weight = np.zeros((springs, springs)), np.zeros(springs)
    for run in runs:
        heat = run.drive**2 if run.mode == "current" else run.drive
        given = np.cumsum(heat[:-1] * np.diff(run.time_s)[:, None], axis=0)
        given = np.vstack([np.zeros((1, springs)), given])
        begins = np.flatnonzero(np.diff((run.time_s - run.time_s[0]) // STRETCH_S, prepend=-1.0))
        middle = np.add.reduceat(run.time_s, begins) / np.diff(begins, append=len(run.time_s))
        pieces = np.split(run.temperature_c, begins[1:])
        mean = np.array([statistics.mean_there(piece, 0) for piece in pieces])
        lasts_s = np.diff(middle)[:, None]
        power = np.diff(np.column_stack([np.interp(middle, run.time_s, one) for one in given.T]), axis=0) / lasts_s
        rise = np.diff(mean, axis=0) / lasts_s
        for k in range(springs):
            good = np.isfinite(rise[:, k])
            if good.sum() < 3 * springs or np.std(rise[good, k]) < 1e-9:
                continue
            x = np.column_stack([power, mean[:-1, k]])[good]
            x = x - x.mean(axis=0)
            y = rise[good, k] - rise[good, k].mean()
            found = np.linalg.lstsq(x, y, rcond=None)[0] * x.std(axis=0) / y.std()
            total[:, k] += good.sum() * found[:springs]
            weight[k] += good.sum()
    return total / np.maximum(weight, 1.0)


def swapped(runs: Sequence[Run]) -> list[str]:
    """Return warnings where springs' temperatures follow one another's drives: columns swapped."""
    if runs[0].springs < 2:
        return []
    share = own_drive(runs)
    inputs, outputs = linear_sum_assignment(-share)
    wrong = [
        (int(j), int(k))
        for j, k in zip(inputs, outputs, strict=True)
        if j != k and share[j, k] > OWN_DRIVE_SHARE and share[j, k] > 2.0 * max(share[k, k], share[j, j])
    ]
    # a swap is closed: what one spring shows, another one lacks
    if {j for j, _ in wrong} != {k for _, k in wrong}:
        return []
    return [
        f"t{k + 1}_c follows the drive of spring {j + 1}, not its own: columns swapped? Correct the log's header"
        for j, k in wrong
    ]


def undriven_but_hottest(run: Run) -> list[str]:
    """Return warnings where a spring that is never driven is the hottest of all: heat does not flow uphill."""
    if run.springs < 2 or not np.isfinite(run.temperature_c).any():
        return []
    out = []
    for k in np.flatnonzero(np.ptp(run.drive, axis=0) + np.abs(run.drive).max(axis=0) == 0):
        others = np.delete(run.temperature_c, k, axis=1)
        known = np.isfinite(others).all(axis=1)
        above = np.where(known, run.temperature_c[:, k] - np.where(known[:, None], others, 0.0).max(axis=1), np.nan)
        # it may begin hot, and cool: only what it has gained counts
        own = run.temperature_c[:, k]
        began = own[np.isfinite(own)][:1]
        above = np.where(own > began + HOTTER_C, above, np.nan) if began.size else above
        if np.isfinite(above).any() and np.nanmax(above) > HOTTER_C:
            at = int(np.nanargmax(above))
            out.append(
                f"spring {k + 1} is never driven, yet at {run.time_s[at]:g} s it is {np.nanmax(above):.0f} K hotter than "
                "any other: is its current missing from the log?"
            )
    return out


def step_of(values: np.ndarray) -> float:
    """Return the step of readings, all multiples of one; 0 where they have none."""
    gaps = np.diff(np.unique(values[np.isfinite(values)]))
    if gaps.size < 2:
        return 0.0
    many = gaps / gaps.min()
    return float(gaps.min()) if np.abs(many - np.round(many)).max() < ON_A_STEP else 0.0


def coarse(runs: Sequence[Run]) -> list[str]:
    """Return a warning where thermometers step so far that rounding makes structure that matters, hidden in the noise."""
    steps: dict[float, set[int]] = {}
    for run in runs:
        noise = statistics.noise_floor(run.temperature_c, run.starts)
        for k in range(run.springs):
            step = step_of(run.temperature_c[:, k])
            # rounding is off by anything up to half a step
            if step > FINE_K and step / math.sqrt(12.0) > UNEXPLAINED * noise[k]:
                steps.setdefault(round(step, 6), set()).add(k + 1)
    return [
        f"{'t' + '_c, t'.join(map(str, sorted(springs)))}_c step{'s' * (len(springs) == 1)} by {step:g} K: what is finer "
        "than that counts as noise and is not seen; a finer thermometer, or its finer setting, shows it"
        for step, springs in steps.items()
    ]


def _moved(run: Run, seconds: float) -> Run:
    """Return the run with its temperatures moved later by so much (earlier where negative); rows may be uneven."""
    before, columns = run.time_s - seconds, run.temperature_c.T
    moved = [np.interp(before, run.time_s, one, left=one[0], right=np.nan) for one in columns]
    return replace(run, temperature_c=np.column_stack(moved)) if seconds else run


def shifted_clock(problem: Problem, fits: Sequence[Fit]) -> list[str]:
    """Return a warning where temperatures and inputs belong to different times.

    Tried only where structure is left: the temperatures are moved by 1 to 128 steps of the shortest rows, later (an effect before
    its cause: no physics does that) and, with the last
    of the models, earlier; each is fitted again, as it is where they are, and the best is refined to one step.
    """
    step = float(np.quantile(np.diff(problem.runs[0].time_s), SHORT))
    shortest = min(run.duration_s for run in problem.runs)
    tried: dict[tuple[int, int], float] = {}

    def error(which: int, rows: int) -> float:
        if (which, rows) not in tried:
            fit = fits[which]
            if abs(rows) * step > shortest / 4:
                tried[which, rows] = np.inf
            else:
                # the clock as it is, too: a fit whose errors last is not the one that leaves least
                trial = Problem(problem.array, [_moved(run, rows * step) for run in problem.runs], problem.declared)
                again = trial.fit(fit.spec, fit.as_dict(), tolerance=1e-3, max_steps=8)
                tried[which, rows] = statistics.rms(again.residual)
        return tried[which, rows]

    before = min(error(which, 0) for which in range(len(fits)))
    best = (before, 0)
    for which in range(len(fits)):
        for sign in (1, -1) if which == len(fits) - 1 else (1,):
            at, value = 0, error(which, 0)
            # doubling while it helps, then halving around the best
            for rows in (1, 2, 4, 8, 16, 32, 64, 128):
                if error(which, sign * rows) < value:
                    at, value = rows, error(which, sign * rows)
                elif rows > 2:
                    break
            stride = at // 2
            while stride >= 1:
                for near in (at - stride, at + stride):
                    if error(which, sign * near) < value:
                        at, value = near, error(which, sign * near)
                stride //= 2
            if at and value < best[0]:
                best = (value, sign * at)
    if best[0] ** 2 >= 0.5 * before**2:
        return []
    said = f"the error falls from {before:.2f} to {best[0]:.2f} K"
    if best[1] > 0:
        return [
            f"the temperatures come about {best[1] * step:g} s before the inputs that cause them (moved later, {said}): "
            "correct the clock of one of them"
        ]
    return [
        f"the temperatures come about {-best[1] * step:g} s after the inputs that cause them (moved earlier, {said}): "
        "correct the clock of one of them, or say what delays the thermometers"
    ]
