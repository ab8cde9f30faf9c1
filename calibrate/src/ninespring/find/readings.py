"""v / i of every spring in rows: the readings that tell a resistance, and linear fits of them.

A reading counts where the spring is driven and settled in one phase; how hot it was the thermometers say, not the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import pandas as pd
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from ..infer.fit import Fit
from ..infer.from_resistance import ohm_of
from ..infer.problem import Problem
from ..infer.rounding import ROUNDING_V
from ..io import statistics
from ..io.logs.mending import RUN_IN_S
from ..io.logs.run import Run
from ..model.simulate import simulate_run
from .evidence import price

REFERENCE_C = 20.0
"""Temperature of the declared resistances."""
BELIEVED_RISE = 0.001
"""Per K: what NiTi's resistance rises by, about, in either phase."""
SETTLED = 0.02
NEAR_S = 15.0
"""A reading counts where austenite moves by less than SETTLED within NEAR_S before and after."""
COLDEST_C, HOTTEST_C = -60.0, 300.0
"""Between them the plant takes temperatures: at one every spring is martensite, at the other austenite."""
SMOOTHED = 5
"""Readings of a thermometer that are taken together for a spring's temperature."""
SEEN = 30
"""Readings in each phase from which two resistances are told apart, and before and after a contact changed."""


@dataclass
class Readings:
    """v / i of all runs in rows: what was read, of which spring, at which phase and temperature."""

    ohm: np.ndarray
    spring: np.ndarray
    run: np.ndarray
    time_s: np.ndarray
    phase: np.ndarray
    over_k: np.ndarray
    noise: np.ndarray
    """Of each row, ohm."""
    cold: np.ndarray
    """Which are below the martensite's finish: there a spring is martensite whatever it was, and has not begun to be else."""

    @staticmethod
    def joined(parts: Sequence[Sequence[np.ndarray]]) -> Readings:
        """Return what parts of the readings have, each the fields in their order, as one."""
        return Readings(*map(np.concatenate, zip(*parts, strict=True)))

    def own(self) -> dict[str, np.ndarray]:
        """Return of each spring which readings are its own, as numbers: every spring has a resistance of its own, for wires differ."""
        return {f"own {k}": (self.spring == k).astype(float) for k in np.unique(self.spring)}

    def of(self, rows: np.ndarray) -> Readings:
        """Return some of the rows."""
        return Readings(*(getattr(self, field.name)[rows] for field in fields(self)))

    def hot_times(self) -> dict[str, np.ndarray]:
        """Return which readings are of each time that a spring was hot: it may have transformed further in each."""
        order = np.lexsort((self.time_s, self.run, self.spring))
        apart = (np.diff(self.spring[order]) != 0) | (np.diff(self.run[order]) != 0)
        apart |= np.diff(self.time_s[order]) > NEAR_S
        which = np.empty(len(order), dtype=int)
        which[order] = np.concatenate(([0], np.cumsum(apart)))
        hot = self.phase > 0.5
        return {f"hot {n}": (which == n) & hot for n in np.unique(which[hot])}


def readings(problem: Problem, fit: Fit) -> Readings | None:
    """Return the readings of runs whose currents and voltages are known; None where there are none."""
    parts = []
    for r, run in enumerate(problem.runs):
        if run.current_a is None or run.voltage_v is None:
            continue
        traced, known = _as_measured(problem, fit, r)
        cold = colder(problem, fit, traced[:, :, 0])
        told = known & settled(run, traced[:, :, 1])
        ohm = ohm_of(run)
        noise = statistics.noise_floor(ohm, run.starts)
        for k in range(run.springs):
            here = np.flatnonzero(np.isfinite(ohm[:, k]) & told[:, k])
            if len(here) >= 20 and np.isfinite(noise[k]):
                n = len(here)
                columns = (ohm[here, k], np.full(n, k), np.full(n, r), run.time_s[here])
                sigma = np.hypot(noise[k], ROUNDING_V / run.current_a[here, k])
                parts.append((*columns, traced[here, k, 1], traced[here, k, 0] - REFERENCE_C, sigma, cold[here, k]))
    return Readings.joined(parts) if parts else None


def colder(problem: Problem, fit: Fit, temperature_c: np.ndarray) -> np.ndarray:
    """Return where springs of these temperatures (rows, springs) are below their martensite's finish."""
    plant = problem.plant_for(fit.spec, fit.values)
    shift_k = [plant.get(f"transformation_shift_k[{k + 1}]") for k in range(temperature_c.shape[1])]
    return temperature_c < plant.get("martensite_finish_c") + np.array(shift_k)


def settled(run: Run, austenite: np.ndarray) -> np.ndarray:
    """Return where springs are in one phase and stay there, (rows, springs)."""
    width = 1 + 2 * max(1, round(NEAR_S / float(np.median(np.diff(run.time_s)))))
    # on the way between the phases the model's part of austenite is no better than its temperature
    moving = maximum_filter1d(austenite, width, axis=0) - minimum_filter1d(austenite, width, axis=0) > SETTLED
    return ~moving & ((austenite <= SETTLED) | (austenite >= 1.0 - SETTLED))


def _as_measured(problem: Problem, fit: Fit, r: int) -> tuple[np.ndarray, np.ndarray]:
    """Return temperatures and austenite of a run, (rows, springs, 2), springs as hot as the thermometers say, and where they
    say the phase, too, (rows, springs).

    What heat the model has wrong, as that of a contact which is measured with its spring, is in neither. What a spring was
    before the log, or before a gap in it, nobody saw: the phase is known from where it is the same whatever it was.
    """
    run = problem.run_of(r, fit.as_dict())
    ambient = problem.ambient_of(r, fit.as_dict())
    traced = simulate_run(problem.plant_for(fit.spec, fit.values, r), run, ambient, trace=True)
    left = pd.DataFrame(fit.residual[r]).rolling(SMOOTHED, center=True, min_periods=1).mean().fillna(0.0).to_numpy()
    hot = np.clip(traced[:, :, 0] + left, COLDEST_C, HOTTEST_C)
    told = np.ones(len(run.time_s), dtype=bool)
    first = [0]
    for begin in run.starts[1:]:
        end = int(np.searchsorted(run.time_s, run.time_s[begin] + RUN_IN_S))
        told[begin:end] = False
        first.append(end - 1)
    cold, warm = (
        _driven_to(problem, fit, replace(run, drive=hot), ambient, first, was) for was in (COLDEST_C, HOTTEST_C)
    )
    return cold, (np.abs(cold[:, :, 1] - warm[:, :, 1]) <= SETTLED) & told[:, None]


def _driven_to(
    problem: Problem, fit: Fit, run: Run, ambient: np.ndarray | None, first: list[int], was_c: float
) -> np.ndarray:
    """Return temperatures and austenite of springs as hot as `run` has them, and before its `first` rows at `was_c`."""
    drive = run.drive.copy()
    drive[first] = was_c
    given = replace(run, mode="temperature", drive=drive, warm=False, starts=[0])
    return simulate_run(problem.plant_for(fit.spec, fit.values), given, ambient, trace=True)


@dataclass
class Linear:
    """A weighted linear fit."""

    names: list[str]
    values: np.ndarray
    covariance: np.ndarray
    chi2: float
    rest: np.ndarray

    @property
    def spread(self) -> float:
        """Mean square of what is left, in units of the noise, 1 at least."""
        return max(1.0, self.chi2 / max(1, len(self.rest) - len(self.values)))


def solve(read: Readings, columns: dict[str, np.ndarray]) -> Linear:
    """Fit; rises with temperature are believed to be within BELIEVED_RISE beforehand."""
    # in place: of half a day there are hundreds of columns
    matrix = np.empty((len(read.ohm), len(columns)))
    for k, column in enumerate(columns.values()):
        matrix[:, k] = column
    matrix /= read.noise[:, None]
    wanted = read.ohm / read.noise
    usual = BELIEVED_RISE * float(np.median(read.ohm))
    trust = np.array([1.0 / usual**2 if key.startswith("rise") else 0.0 for key in columns])
    scale = np.maximum(np.sqrt(np.einsum("ij,ij->j", matrix, matrix)), 1e-12)
    matrix /= scale
    inverse = np.linalg.pinv(matrix.T @ matrix + np.diag(trust / scale**2), rcond=1e-10)
    values = inverse @ (matrix.T @ wanted)
    rest = wanted - matrix @ values
    chi2 = float(rest @ rest)
    found = Linear(list(columns), values / scale, inverse, chi2, rest)
    found.covariance = inverse * found.spread / np.outer(scale, scale)
    return found


def nats_of(read: Readings, less: Linear, more: Linear) -> float:
    """Return by how much the larger model is likelier, each with its numbers paid for (BIC): by noise that is no less than what is
    known of the readings, correlated rows counted for less."""
    rest = more.rest
    rho = float(rest[1:] @ rest[:-1] / max(1e-12, rest @ rest))
    alike = max(0.02, (1.0 - max(0.0, rho)) / (1.0 + max(0.0, rho)))
    gained = statistics.surprise(less.chi2, len(rest), 1.0) - statistics.surprise(more.chi2, len(rest), 1.0)
    return alike * gained - price(len(more.values) - len(less.values), alike * len(rest))
