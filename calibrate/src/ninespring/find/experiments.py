"""The experiment that would tell two fitted models apart: both are simulated under standard inputs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import results
from ..io.logs.run import Run
from ..model import native
from ..model.simulate import simulate_run


@dataclass
class Experiment:
    """An experiment, what to watch, and what to expect."""

    name: str
    inputs: str
    spring: int
    """1-based."""
    difference_c: float
    at_s: float
    duration_s: float
    noise_c: float
    text: str
    current_a: float | None = None
    """Of a spring at 100 %; None where the logs have no current."""
    steps: list[results.Step] = field(default_factory=list)
    """What is set when: at_s, percent of the current (one per spring), fan in percent."""

    def told(self) -> results.Experiment:
        """Return what diagnosis.json says of it."""
        return results.Experiment(
            name=self.name,
            inputs=self.inputs,
            spring=self.spring,
            difference_c=self.difference_c,
            at_s=self.at_s,
            duration_s=self.duration_s,
            current_a=self.current_a,
            steps=self.steps,
        )


def _inputs(rows: int, cols: int, fan_seen: bool) -> list[tuple[str, str, np.ndarray, np.ndarray, float]]:
    """Return standard experiments: name, words, pattern of levels over time (rows, n), fan (rows,), step s."""
    n = rows * cols
    row, column = np.divmod(np.arange(n), cols)
    step = 2.0
    out = []

    def add(name: str, words: str, duration: float, level: Any, fan: Any = None, dt: float = step) -> None:
        time_s = np.arange(0.0, duration + dt, dt)
        drive = np.array([level(t) for t in time_s], dtype=float)
        air = np.array([0.0 if fan is None else fan(t) for t in time_s], dtype=float)
        out.append((name, words, drive, air, dt))

    def pattern(which: np.ndarray) -> np.ndarray:
        return which.astype(float)

    middle = (rows // 2) * cols + cols // 2
    for k in sorted({0, middle, n - 1, cols // 2}):
        one = pattern(np.arange(n) == k)
        add(
            "single-spring step",
            f"spring {k + 1} on at 100 % for 5 min, then off for 5 min, all others off, fan off",
            600.0,
            lambda t, one=one: one * (t < 300),
        )
    board = pattern((row + column) % 2 == 0)
    if n > 1:
        add(
            "checkerboard",
            "springs " + ", ".join(str(k + 1) for k in np.flatnonzero(board)) + " on for 7 min, the others off",
            600.0,
            lambda t: board * (t < 420),
        )
    every = np.ones(n)
    add("cool-down", "all springs on for 4 min, then all off for 11 min", 900.0, lambda t: every * (t < 240))
    add("weak hold", "all springs on at 35 % for 15 min", 900.0, lambda t: 0.35 * every)
    add("long hold", "all springs on at 50 % for 60 min", 3600.0, lambda t: 0.5 * every, dt=10.0)
    add(
        "staircase",
        "all springs on at 20, 40, 60, 80, 100 % for 4 min each",
        1200.0,
        lambda t: every * min(1.0, 0.2 * (1 + t // 240)),
    )
    add("idle", "nothing on for 30 min", 1800.0, lambda t: 0.0 * every, dt=10.0)
    if fan_seen:
        add(
            "fan toggled",
            "all springs on at 60 % for 16 min, fan on from 4 to 8 and from 12 to 16 min",
            960.0,
            lambda t: 0.6 * every,
            lambda t: float((t // 240) % 2 == 1),
        )
        left = pattern(column == 0)
        add(
            "fan across one column",
            "first column on for 10 min, fan on from the start",
            600.0,
            lambda t: left,
            lambda t: 1.0,
        )
    return out


def _steps(time_s: np.ndarray, share: np.ndarray, fan: np.ndarray) -> list[results.Step]:
    """Return the changes of an experiment: share of the current (rows, n), fan (rows,), 0..1."""
    table = np.rint(100.0 * np.column_stack([share, fan])).astype(int)
    changes = np.flatnonzero(np.r_[True, (np.diff(table, axis=0) != 0).any(axis=1)])
    return [results.Step(at_s=float(time_s[k]), percent=table[k, :-1].tolist(), fan=int(table[k, -1])) for k in changes]


def separate(problem: Problem, a: Fit, b: Fit) -> Experiment:
    """Return the standard experiment in which two fitted models differ most (best per its length and noise)."""
    run = problem.runs[0]
    fan_seen = any((r.fan > 0.1).any() for r in problem.runs)
    flowed = [r.current_a[r.current_a > 0] for r in problem.runs if r.current_a is not None]
    current_a = max((float(np.percentile(one, 95)) for one in flowed if one.size), default=None)
    best: tuple[float, Experiment] | None = None
    noise = problem.noise_c
    top = max(float(np.percentile(r.drive[r.drive > 0], 95)) if (r.drive > 0).any() else 0.5 for r in problem.runs)
    for name, words, levels, fan, step in _inputs(problem.array.rows, problem.array.cols, fan_seen):
        drive = np.sqrt(levels) * top if run.mode == "current" else levels * top
        time_s = np.arange(len(levels)) * step
        ambient = 20.0 if run.ambient_c is None else float(run.ambient_c[0])
        trial = Run(
            "experiment",
            "",
            time_s,
            run.mode,
            np.ascontiguousarray(drive),
            np.full(levels.shape, ambient),
            fan,
            np.full(len(time_s), ambient),
        )
        shown = []
        try:
            for fit in (a, b):
                plant = problem.plant_for(fit.spec, fit.values)
                trial_run = replace(trial, temperature_c=np.full(levels.shape, np.nan))
                shown.append(simulate_run(plant, trial_run, trial.ambient_c, {}))
        except native.NativeError:
            continue
        apart = shown[0] - shown[1]
        hot = np.maximum(shown[0], shown[1]).max(axis=1)
        apart[np.maximum.accumulate(hot) > 130.0] = 0.0
        width = max(1, round(20.0 / step))
        smooth = uniform_filter1d(apart, width, axis=0)
        at, k = np.unravel_index(int(np.abs(smooth).argmax()), smooth.shape)
        size = float(abs(smooth[at, k]))
        merit = size / (1.0 + time_s[-1] / 3600.0)
        unit = {"power": "W", "current": "A", "command": "of the command"}[run.mode]
        if best is None or merit > best[0]:
            best = (
                merit,
                Experiment(
                    name,
                    f"{words} (100 % is {top:.2g} {unit})",
                    int(k) + 1,
                    size,
                    float(time_s[at]),
                    float(time_s[-1]),
                    noise,
                    "",
                    current_a,
                    _steps(time_s, levels if run.mode == "command" else np.sqrt(levels), fan),
                ),
            )
    assert best is not None
    found = best[1]
    samples = max(1.0, (3.0 * noise / max(found.difference_c, 1e-9)) ** 2)
    if found.difference_c >= 2.0 * noise:
        advice = f"{found.difference_c / noise:.0f} times the noise"
    elif samples <= 600:
        advice = f"below the noise of one reading: average {samples:.0f} readings"
    else:
        advice = "too little to see with this sensor: a quieter one or a measured power (log v) is needed"
    found.text = (
        f"{found.name}: {found.inputs}; watch spring {found.spring} at {found.at_s:.0f} s: "
        f"the two differ by {found.difference_c:.2f} degC ({advice}); {found.duration_s / 60:.0f} min"
    )
    return found
