"""A thermometer that comes loose, or jumps, for a while: what it reads then is left out, as a spike is.

Its readings are no part of what a model is for: with them in the error every number bends to them, and any name that bends as well is
given. A window of one run in which one thermometer shows a part of its spring's rise, or some kelvin beside it, competes with heat, losses and
drives that change for a while and with noise that lasts, all by the one likelihood (infer/likelihood.py). What tells them apart is
the step itself, from one reading to the next, which no heat makes: so its rows are found, not only those of a grid. A window that begins
or ends some readings beside the step has two of them where the readings have one, and is less likely than none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..infer.fit import Fit
from ..infer.likelihood import Rows, fitted
from ..infer.problem import Problem
from ..io import results
from ..io.logs.run import Run
from .causes import SHORTEST, Cause, column_of, library, of_thermometers, risen, typical_power
from .evidence import likelihood
from .lasting import likeliest
from .pursuit import Pursuit
from .unnamed import LEAST_NATS, SHARE, Hidden, beside, laid_bare, told

MOST = 4
"""Windows that are left out, one after the other, at most: where more would help, the model is wrong, not the thermometers."""
AROUND = 3
"""Times that a window is looked for, beside numbers that it spoilt less each time."""
AT_STEP = 30
"""Rows before and after an end of a window by which its step is judged."""
LATE_S = (0.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""By which a thermometer may be late: it then comes loose as late."""
FADES = 4.0
"""Times that long until nothing of it is left."""
LEFT_OUT = "what it reads there is left out of the fit and of all errors"
TRUE = 0.5
"""Part of what readings that were left out are off by, beside a model that never saw them, that must be what they were left out for."""


@dataclass(frozen=True)
class Loose:
    """What one thermometer shows for a while of one run, and when none of its readings count: seconds by the log's clock."""

    run: int
    spring: int
    kind: str
    rows: tuple[int, int]
    profile: np.ndarray
    """(rows, springs): what a unit of it adds to the readings, K."""
    since_s: tuple[float, float]
    """From the run's first row."""
    out_s: tuple[float, float]
    size: float = math.nan
    error: float = math.nan

    def without(self, run: Run) -> Run:
        """Return a log with its readings left out."""
        gone = (run.time_s >= self.out_s[0]) & (run.time_s < self.out_s[1])
        shown = run.temperature_c.copy()
        shown[gone, self.spring] = np.nan
        return replace(run, temperature_c=shown)

    def told(self) -> results.Unnamed:
        """Return what diagnosis.json says of it."""
        when = f"{self.since_s[0]:.0f} to {self.since_s[1]:.0f} s of run {self.run + 1}"
        what = "shows more of its spring's rise" if self.kind == "share" else "jumps"
        return told(self.kind, f"thermometer {self.spring + 1} {what}, {when}", self.size, self.error, f"; {LEFT_OUT}")


def without(run: Run, number: int, left_out: Sequence[Loose]) -> Run:
    """Return a log, the run of this number from 0, with what loose thermometers read left out."""
    for one in left_out:
        run = one.without(run) if one.run == number else run
    return run


def find(problem: Problem, final: Fit) -> Loose | None:
    """Return the thermometer that is loose for a while by what a fit leaves, None where that is not the likeliest of all there is."""
    found = _window(problem, final)
    problem.leave_out(None)
    if found is None:
        return None
    window, fit, rival = found
    at_step = _at_its_step(problem, fit, window)
    chosen_from = math.log(problem.count * len(LATE_S))
    if _nats_of_steps(problem, fit, at_step) - chosen_from < LEAST_NATS:
        return None  # heat that wanders bends there, and makes none
    again = beside(problem, fit, _column(problem, at_step))
    off, left = (max(0.0, one.sse - one.count) for one in (final, again))
    if off - left < SHARE * off:
        return None
    nats = _nats(problem, again, _column(problem, at_step))
    whole = column_of(problem, fit, window.cause, 1.0)
    without = max(_nats(problem, final, None), _nats(problem, beside(problem, fit, whole), whole))
    if nats - chosen_from - without < LEAST_NATS:
        return None
    # chosen from about as many
    if rival is not None and nats <= _nats(problem, beside(problem, final, rival), rival):
        return None
    return at_step


def _nats(problem: Problem, fit: Fit, column: np.ndarray | None) -> float:
    """Return how likely a fit beside a column is where it is likeliest, with what lasts taken for noise; nothing is taken out then."""
    problem.leave_out(column)
    out = likelihood(problem, likeliest(problem, fit))
    problem.leave_out(None)
    return out


def _window(problem: Problem, final: Fit) -> tuple[Hidden, Fit, np.ndarray | None] | None:
    """Return the window of one thermometer that explains most, the fit beside it, and what the best of all other causes adds to the
    readings, (count, 1); None where heat would explain as much, or it is too little to be told."""
    fit, found, rival = final, None, None
    for turn in range(AROUND):
        bare = fit
        if turn or fit.jacobian is None:  # what it leaves as nothing is taken out
            bare = problem.with_slopes(replace(problem.evaluate(fit), jacobian=None))
        basis, left = laid_bare(problem, bare)
        beyond = max(1e-12, float(left @ left) - len(left))
        # not all of a run, which may be another run's offset, nor a part more of the rise: how much, only numbers that it has not spoilt tell
        one = Pursuit(of_thermometers(problem, bare), basis, SHORTEST, {"share": -1}).best(left, rests=SHORTEST)
        if one is None or one.drop < SHARE * beyond:
            return None
        if turn == 0:
            other = Pursuit(_others(problem, bare), basis, SHORTEST).best(left)
            if one.drop <= other.drop:
                return None
            rival = column_of(problem, bare, other.cause, typical_power(problem, bare), *other.rows)
        if found is not None and (found.cause.text, found.rows) == (one.cause.text, one.rows):
            break
        found = Hidden(one.cause, one.cause.text, one.rows, column_of(problem, bare, one.cause, 1.0, *one.rows))
        fit = beside(problem, bare, found.column)
    return None if found is None else (found, fit, rival)


def _others(problem: Problem, fit: Fit) -> list[Cause]:
    """Return all causes without a name but single thermometers' and what comes and goes."""
    alone = ("sensor", "share")
    return [one for one in library(problem, fit) if not one.bumps and not (one.kind in alone and one.place >= 0)]


def _at_its_step(problem: Problem, fit: Fit, window: Hidden) -> Loose:
    """Return a window with its ends where the readings step, and as late as they do."""
    cause = window.cause
    r, k = cause.run, cause.place
    run, shape = problem.runs[r], cause.profiles[r]
    assert shape is not None
    rows, grid = len(run.time_s), cause.edges[1] - cause.edges[0]
    left = np.nan_to_num(problem.without_errors(problem.evaluate(fit).residual)[r][:, k])
    unit = np.where(problem.mask[r][:, k], shape[:, k], 0.0)
    best: tuple[float, tuple[int, int], np.ndarray] | None = None
    for late_s in LATE_S:
        begin, end = window.rows[0], rows if window.rows[1] is None else min(window.rows[1], rows)
        for _ in range(AROUND):
            size = _size(left, unit * _there(run, begin, end, late_s))
            starts = _near(begin, grid, 1, end - 1) if begin else [0]
            begin = min(starts, key=lambda row: _off(left, unit * _there(run, row, end, late_s), size))
            ends = _near(end, grid, begin + 1, rows) if end < rows else [rows]
            end = min(ends, key=lambda row: _off(left, unit * _there(run, begin, row, late_s), size))
        field = unit * _there(run, begin, end, late_s)
        off = _off(left, field, _size(left, field))
        if best is None or off < best[0]:
            fade = max(FADES * late_s, float(run.time_s[grid] - run.time_s[0]))
            best = off, (begin, end), field
            late = fade
    assert best is not None
    (begin, end), profile = best[1], np.zeros((rows, run.springs))
    profile[:, k] = best[2]
    first, last = float(run.time_s[0]), float(run.time_s[end]) if end < rows else math.inf
    step_s = float(run.time_s[grid] - run.time_s[0])
    came = float(run.time_s[begin])
    since = came - first, min(last, float(run.time_s[-1])) - first
    return Loose(r, k, cause.kind, (begin, end), profile, since, (came - step_s if begin else -math.inf, last + late))


def _nats_of_steps(problem: Problem, fit: Fit, one: Loose) -> float:
    """Return the nats by which a window's ends show it by themselves: beside what stays or goes on evenly in the rows around each, and
    lasts. What bends there is heat's, however little it is beside the noise."""
    run, mask, k = problem.runs[one.run], problem.mask[one.run], one.spring
    left = problem.without_errors(problem.evaluate(fit).residual)[one.run][:, k] / problem.noise[one.run][k]
    nats = 0.0
    for row in one.rows:
        rows = slice(max(0, row - AT_STEP), row + AT_STEP)
        there = mask[rows, k]
        if not 0 < row < len(left) or there.sum() < AT_STEP:
            continue
        since_s = (run.time_s[rows] - run.time_s[row])[there]
        columns = np.column_stack([np.ones(len(since_s)), since_s, one.profile[rows, k][there]])
        around = Rows.of(run.time_s[rows], [0], mask[rows, k : k + 1])
        even, step = (
            fitted(
                [around],
                [left[rows][there] - part @ np.linalg.lstsq(part, left[rows][there], rcond=None)[0]],
                problem.least,
            )[1]
            for part in (columns[:, :2], columns)
        )
        nats += step - even
    return nats


def _near(row: int, grid: int, least: int, most: int) -> range:
    return range(max(least, row - grid), max(least, min(most, row + grid)) + 1)


def _there(run: Run, begin: int, end: int, late_s: float) -> np.ndarray:
    """Return what part of a window is there in each row, (rows,), for a thermometer that is so late."""
    time_s = run.time_s
    out = np.zeros(len(time_s))
    out[begin:end] = 1.0
    if late_s > 0.0:
        if begin:
            out[begin:end] -= np.exp(-(time_s[begin:end] - time_s[begin]) / late_s)
        if end < len(time_s):
            out[end:] = out[end - 1] * np.exp(-(time_s[end:] - time_s[end]) / late_s)
    return out


def _size(left: np.ndarray, field: np.ndarray) -> float:
    return float(field @ left) / max(1e-12, float(field @ field))


def _off(left: np.ndarray, field: np.ndarray, size: float) -> float:
    return float(((left - size * field) ** 2).sum())


def _column(problem: Problem, one: Loose) -> np.ndarray:
    """Return what a unit of it adds to the readings of all, (count, 1)."""
    fields = [np.zeros_like(run.temperature_c) for run in problem.runs]
    fields[one.run] = one.profile
    return np.concatenate(problem.scaled(fields))[:, None]


def seen_by(problem: Problem, whole: Sequence[Run], fit: Fit, one: Loose) -> Loose | None:
    """Return it as large as a model has it that never saw its readings; None where that does not find them off by most of what they are.

    `whole` are the logs as they were read, in the problem's rows.
    """
    r, k, (begin, end) = one.run, one.spring, one.rows
    rise = risen(problem, fit, r)[:, k] if one.kind == "share" else np.ones(len(problem.runs[r].time_s))
    shown = problem.predictions(fit.spec, fit.values)[r][:, k]
    off = (whole[r].temperature_c[:, k] - shown)[begin:end]
    unit = rise[begin:end]
    there = np.isfinite(off)
    off, unit = off[there], unit[there]
    size = _size(off, unit)
    noise = float(problem.noise[r][k]) ** 2 * len(off)
    squares, left = float(off @ off), _off(off, unit, size)
    possible = -1.0 <= size < 0.0 or one.kind != "share"
    if not possible or max(0.0, squares - noise) * (1.0 - TRUE) < max(0.0, left - noise):
        return None
    alike = problem.alike(
        [np.where(np.isfinite(x), x, 0.0) for x in [((off - size * unit) / problem.noise[r][k])[:, None]]]
    )
    error = math.sqrt(alike * max(left, noise) / max(1, len(off)) / max(1e-12, float(unit @ unit)))
    return replace(one, size=size, error=error)
