"""Contacts that get worse, or better, at some time: steps of v / i that neither phase nor temperature makes.

What a contact always had is in its spring's own resistance: v / i alone cannot tell wire from clamp. How far a spring has
transformed once it is hot depends on kinetics that nobody knows exactly: only what cold wire shows makes a contact loose, and
then hot readings, too, say when it changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..infer.problem import Problem
from ..infer.rounding import DRIVEN_A
from ..io.logs.run import Run
from .readings import SEEN, Linear, Readings, nats_of, solve

LEAST_NATS = 3.0
"""Evidence, after all prices, of a change: one in twenty."""
MOST_A_RUN = 2
"""Changes of one contact in one run: what changes more often is no clamp that works loose."""
SMALLEST_OHM = 0.002
"""A contact below this is no finding: wire and solder of any spring."""


@dataclass(frozen=True)
class Step:
    """A contact that changed by `ohm` with one reading of its spring, and stayed so."""

    spring: int
    run: int
    from_s: float
    since: int
    """Row of the readings that is the first after the change."""
    before_s: float = -math.inf
    """Of the last reading before it, where that is of the same run."""
    ohm: float = math.nan
    error: float = math.nan
    nats: float = math.nan
    tried: int = 1

    @property
    def words(self) -> str:
        """Say where and since when."""
        return f"spring {self.spring + 1}, from {self.from_s:.0f} s of run {self.run + 1}"

    def column(self, read: Readings) -> np.ndarray:
        """Return which readings are after the change, as numbers."""
        later = (read.run > self.run) | ((read.run == self.run) & (read.time_s >= self.from_s))
        return ((read.spring == self.spring) & later).astype(float)


def find(read: Readings, columns: dict[str, np.ndarray]) -> tuple[list[Step], Linear]:
    """Return the changes that earn their price beside `columns`, in time's order, and the fit with them."""
    shown = {key: one[read.cold] for key, one in columns.items() if one[read.cold].any()}
    loose = {one.spring for one in _among(read.of(read.cold), shown)[0]} if shown else set()
    return _among(read, columns, loose)


def _among(
    read: Readings, columns: dict[str, np.ndarray], only: Collection[int] | None = None
) -> tuple[list[Step], Linear]:
    """Return the changes that these readings show, of some springs `only`, and the fit with them."""
    steps: list[Step] = []
    model = solve(read, columns)
    tried = len(read.ohm)
    own = [np.flatnonzero(read.spring == k) for k in range(int(read.spring.max()) + 1)]
    own = [rows[np.lexsort((read.time_s[rows], read.run[rows]))] for rows in own]

    def fitted(those: Sequence[Step]) -> Linear:
        return solve(read, columns | {f"step {n}": one.column(read) for n, one in enumerate(those)})

    def best(beside: Sequence[Step], springs: Sequence[int]) -> Step | None:
        """Return the change of one of these springs that explains most beside others."""
        rest = fitted(beside).rest
        matrix = np.column_stack([*columns.values(), *(one.column(read) for one in beside)]) / read.noise[:, None]
        basis = np.linalg.qr(matrix)[0]
        top, found = 0.0, None
        for k in springs:
            rows = own[k]
            if len(rows) < 2 * SEEN:
                continue
            weight = 1.0 / read.noise[rows]
            # sums over all readings from each one on: a change there, others projected out, all at once
            inside = np.cumsum((basis[rows] * weight[:, None])[::-1], axis=0)[::-1]
            moment = np.cumsum((rest[rows] * weight)[::-1])[::-1]
            power = np.cumsum((weight**2)[::-1])[::-1] - (inside**2).sum(axis=1)
            size = moment / np.maximum(power, 1e-9)
            # what is not half of a finding is none beside others either
            told = (power > 1e-6 * weight.max() ** 2) & (np.abs(size) > 0.5 * SMALLEST_OHM)
            gain = np.where(told, moment * size, 0.0)
            # a few readings, as those of the moment in which a spring is switched on, are no contact that stays
            edges = [0, *(int(np.flatnonzero(rows == one.since)[0]) for one in beside if one.spring == k), len(rows)]
            for edge in edges:
                gain[max(0, edge - SEEN + 1) : edge + SEEN] = 0.0
            at = int(np.argmax(gain))
            if gain[at] > top:
                since, last = int(rows[at]), int(rows[at - 1])
                before_s = float(read.time_s[last]) if read.run[last] == read.run[since] else -math.inf
                top, found = float(gain[at]), Step(k, int(read.run[since]), float(read.time_s[since]), since, before_s)
        return found

    # what one change leaves of the others is no noise: all are put in first, then each must be needed beside the rest
    most = MOST_A_RUN * (1 + int(read.run.max()))
    possible = range(len(own)) if only is None else sorted(only)
    while springs := [k for k in possible if sum(one.spring == k for one in steps) < most]:
        one = best(steps, springs)
        if one is None:
            break
        grown = _placed([*steps, one], best)
        trial = fitted(grown)
        if model.chi2 - trial.chi2 < 2.0 * (math.log(tried) + LEAST_NATS) * trial.spread:
            break
        steps, model = grown, trial
    while steps:
        without = [fitted([other for other in steps if other is not one]) for one in steps]
        each = [nats_of(read, less, model) for less in without]
        sizes = [abs(float(value)) for value in model.values[len(columns) :]]
        n = min(range(len(steps)), key=lambda k: each[k] if sizes[k] >= SMALLEST_OHM else -math.inf)
        if each[n] >= math.log(tried) + LEAST_NATS and sizes[n] >= SMALLEST_OHM:
            break
        steps = _placed([other for m, other in enumerate(steps) if m != n], best)
        model = fitted(steps)
    out = []
    for n, one in enumerate(steps):
        at = len(columns) + n
        nats = nats_of(read, fitted([other for m, other in enumerate(steps) if m != n]), model)
        error = math.sqrt(float(model.covariance[at, at]))
        out.append(replace(one, ohm=float(model.values[at]), error=error, nats=nats, tried=tried))
    return sorted(out, key=lambda one: (one.spring, one.run, one.from_s)), model


def _placed(steps: Sequence[Step], best: Callable[[Sequence[Step], Sequence[int]], Step | None]) -> list[Step]:
    """Put each change again where it fits best beside the others."""
    out = list(steps)
    for n, this in enumerate(steps):
        out[n] = best([*out[:n], *out[n + 1 :]], [this.spring]) or this
    return out


def dated(problem: Problem, steps: Sequence[Step]) -> list[Step]:
    """Return changes at the time at which v / i jumps most, on the way from one settled reading to the next.

    Without such a jump a contact changed while its spring was off, or before the run: then it is the reading after.
    """
    out = []
    for one in steps:
        run = problem.runs[one.run]
        rows = np.flatnonzero((run.time_s > one.before_s) & (run.time_s <= one.from_s))
        current, voltage = (np.nan_to_num(given[rows, one.spring]) for given in (run.current_a, run.voltage_v))
        driven = current > DRIVEN_A
        jumps = np.diff(voltage[driven] / current[driven]) * math.copysign(1.0, one.ohm)
        if len(jumps) and jumps.max() > 0.5 * abs(one.ohm):
            one = replace(one, from_s=float(run.time_s[rows[driven][1 + int(np.argmax(jumps))]]))
        out.append(one)
    return out


def added_ohm(run: Run, r: int, steps: Sequence[Step]) -> np.ndarray:
    """Return what contacts add in series by their changes, (rows, springs), in the run that is number `r`."""
    ohm = np.zeros_like(run.drive)
    for one in steps:
        if r >= one.run:
            ohm[:, one.spring] += one.ohm * ((run.time_s >= one.from_s) | (r > one.run))
    return ohm


def without_heat(run: Run, ohm: np.ndarray) -> Run:
    """Return a run without the heat that contacts of so many ohm take of what the springs are given."""
    heat = np.nan_to_num(run.current_a) ** 2 * ohm
    return replace(run, drive=np.maximum(run.drive - heat, 0.0))


def take_heat_out(problem: Problem, steps: Sequence[Step]) -> None:
    """Take out of what the springs are given the heat that contacts take: v i is measured with them."""
    for r, run in enumerate(problem.runs):
        if run.mode == "power" and run.current_a is not None:
            problem.runs[r] = without_heat(run, added_ohm(run, r, steps))
