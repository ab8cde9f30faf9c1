"""Heat that no log has, put into the fitted model: how the readings answer it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..io.logs.run import Run
from ..model import native
from ..model.simulate import simulate_run, started
from .fit import Fit
from .problem import Problem

PROBE = 0.05
"""Heat whose answer is simulated, as a part of the usual power: small enough that the model is straight."""

THIN = 4
"""Rows that count as one where causes are looked for: heat is slower than that."""


def thin(fields: np.ndarray) -> np.ndarray:
    """Return fields (rows, springs, n) in units of the noise as (samples, n): THIN rows as one, unit noise kept."""
    summed = np.add.reduceat(fields, np.arange(0, len(fields), THIN), axis=0) / math.sqrt(THIN)
    return summed.reshape(-1, fields.shape[2]).astype(np.float32)


def power_of(problem: Problem, fit: Fit, run_index: int) -> np.ndarray:
    """Return the power that a fit gives each spring of a run, (rows, springs), W (current: at the martensite's resistance)."""
    run = problem.run_of(run_index, fit.as_dict())
    plant = problem.plant_for(fit.spec, fit.values, run_index)
    if run.mode == "current":
        return run.drive**2 * plant.get("resistance_ohm")
    if run.mode == "command":
        return run.drive * np.array([plant.get(f"command_power_w[{k + 1}]") for k in range(run.springs)])
    return run.drive


def _with_heat(problem: Problem, fit: Fit, r: int, run: Run, power_w: np.ndarray, extra_w: np.ndarray) -> Run:
    """Return a run whose springs are given `extra_w` (rows, springs) beside what was logged."""
    wanted = np.maximum(power_w + extra_w, 0.0)
    if run.mode == "power":
        return problem.heated(replace(run, drive=wanted), r)
    factor = np.where(power_w > 0, wanted / np.where(power_w > 0, power_w, 1.0), 0.0)
    plant = problem.plant_for(fit.spec, fit.values, r)
    if run.mode == "current":
        idle = np.sqrt(wanted / plant.get("resistance_ohm"))
        return replace(run, drive=np.where(power_w > 0, run.drive * np.sqrt(factor), idle))
    if "supply_sag" not in fit.spec.plant_effects:
        return replace(run, mode="power", drive=wanted)
    full = np.array([max(1e-9, plant.get(f"command_power_w[{k + 1}]")) for k in range(run.springs)])
    return replace(run, drive=np.minimum(np.where(power_w > 0, run.drive * factor, wanted / full), 1.0))


def step_answers(
    problem: Problem, fit: Fit, r: int, edges: np.ndarray, typical_w: float
) -> dict[tuple[str, int], np.ndarray]:
    """Return how the readings answer 1 W that begins at each edge and stays, (edges, rows, springs), K/W: per spring, and
    at all of them. Simulated with everything else as it was, fan and all, each from its edge on.
    """
    run, power = problem.run_of(r, fit.as_dict()), power_of(problem, fit, r)
    size = PROBE * typical_w
    given = [_with_heat(problem, fit, r, run, power, _one(power, k, size)) for k in range(run.springs)]
    usual = _with_heat(problem, fit, r, run, power, np.zeros_like(power))
    ambient = problem.ambient_of(r, fit.as_dict())
    mode = native.MODES[usual.mode]
    out = {("heat", k): np.zeros((len(edges), *power.shape), np.float32) for k in range(run.springs)}

    def part(plant: native.Plant, one: Run, begin: int, end: int) -> np.ndarray:
        rows = slice(begin, end)
        air = None if ambient is None else ambient[rows]
        return plant.simulate(one.time_s[rows], mode, one.drive[rows], one.fan[rows], air)

    def of_piece(begin: int, end: int) -> None:
        plant = started(problem.plant_for(fit.spec, fit.values, r), usual, ambient, begin)
        rest = part(plant.copy(), usual, begin, end)
        at = begin
        for number, edge in enumerate(edges):
            # heat that began before a gap in time acts after it, too
            since = max(int(edge), begin)
            if since >= end - 1:
                continue
            if since > at:
                part(plant, usual, at, since + 1)
                at = since
            problem.budget.take(round(run.springs * (end - since) / len(run.time_s)))
            twins = [plant.copy() for _ in given]
            shown = problem.each(lambda k: part(twins[k], given[k], since, end), range(run.springs))  # noqa: B023
            for k, one in enumerate(shown):
                out["heat", k][number, since:end] = (one - rest[since - begin :]) / size

    for begin, end in zip(run.starts, [*run.starts[1:], len(run.time_s)], strict=True):
        of_piece(begin, end)
    if run.springs > 1:
        # one by one: of half a day each is tens of megabytes
        common = out["common", -1] = np.zeros((len(edges), *power.shape), np.float32)
        for k in range(run.springs):
            common += out["heat", k]
    return out


def _one(power: np.ndarray, k: int, size: float) -> np.ndarray:
    extra = np.zeros_like(power)
    extra[:, k] = size
    return extra


def answers(problem: Problem, fit: Fit, r: int, heat_w: Sequence[np.ndarray], typical_w: float) -> list[np.ndarray]:
    """Return how the readings of a run answer these heats (rows, springs), W, of either sign: (rows, springs), K.

    Each is made small first, and what it takes away is simulated as what it gives: a spring that is off can be given heat only.
    """
    jobs, scales = [], []
    for one in heat_w:
        size = float(np.sqrt(np.mean(one**2)))
        scale = PROBE * typical_w / size if size > 0 else 0.0
        jobs += [np.maximum(one, 0.0) * scale, np.maximum(-one, 0.0) * scale]
        scales.append(scale)
    there = [k for k, job in enumerate(jobs) if job.any()]
    rest, *some = _shown(problem, fit, r, [np.zeros_like(problem.runs[r].drive), *(jobs[k] for k in there)])
    moved = {k: one - rest for k, one in zip(there, some, strict=True)}
    nothing = np.zeros_like(rest)
    return [
        (moved.get(2 * k, nothing) - moved.get(2 * k + 1, nothing)) / scale if scale else nothing
        for k, scale in enumerate(scales)
    ]


def _shown(problem: Problem, fit: Fit, r: int, extra_w: Sequence[np.ndarray]) -> list[np.ndarray]:
    run, power = problem.run_of(r, fit.as_dict()), power_of(problem, fit, r)
    ambient = problem.ambient_of(r, fit.as_dict())

    def one(extra: np.ndarray) -> np.ndarray:
        problem.budget.take()
        plant = problem.plant_for(fit.spec, fit.values, r)
        return simulate_run(plant, _with_heat(problem, fit, r, run, power, extra), ambient)

    return problem.each(one, extra_w)
