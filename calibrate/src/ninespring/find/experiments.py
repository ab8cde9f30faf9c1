"""The experiment that would tell two fitted models apart: both are simulated under standard inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import results
from ..io.logs.run import Run
from ..model import native
from ..model.simulate import simulate_run

TOO_HOT_C = 130.0
"""What is told only where a spring has been beyond this counts for nothing."""
SEEN_S = 20.0
"""Over so long a difference is looked at."""


@dataclass(frozen=True)
class Inputs:
    """A standard experiment: what is set, and that in words."""

    name: str
    words: str
    time_s: np.ndarray
    share: np.ndarray
    """Of the full drive, (rows, springs)."""
    fan: np.ndarray


def _inputs(rows: int, cols: int, fan_seen: bool) -> list[Inputs]:
    """Return the standard experiments of an array."""
    row, column = np.divmod(np.arange(rows * cols), cols)
    every, board, left = np.ones(rows * cols), ((row + column) % 2 == 0) * 1.0, (column == 0) * 1.0
    out: list[Inputs] = []

    def add(
        name: str,
        words: str,
        minutes: float,
        which: np.ndarray,
        level: Callable[[np.ndarray], np.ndarray],
        fan: Callable[[np.ndarray], np.ndarray] = np.zeros_like,
        step_s: float = 2.0,
    ) -> None:
        time_s = np.arange(0.0, 60.0 * minutes + step_s, step_s)
        out.append(Inputs(name, words, time_s, np.outer(level(time_s), which), fan(time_s)))

    for k in sorted({0, (rows // 2) * cols + cols // 2, rows * cols - 1, cols // 2}):
        words = f"spring {k + 1} on at 100 % for 5 min, then off for 5 min, all others off, fan off"
        add("single-spring step", words, 10, (np.arange(rows * cols) == k) * 1.0, lambda t: (t < 300) * 1.0)
    if rows * cols > 1:
        words = "springs " + ", ".join(str(k + 1) for k in np.flatnonzero(board)) + " on for 7 min, the others off"
        add("checkerboard", words, 10, board, lambda t: (t < 420) * 1.0)
    add("cool-down", "all springs on for 4 min, then all off for 11 min", 15, every, lambda t: (t < 240) * 1.0)
    add("weak hold", "all springs on at 35 % for 15 min", 15, every, lambda t: np.full_like(t, 0.35))
    add("long hold", "all springs on at 50 % for 60 min", 60, every, lambda t: np.full_like(t, 0.5), step_s=10.0)
    words = "all springs on at 20, 40, 60, 80, 100 % for 4 min each"
    add("staircase", words, 20, every, lambda t: np.minimum(1.0, 0.2 * (1 + t // 240)))
    add("idle", "nothing on for 30 min", 30, every, np.zeros_like, step_s=10.0)
    if fan_seen:
        words = "all springs on at 60 % for 16 min, fan on from 4 to 8 and from 12 to 16 min"
        add("fan toggled", words, 16, every, lambda t: np.full_like(t, 0.6), lambda t: ((t // 240) % 2 == 1) * 1.0)
        words = "first column on for 10 min, fan on from the start"
        add("fan across one column", words, 10, left, np.ones_like, np.ones_like)
    return out


def _steps(time_s: np.ndarray, share: np.ndarray, fan: np.ndarray) -> list[results.Step]:
    """Return the changes of an experiment: share of the current (rows, n), fan (rows,), 0..1."""
    table = np.rint(100.0 * np.column_stack([share, fan])).astype(int)
    changes = np.flatnonzero(np.r_[True, (np.diff(table, axis=0) != 0).any(axis=1)])
    return [results.Step(at_s=float(time_s[k]), percent=table[k, :-1].tolist(), fan=int(table[k, -1])) for k in changes]


def _apart(problem: Problem, fits: tuple[Fit, Fit], inputs: Inputs, drive: np.ndarray, ambient_c: float) -> np.ndarray:
    """Return by how much two fits differ under inputs, (rows, springs), K, until a spring is too hot by either."""
    nothing, around = np.full(drive.shape, np.nan), np.full(len(drive), ambient_c)
    trial = Run("experiment", "", inputs.time_s, problem.runs[0].mode, drive, nothing, inputs.fan, around)
    a, b = (simulate_run(problem.plant_for(fit.spec, fit.values), trial, around) for fit in fits)
    hottest = np.maximum.accumulate(np.maximum(a, b).max(axis=1))
    return np.where(hottest[:, None] > TOO_HOT_C, 0.0, a - b)


def separate(problem: Problem, a: Fit, b: Fit) -> tuple[results.Experiment, str]:
    """Return the standard experiment in which two fitted models differ most (best per its length), and that in words."""
    run, noise = problem.runs[0], problem.noise_c
    flowed = [r.current_a[r.current_a > 0] for r in problem.runs if r.current_a is not None]
    current_a = max((float(np.percentile(one, 95)) for one in flowed if one.size), default=None)
    top = max(float(np.percentile(r.drive[r.drive > 0], 95)) if (r.drive > 0).any() else 0.5 for r in problem.runs)
    unit = {"power": "W", "current": "A", "command": "of the command"}[run.mode]
    ambient_c = 20.0 if run.ambient_c is None else float(run.ambient_c[0])
    found: list[tuple[float, results.Experiment]] = []
    for one in _inputs(problem.array.rows, problem.array.cols, any((r.fan > 0.1).any() for r in problem.runs)):
        root = np.sqrt(one.share)
        try:
            drive = np.ascontiguousarray(top * (root if run.mode == "current" else one.share))
            apart = _apart(problem, (a, b), one, drive, ambient_c)
        except native.NativeError:
            continue
        smooth = np.abs(uniform_filter1d(apart, max(1, round(SEEN_S / one.time_s[1])), axis=0))
        at, k = np.unravel_index(int(smooth.argmax()), smooth.shape)
        told = results.Experiment(
            name=one.name,
            inputs=f"{one.words} (100 % is {top:.2g} {unit})",
            spring=int(k) + 1,
            difference_c=float(smooth[at, k]),
            at_s=float(one.time_s[at]),
            duration_s=float(one.time_s[-1]),
            current_a=current_a,
            steps=_steps(one.time_s, one.share if run.mode == "command" else root, one.fan),
        )
        found.append((told.difference_c / (1.0 + told.duration_s / 3600.0), told))
    best = max(found, key=lambda one: one[0])[1]
    samples = max(1.0, (3.0 * noise / max(best.difference_c, 1e-9)) ** 2)
    if best.difference_c >= 2.0 * noise:
        advice = f"{best.difference_c / noise:.0f} times the noise"
    elif samples <= 600:
        advice = f"below the noise of one reading: average {samples:.0f} readings"
    else:
        advice = "too little to see with this sensor: a quieter one or a measured power (log v) is needed"
    return best, (
        f"{best.name}: {best.inputs}; watch spring {best.spring} at {best.at_s:.0f} s: "
        f"the two differ by {best.difference_c:.2f} degC ({advice}); {best.duration_s / 60:.0f} min"
    )
