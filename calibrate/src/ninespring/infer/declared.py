"""What is declared of an array, and of it what every fit leaves free."""

from __future__ import annotations

import math

import numpy as np

from ..io.logs.run import Run
from ..model import native
from ..model.spec import Free, Spec
from . import room
from .problem import Problem

BELIEVED = math.log(3.0)
"""What is declared is believed within a factor of three: next to nothing where the data speak, and what they only fix in
combination stays near what was declared."""


def base_spec(problem: Problem, frozen: bool = False) -> Spec:
    """Return the declared model of these runs: what is always fitted (nothing where frozen)."""
    runs = problem.runs
    fixed = dict(problem.declared)
    free: list[Free] = []
    get = problem.base_value
    modes = {run.mode for run in runs}
    if "current" in modes and "resistance_ohm" not in fixed:
        # without voltages nothing fixes the scale of power: the declared martensite's resistance does
        fixed["resistance_ohm"] = get("resistance_martensite_ohm")
    if not frozen:
        fan = np.concatenate([run.fan for run in runs])
        still, blowing = bool((fan < 0.9).any()), bool((fan > 0.1).any())
        if modes != {"command"}:
            free.append(_declared(problem, "heat_capacity_j_per_k", 0.02, 50.0))
        names = [("loss", 1e-4, 1.0), ("orthogonal", 1e-6, 0.5), ("diagonal", 1e-7, 0.5)]
        rows, cols = problem.array.rows, problem.array.cols
        if rows * cols < 2:
            names = names[:1]
        elif min(rows, cols) < 2:
            names = names[:2]
        for name, low, high in names:
            if still:
                free.append(_declared(problem, f"{name}_w_per_k", low, high))
            if blowing:
                free.append(_declared(problem, f"{name}_fan_w_per_k", low, high))
        if "command" in modes:
            for k in range(runs[0].springs):
                if any(np.any(run.drive[:, k] > 0) for run in runs):
                    key = f"command_power_w[{k + 1}]"
                    free.append(Free(key, get("command_power_w"), 1e-4, 100.0, "W", (key,), True))
    alone = room.rests_alone(runs)
    prior = None if alone is None else room.ROOMS_K
    for r, (run, (low, high)) in enumerate(zip(runs, room.believed(runs), strict=True)):
        if run.ambient_c is None:
            begun = _first_guess(run) if alone is None else alone
            guess = 0.5 * (low + high) if math.isfinite(low) else begun
            start, low, high = (float(np.clip(one, -35.0, 75.0)) for one in (guess, low, high))
            free.append(Free(f"ambient_c@{r + 1}", start, low, high, "degC", run=r, prior=prior))
    return Spec((), tuple(fixed.items()), tuple(free), ())


def _first_guess(run: Run) -> float:
    """Return a first guess of a room of which nothing is known but how its run begins, degC."""
    first = run.temperature_c[: max(3, len(run.time_s) // 200)]
    guess = float(np.nanmedian(first)) if np.isfinite(first).any() else 20.0
    coldest = float(np.nanmin(run.temperature_c))
    guess = min(guess, coldest + 3.0) if not np.any(run.drive[0] > 0) else min(guess, 25.0)
    return float(np.clip(guess, -20.0, 60.0))


def _declared(problem: Problem, name: str, low: float, high: float) -> Free:
    start = min(high, max(low, problem.base_value(name)))
    return Free(name, start, low, high, native.parameter_table()[name].unit, (name,), True, prior=BELIEVED)
