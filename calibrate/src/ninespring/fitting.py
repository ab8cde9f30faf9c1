"""Fits of the plant to logs: free numbers, parallel simulations, bounded least squares, standard errors.

A `Spec` says what a model is (effects on, fixed values, free numbers); a `Problem` holds the runs and
simulates them; `Problem.fit` returns a `Fit`. All residuals are measured minus model, degC.
"""

from __future__ import annotations

import concurrent.futures
import math
import os
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from . import native, statistics
from .logs import Run
from .models import Array

WORKERS = max(1, min(8, os.cpu_count() or 1))
_BAD = 1e3
"""What a simulation that the plant refuses 'shows', degC: so far off that no fit goes there."""


FOLDS = 5
BLOCK_S = 150.0
"""Length of a held-out block: longer than the residual remembers, shorter than a drift of the ambient."""


SLOW_KNOTS = 5
"""Knots of a slow drift of the ambient over a run, the first of them zero."""


def _hats(run: Run, knots: np.ndarray) -> np.ndarray:
    """Return smooth unit bumps around each knot but the first, (rows, knots - 1)."""
    return CubicSpline(knots, np.eye(len(knots)), bc_type="natural")(run.time_s)[:, 1:]


def fold_of_rows(run: Run) -> np.ndarray:
    """Return the fold (0..FOLDS-1) of every row: blocks of BLOCK_S, or of a fifth of a short run, in turn."""
    block = min(BLOCK_S, run.duration_s / FOLDS)
    return ((run.time_s - run.time_s[0]) // max(block, 1e-9)).astype(int) % FOLDS


@dataclass(frozen=True)
class Free:
    """One free number of a fit.

    `names` are the plant's parameters that take its value (times `weights` where given). `ambient` numbers set a
    run's ambient instead: a constant, or a hat function of time around `knot` of the run's knots.
    """

    key: str
    start: float
    low: float
    high: float
    unit: str
    names: tuple[str, ...] = ()
    log: bool = False
    run: int | None = None
    knot: int | None = None
    effect: str | None = None
    scale: float = 1.0
    """A change that matters, in its unit (linear numbers only)."""

    def inner(self, value: float) -> float:
        """Map to the coordinate the optimiser works in."""
        return math.log(value) if self.log else value / self.scale

    def outer(self, z: float) -> float:
        """Map back."""
        value = math.exp(z) if self.log else z * self.scale
        return min(self.high, max(self.low, value))

    @property
    def slope_step(self) -> float:
        """Step of a finite difference in the inner coordinate."""
        return 0.01 if self.log else 0.02


@dataclass(frozen=True)
class Spec:
    """What a model is: effects on, values fixed, numbers free."""

    effects: tuple[str, ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    free: tuple[Free, ...] = ()
    variant: tuple[tuple[str, str], ...] = ()
    """Per effect, which variant (spring, direction, ...)."""

    also_on: tuple[tuple[str, str], ...] = ()
    """(effect, effect of the plant that is on with it)."""

    def with_effect(
        self,
        effect: str,
        free: Iterable[Free],
        fixed: Iterable[tuple[str, float]],
        variant: str,
        also_on: Iterable[str] = (),
    ) -> Spec:
        """Return the spec with one more effect on."""
        return Spec(
            (*self.effects, effect),
            tuple((dict(self.fixed) | dict(fixed)).items()),
            (*self.free, *free),
            (*self.variant, (effect, variant)),
            (*self.also_on, *((effect, other) for other in also_on)),
        )

    @property
    def plant_effects(self) -> tuple[str, ...]:
        """Effects to switch on in the plant."""
        return tuple(dict.fromkeys((*self.effects, *(other for _, other in self.also_on))))

    def without(self, effect: str) -> Spec:
        """Return the spec without an effect (its fixed values stay: they count only while it is on)."""
        return replace(
            self,
            effects=tuple(e for e in self.effects if e != effect),
            free=tuple(f for f in self.free if f.effect != effect),
            variant=tuple(v for v in self.variant if v[0] != effect),
            also_on=tuple(v for v in self.also_on if v[0] != effect),
        )


@dataclass
class Fit:
    """A fitted model: values, what it leaves, how sure."""

    spec: Spec
    values: np.ndarray
    chi2: float
    """Sum of squared residuals in units of the noise, errors of the starting temperatures whitened out."""
    count: int
    residual: list[np.ndarray]
    """Per run (rows, springs), degC, NaN where nothing was measured."""
    jacobian: np.ndarray | None = None
    """d(residual / noise) / d(inner coordinate), (count, free)."""
    vector: np.ndarray | None = None
    covariance: np.ndarray | None = None
    """Of the inner coordinates, autocorrelation taken into account."""
    stuck: list[str] = field(default_factory=list)
    """Numbers that the data cannot fix: held at their start."""
    sse: float = math.nan
    """Plain sum of squared residuals in units of the noise."""
    factor: float = math.nan
    """Samples per independent sample of the residual, where it has been computed."""
    innovation: float = math.nan
    """Variance of the residual's innovations, where it has been computed."""
    holdout: float = math.nan
    """Held-out rms error, degC, where it has been computed."""
    simulations: int = 0

    def value(self, key: str) -> float:
        """Return a fitted number by key."""
        return float(self.values[[f.key for f in self.spec.free].index(key)])

    def as_dict(self) -> dict[str, float]:
        """Return fitted numbers by key."""
        return {f.key: float(v) for f, v in zip(self.spec.free, self.values, strict=True)}

    def stderr(self) -> dict[str, float]:
        """Return standard errors in the numbers' own units; infinite where the data say nothing."""
        out = {}
        for k, f in enumerate(self.spec.free):
            if f.key in self.stuck or self.covariance is None:
                out[f.key] = math.inf
                continue
            inner = math.sqrt(max(0.0, float(self.covariance[k, k])))
            out[f.key] = inner * (abs(self.values[k]) if f.log else f.scale)
        return out

    def correlations(self, limit: float = 0.98) -> list[tuple[str, str, float]]:
        """Return pairs of numbers whose errors are correlated beyond `limit`."""
        if self.covariance is None:
            return []
        deviation = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        rho = self.covariance / np.outer(deviation, deviation)
        keys = [f.key for f in self.spec.free]
        return [
            (keys[a], keys[b], float(rho[a, b]))
            for a in range(len(keys))
            for b in range(a)
            if abs(rho[a, b]) > limit and keys[a] not in self.stuck and keys[b] not in self.stuck
        ]

    def at_bounds(self) -> list[str]:
        """Return keys of numbers at a bound."""
        out = []
        for f, v in zip(self.spec.free, self.values, strict=True):
            z, low, high = f.inner(v), f.inner(f.low), f.inner(f.high)
            if z <= low + 1e-3 * (high - low) or z >= high - 1e-3 * (high - low):
                out.append(f.key)
        return out


class Problem:
    """Runs to be explained by an array. Holds what does not depend on the model."""

    def __init__(self, array: Array, runs: Sequence[Run], declared: Mapping[str, float] | None = None) -> None:
        self.array = array
        self.runs = list(runs)
        self.declared = dict(declared or {})
        self.knots = [
            np.linspace(run.time_s[0], run.time_s[-1], max(2, min(20, 1 + round(run.duration_s / 300.0))))
            for run in self.runs
        ]
        self.hats = {
            "ambient_drift_k": [_hats(run, knots) for run, knots in zip(self.runs, self.knots, strict=True)],
            "ambient_slow_drift_k": [
                _hats(run, np.linspace(run.time_s[0], run.time_s[-1], SLOW_KNOTS)) for run in self.runs
            ],
        }
        self.noise = [statistics.noise_floor(run.temperature_c, run.starts) for run in self.runs]
        self._tidy_noise()
        self.mask = [np.isfinite(run.temperature_c) for run in self.runs]
        self.count = int(sum(mask.sum() for mask in self.mask))
        self.basis: list[np.ndarray | None] = [None] * len(self.runs)
        self.start_response: list[np.ndarray | None] = [None] * len(self.runs)
        self.pool = concurrent.futures.ThreadPoolExecutor(WORKERS)
        self.simulations = 0
        self._count_lock = threading.Lock()
        base = native.Plant(array.rows, array.cols)
        base.set_all(array_parameters(array))
        base.set_all(self.declared)
        self._base = base
        self._local = threading.local()

    def base_value(self, name: str) -> float:
        """Return what the declared array has for a parameter of the plant."""
        return self._base.get(name)

    def _tidy_noise(self) -> None:
        """A column too short or too clean to estimate takes the median of the others; 0.005 degC at least."""
        everything = np.concatenate(self.noise)
        usable = everything[np.isfinite(everything) & (everything > 0)]
        usual = float(np.median(usable)) if usable.size else 0.05
        self.noise = [np.maximum(np.where(np.isfinite(one), one, usual), max(0.005, 0.2 * usual)) for one in self.noise]

    @property
    def noise_c(self) -> float:
        """Noise floor over everything measured, degC rms."""
        total = sum(
            float((mask.sum(axis=0) * noise**2).sum()) for mask, noise in zip(self.mask, self.noise, strict=True)
        )
        return math.sqrt(total / max(1, self.count))

    def mask_spikes(self, residual: Sequence[np.ndarray]) -> int:
        """Leave isolated outliers of a residual out of everything that follows; return how many."""
        total = 0
        for run, mask, noise, left in zip(self.runs, self.mask, self.noise, residual, strict=True):
            bad = statistics.spikes(left, noise)
            share = bad.mean() if bad.size else 0.0
            if 0 < share < 0.02:
                run.temperature_c[bad] = np.nan
                mask &= ~bad
                total += int(bad.sum())
        self.count = int(sum(mask.sum() for mask in self.mask))
        return total

    # ---- simulation -------------------------------------------------------------------------------------

    def ambient_of(self, run_index: int, values: Mapping[str, float]) -> np.ndarray | None:
        """Return the run's ambient (rows,) with fitted constants and knots, None where nothing says any."""
        run = self.runs[run_index]
        constant = values.get(f"ambient_c@{run_index + 1}")
        ambient = run.ambient_c
        if ambient is None and constant is not None:
            ambient = np.full(len(run.time_s), constant)
        for name, hats in self.hats.items():
            prefix = f"{name}@{run_index + 1}."
            drift = [values.get(f"{prefix}{k}", 0.0) for k in range(1, hats[run_index].shape[1] + 1)]
            if any(drift):
                if ambient is None:
                    ambient = np.full(len(run.time_s), self._base.get("ambient_c"))
                ambient = ambient + hats[run_index] @ np.asarray(drift)
        return ambient

    def plant_for(self, spec: Spec, values: Sequence[float]) -> native.Plant:
        """Return a fresh plant with the spec's effects and values."""
        plant = self._base.copy()
        plant.set_effects(spec.plant_effects)
        plant.set_all(dict(spec.fixed))
        settings: dict[str, float] = {}
        for free, value in zip(spec.free, values, strict=True):
            for name in free.names:
                settings[name] = float(value)
        plant.set_all(settings)
        return plant

    def simulate(
        self,
        spec: Spec,
        values: Sequence[float],
        run_index: int,
        start_offset: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return what the sensors of one run should show, (rows, springs), degC."""
        run = self.runs[run_index]
        with self._count_lock:
            self.simulations += 1
        by_key = {f.key: float(v) for f, v in zip(spec.free, values, strict=True)}
        try:
            plant = self.plant_for(spec, values)
            return simulate_run(plant, run, self.ambient_of(run_index, by_key), by_key, start_offset)
        except native.NativeError:
            return np.full(run.temperature_c.shape, _BAD)

    def simulate_many(self, jobs: Sequence[tuple[Spec, Sequence[float], int]]) -> list[np.ndarray]:
        """Simulate (spec, values, run) jobs in parallel threads."""
        if len(jobs) == 1:
            return [self.simulate(*jobs[0])]
        return list(self.pool.map(lambda job: self.simulate(*job), jobs))

    def predictions(self, spec: Spec, values: Sequence[float]) -> list[np.ndarray]:
        """Return what all runs should show."""
        return self.simulate_many([(spec, values, r) for r in range(len(self.runs))])

    # ---- residuals --------------------------------------------------------------------------------------

    def residuals(self, predicted: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return measured minus predicted per run, NaN where not measured."""
        return [run.temperature_c - p for run, p in zip(self.runs, predicted, strict=True)]

    def vector(self, fields: Sequence[np.ndarray], weights: Sequence[np.ndarray] | None = None) -> np.ndarray:
        """Return fields (per run, degC) as one vector in units of the noise, starts whitened out."""
        pieces = []
        for r, (value, mask, noise) in enumerate(zip(fields, self.mask, self.noise, strict=True)):
            piece = (value / noise)[mask]
            basis = self.basis[r]
            if weights is not None:
                piece = piece * weights[r][mask]
            if basis is not None:
                piece = piece - basis @ (basis.T @ piece)
            pieces.append(piece)
        return np.concatenate(pieces)

    def plain(self, residual: Sequence[np.ndarray]) -> float:
        """Return the sum of squared residuals in units of the noise."""
        return sum(
            float((((left / noise)[mask]) ** 2).sum())
            for left, noise, mask in zip(residual, self.noise, self.mask, strict=True)
        )

    def learn_starts(self, spec: Spec, values: Sequence[float]) -> None:
        """Find how an error of each starting temperature dies out, to keep it out of all that follows.

        A simulation starts at the first measured temperatures, which carry the sensor's noise. Its effect is
        nearly linear and the same in all models: it is computed once, and residuals are whitened by it.
        """
        jobs = []
        for r, run in enumerate(self.runs):
            jobs.append((r, np.zeros(run.springs)))
            for k in range(run.springs):
                jobs.append((r, np.eye(run.springs)[k]))
        shown = list(self.pool.map(lambda job: self.simulate(spec, values, job[0], job[1]), jobs))
        at = 0
        for r, run in enumerate(self.runs):
            base = shown[at]
            columns = []
            for k in range(run.springs):
                response = ((shown[at + 1 + k] - base) / self.noise[r])[self.mask[r]]
                response = response * self.noise[r][k]
                if np.isfinite(run.temperature_c[0, k]) and np.linalg.norm(response) > 1:
                    columns.append(response)
            at += 1 + run.springs
            if columns:
                # whitening by the covariance 1 + S S', S the response to one sigma of each start
                u, size, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
                self.basis[r] = u * np.sqrt(1.0 - 1.0 / np.sqrt(1.0 + size**2))
                self.start_response[r] = np.column_stack(columns)

    def without_starts(self, residual: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return residuals less what errors of the first readings, as large as their noise makes them, leave in them.

        The errors are estimated with the noise as their spread and cut at 3 of it: a start that is further off is
        structure like any other.
        """
        out = []
        for left, mask, noise, response in zip(residual, self.mask, self.noise, self.start_response, strict=True):
            left = left.copy()
            if response is not None:
                scaled = (left / noise)[mask]
                normal = response.T @ response + np.eye(response.shape[1])
                size = np.clip(np.linalg.solve(normal, response.T @ scaled), -3.0, 3.0)
                left[mask] -= (response @ size) * np.broadcast_to(noise, mask.shape)[mask]
            out.append(left)
        return out

    # ---- fitting ----------------------------------------------------------------------------------------

    def jacobian(
        self,
        spec: Spec,
        values: np.ndarray,
        predicted: Sequence[np.ndarray],
        weights: Sequence[np.ndarray] | None = None,
        columns: Sequence[int] | None = None,
    ) -> np.ndarray:
        """Return d(residual vector)/d(inner coordinate) by one-sided differences, simulated in parallel."""
        columns = range(len(spec.free)) if columns is None else columns
        jobs: list[tuple[Spec, Sequence[float], int]] = []
        where: list[tuple[int, int, float]] = []
        for c in columns:
            free = spec.free[c]
            z = free.inner(values[c])
            step = free.slope_step
            if z + step > free.inner(free.high):
                step = -step
            moved = values.copy()
            moved[c] = free.outer(z + step)
            step = free.inner(moved[c]) - z
            for r in range(len(self.runs)):
                if free.run is None or free.run == r:
                    jobs.append((spec, moved, r))
                    where.append((c, r, step))
        shown = self.simulate_many(jobs) if jobs else []
        out = np.zeros((self.count, len(list(columns))))
        position = {c: k for k, c in enumerate(columns)}
        fields: dict[int, list[np.ndarray]] = {}
        for (c, r, step), field_c in zip(where, shown, strict=True):
            fields.setdefault(c, [np.zeros_like(p) for p in predicted])[r] = -(field_c - predicted[r]) / step
        for c, change in fields.items():
            out[:, position[c]] = self.vector(change, weights)
        return out

    def fit(
        self,
        spec: Spec,
        start: Mapping[str, float] | None = None,
        *,
        tolerance: float = 1e-4,
        max_steps: int = 25,
        weights: Sequence[np.ndarray] | None = None,
        errors: bool = False,
    ) -> Fit:
        """Fit the spec's free numbers by bounded least squares. `start` overrides starting values by key."""
        begun = self.simulations
        free = list(spec.free)
        values = np.array([(start or {}).get(f.key, f.start) for f in free], dtype=float)
        values = np.array([min(f.high, max(f.low, v)) for f, v in zip(free, values, strict=True)], dtype=float)
        if not free:
            predicted = self.predictions(spec, values)
            left = self.residuals(predicted)
            vector = self.vector(left, weights)
            return Fit(
                spec,
                values,
                float(vector @ vector),
                self.count,
                left,
                np.zeros((self.count, 0)),
                vector,
                np.zeros((0, 0)),
                sse=self.plain(left),
            )
        low = np.array([f.inner(f.low) for f in free])
        high = np.array([f.inner(f.high) for f in free])
        cache: dict[bytes, tuple[list[np.ndarray], np.ndarray]] = {}

        def outer(z: np.ndarray) -> np.ndarray:
            return np.array([f.outer(one) for f, one in zip(free, z, strict=True)])

        def run(z: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
            key = z.tobytes()
            if key not in cache:
                shown = self.predictions(spec, outer(z))
                cache[key] = (shown, self.vector(self.residuals(shown), weights))
                if len(cache) > 4:
                    cache.pop(next(iter(cache)))
            return cache[key]

        def slope(z: np.ndarray) -> np.ndarray:
            return self.jacobian(spec, outer(z), run(z)[0], weights)

        z0 = np.array([f.inner(v) for f, v in zip(free, values, strict=True)])
        margin = 1e-6 * (high - low)
        z0 = np.clip(z0, low + margin, high - margin)
        found = least_squares(
            lambda z: run(z)[1],
            z0,
            jac=slope,
            bounds=(low, high),
            x_scale="jac",
            ftol=tolerance,
            xtol=1e-6,
            gtol=1e-10,
            max_nfev=max_steps,
        )
        z, jac = found.x, found.jac
        shown, vector = run(z)
        fit = Fit(
            spec,
            outer(z),
            float(vector @ vector),
            self.count,
            self.residuals(shown),
            jac,
            vector,
        )
        fit.sse = self.plain(fit.residual)
        norms = np.linalg.norm(jac, axis=0)
        span = np.where([f.log for f in free], 0.5, 1.0)
        fit.stuck = [f.key for f, norm, one in zip(free, norms, span, strict=True) if norm * one < 1.0]
        if errors:
            self.add_errors(fit)
        fit.simulations = self.simulations - begun
        return fit

    def holdout_rmse(self, fit: Fit) -> float:
        """Return the rms error, degC, on blocks held out of the fit, one fold after the other.

        Every fifth block of about two minutes is left out, the numbers are fitted to the rest from where they
        were, and the whole run is simulated with them: the error counts where they have not seen the data.
        """
        if not len(fit.values):
            return statistics.rms(fit.residual)
        if math.isfinite(fit.holdout):
            return fit.holdout
        total, count = 0.0, 0
        rows = [fold_of_rows(run) for run in self.runs]
        for fold in range(FOLDS):
            out = [one == fold for one in rows]
            weights = [
                np.broadcast_to(~o[:, None], mask.shape).astype(float) for o, mask in zip(out, self.mask, strict=True)
            ]
            again = self.fit(fit.spec, fit.as_dict(), weights=weights, tolerance=1e-3, max_steps=4)
            for residual, o in zip(again.residual, out, strict=True):
                total += float(np.nansum(residual[o] ** 2))
                count += int(np.isfinite(residual[o]).sum())
        fit.holdout = math.sqrt(total / max(1, count))
        return fit.holdout

    def add_errors(self, fit: Fit) -> None:
        """Compute the covariance at the fit, with the residual's size and autocorrelation taken into account.

        A sandwich: J'J inverse around the long-run covariance of J'r over blocks in time (all springs of a block
        together), never less than what white noise alone would give.
        """
        predicted = [run.temperature_c - left for run, left in zip(self.runs, fit.residual, strict=True)]
        shown = self.predictions(fit.spec, fit.values) if predicted else []
        jac = self.jacobian(fit.spec, fit.values, shown)
        fit.jacobian = jac
        used = [k for k, f in enumerate(fit.spec.free) if f.key not in fit.stuck]
        covariance = np.full((jac.shape[1], jac.shape[1]), 0.0)
        fit.factor = statistics.correlation_factor(
            [left / noise for left, noise in zip(fit.residual, self.noise, strict=True)],
            self.longest_lag(),
        )
        if used:
            inner = np.linalg.pinv(jac[:, used].T @ jac[:, used], rcond=1e-12)
            spread = max(1.0, fit.chi2 / max(1, fit.count - len(used)))
            white = inner * spread
            blocks = self._block_of_samples()
            score = np.zeros((blocks.max() + 1, len(used)))
            vector = fit.vector if fit.vector is not None else self.vector(fit.residual)
            np.add.at(score, blocks, jac[:, used] * vector[:, None])
            few = len(score)
            meat = score.T @ score * (few / max(1.0, few - 1.0))
            robust = inner @ meat @ inner
            ratio = np.sqrt(np.maximum(1.0, np.diag(robust) / np.maximum(np.diag(white), 1e-300)))
            # Blocks say nothing better than white noise does where the residual is white: use them only
            # where autocorrelation is there.
            if fit.factor < 1.5:
                ratio = np.ones_like(ratio)
            covariance[np.ix_(used, used)] = white * np.outer(ratio, ratio)
        fit.covariance = covariance

    def longest_lag(self) -> int:
        """Return the number of lags worth summing: a fifth of the shortest run, at most 300."""
        return int(min(300, min(len(run.time_s) for run in self.runs) // 5))

    def _block_of_samples(self) -> np.ndarray:
        """Return the block number of every sample of the residual vector: 20 blocks in time a run."""
        out, base = [], 0
        for run, mask in zip(self.runs, self.mask, strict=True):
            rows = np.broadcast_to((np.arange(len(run.time_s)) * 20 // len(run.time_s))[:, None], mask.shape)
            out.append(rows[mask] + base)
            base += 20
        return np.concatenate(out)


def simulate_run(
    plant: native.Plant,
    run: Run,
    ambient: np.ndarray | None,
    values: Mapping[str, float],
    start_offset: np.ndarray | None = None,
) -> np.ndarray:
    """Simulate one log as section 4 says: from its first measured temperatures (ambient where none).

    After a gap the springs start again from what was measured there; air and plate carry on.
    Air and plate start at ambient, or, where the run begins warm and steady, in balance with its first inputs.
    """
    if ambient is not None:
        plant.set_ambient(float(ambient[0]))
    plant.set_fan(float(run.fan[0]))
    plant.reset()
    mode = native.MODES[run.mode]
    first = run.temperature_c[0].copy()
    if run.warm:
        for k in range(run.springs):
            plant.drive(k, mode, float(run.drive[0, k]))
        # a drifting ambient has no balance: it begins at the run's first row
        plant.settle_without("ambient_drift", 1e6)
    plant.start_from_measured(first + (0.0 if start_offset is None else start_offset))
    if len(run.starts) == 1:
        return plant.simulate(run.time_s, mode, run.drive, run.fan, ambient)
    out = np.empty_like(run.temperature_c)
    bounds = [*run.starts, len(run.time_s)]
    for piece, (begin, end) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        if piece:
            across = slice(begin - 1, begin + 1)
            plant.simulate(
                run.time_s[across],
                mode,
                run.drive[across],
                run.fan[across],
                None if ambient is None else ambient[across],
            )
            plant.start_from_measured(run.temperature_c[begin])
        part = slice(begin, end)
        if end - begin == 1:
            out[part] = plant.measured_c()
            continue
        out[part] = plant.simulate(
            run.time_s[part],
            mode,
            run.drive[part],
            run.fan[part],
            None if ambient is None else ambient[part],
        )
    return out


def array_parameters(array: Array) -> dict[str, float]:
    """Return the plant's parameters that follow from array.toml: the host tools' rules (docs/files.md)."""
    material, spring = array.material, array.spring
    out = {
        key: value for key, value in material.items() if key == "emissivity" or key.endswith(("_start_c", "_finish_c"))
    }
    if not material and not spring:
        return out
    wire_mm = spring.get("wire_diameter_mm", 0.8)
    length_mm = 110.0
    if "coil_diameter_mm" in spring or "turns" in spring:
        length_mm = math.pi * spring.get("coil_diameter_mm", 3.45) * spring.get("turns", 10.0)
    length_mm = spring.get("wire_length_mm", length_mm)
    section_mm2 = math.pi / 4.0 * wire_mm**2
    mass_kg = section_mm2 * length_mm * 1e-9 * material.get("density_kg_per_m3", 6450.0)
    ohm = 1e-5 * length_mm / section_mm2
    austenite = ohm * material.get("resistivity_austenite_uohm_cm", 100.0)
    return out | {
        "wire_diameter_mm": wire_mm,
        "surface_mm2": math.pi * wire_mm * length_mm,
        "heat_capacity_j_per_k": mass_kg * material.get("heat_capacity_j_per_kgk", 840.0),
        "latent_heat_j": mass_kg * material.get("latent_heat_j_per_kg", 24200.0),
        "resistance_martensite_ohm": ohm * material.get("resistivity_martensite_uohm_cm", 80.0),
        "resistance_austenite_ohm": austenite,
        "resistance_ohm": austenite,
    }
