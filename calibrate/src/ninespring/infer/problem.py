"""Runs to be explained by an array: parallel simulations, bounded least squares, standard errors.

A `Spec` says what a model is; a `Problem` holds the runs and simulates them; `Problem.fit` returns a `Fit`.
All residuals are measured minus model, degC.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear

from ..io import statistics
from ..io.logs.run import Run
from ..model import native
from ..model.effects import alloy
from ..model.models import Array
from ..model.simulate import array_parameters, fades_per_s, hidden_k, simulate_run
from ..model.spec import AMBIENT_OFFSET, AROUND_SHARE, DRIVE_GAIN, RUN_DRIVE, SENSOR_OFFSET, Spec, Values
from .budget import Budget
from .descent import Descent, Shown
from .fit import Fit
from .likelihood import Colour, Rows
from .rounding import power_errors

WORKERS = max(1, min(8, os.cpu_count() or 1))
_BAD = 1e3
"""What a simulation that the plant refuses 'shows', degC: so far off that no fit goes there."""


FINEST_C = 0.005
"""What any reading is right to, at best."""
RIGHT_TO = 1e-3
"""Part of a spring's rise that a model is right to, at best: heat is logged with three digits, and the laws of lumps are no better.
What is finer is no evidence, however fine thermometers are."""
FOLDS = 5
BLOCK_S = 150.0
"""Length of a held-out block: longer than the residual remembers, shorter than a drift of the ambient."""


HARDLY = 0.1
"""Part of what all readings tell of a number (its information) below which some of them leave it as all had it."""
FIRM = 1e3
"""How many times as firmly as by all of them."""
SLOW_KNOTS = 5
"""Knots of a slow drift of the ambient over a run, the first of them zero."""


def _hats(run: Run, knots: np.ndarray) -> np.ndarray:
    """Return smooth unit bumps around each knot but the first, (rows, knots - 1)."""
    return CubicSpline(knots, np.eye(len(knots)), bc_type="natural")(run.time_s)[:, 1:]


def fold_of_rows(run: Run) -> np.ndarray:
    """Return the fold (0..FOLDS-1) of every row: blocks of BLOCK_S, or of a fifth of a short run, in turn."""
    block = min(BLOCK_S, run.duration_s / FOLDS)
    return ((run.time_s - run.time_s[0]) // max(block, 1e-9)).astype(int) % FOLDS


class Problem:
    """Runs to be explained by an array. Holds what does not depend on the model."""

    reads_ohm = False
    """Whether the readings are the springs' own resistances, no temperatures."""

    def __init__(self, array: Array, runs: Sequence[Run], declared: Mapping[str, float] | None = None) -> None:
        array.one_layer("fit and diagnose know")
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
        self.rounding = [
            statistics.rounding(run.temperature_c, run.starts) if run.rounding_c is None else run.rounding_c
            for run in self.runs
        ]
        self.right_to = [np.maximum(FINEST_C, RIGHT_TO * statistics.rises(run.temperature_c)) for run in self.runs]
        """What a model is right to at best in each run, (springs,), degC."""
        self._tidy_noise()
        self.colour: Colour | None = None
        self._rows: list[Rows] | None = None
        self.mask = [np.isfinite(run.temperature_c) for run in self.runs]
        self.count = int(sum(mask.sum() for mask in self.mask))
        self.basis: list[np.ndarray | None] = [None] * len(self.runs)
        self.start_response: list[np.ndarray | None] = [None] * len(self.runs)
        self.power_response: list[np.ndarray | None] = [None] * len(self.runs)
        self.unnamed: np.ndarray | None = None
        self.heat: list[np.ndarray] | None = None
        self._pool = concurrent.futures.ThreadPoolExecutor(WORKERS) if WORKERS > 1 else None
        self.budget = Budget()
        base = native.Plant(array.rows, array.cols)
        base.set_all(array_parameters(array))
        base.set_all(self.declared)
        self._base = base
        self._plants: dict[Any, native.Plant] = {}
        """With effects on, by which and what is fixed with them."""

    def base_value(self, name: str) -> float:
        """Return what the declared array has for a parameter of the plant."""
        return self._base.get(name)

    @property
    def simulations(self) -> int:
        """Simulations of a run so far."""
        return self.budget.taken

    @property
    def hottest_c(self) -> float:
        """Highest temperature that was measured."""
        return max(float(np.nanmax(run.temperature_c)) for run in self.runs)

    def _tidy_noise(self) -> None:
        """A column too short or too clean to estimate takes the median of the others; what its steps leave, and what a model is right
        to, at least."""
        everything = np.concatenate(self.noise)
        usable = everything[np.isfinite(everything) & (everything > 0)]
        usual = float(np.median(usable)) if usable.size else 0.05
        self.noise = [
            np.maximum(np.maximum(np.where(np.isfinite(one), one, usual), np.maximum(right, 0.2 * usual)), steps)
            for one, steps, right in zip(self.noise, self.rounding, self.right_to, strict=True)
        ]

    @property
    def least(self) -> float:
        """Variance, in units of the noise's, of what no model explains: the least that is white in what one leaves."""
        return float(np.mean(self.of_samples([(a / b) ** 2 for a, b in zip(self.right_to, self.noise, strict=True)])))

    @property
    def noise_c(self) -> float:
        """Noise floor over everything measured, degC rms."""
        return math.sqrt(float((self.of_samples(self.noise) ** 2).sum()) / max(1, self.count))

    def mask_spikes(self, residual: Sequence[np.ndarray]) -> int:
        """Leave isolated outliers of a residual out of everything that follows; return how many."""
        total = 0
        for r, (run, mask, noise, left) in enumerate(zip(self.runs, self.mask, self.noise, residual, strict=True)):
            bad = statistics.spikes(left, noise)
            bad[run.starts] = False  # the simulation starts from them
            share = bad.mean() if bad.size else 0.0
            if 0 < share < 0.02:
                # the log stays as it is: another problem of it finds what this one found
                self.runs[r] = replace(run, temperature_c=np.where(bad, np.nan, run.temperature_c))
                mask &= ~bad
                total += int(bad.sum())
        self.count = int(sum(mask.sum() for mask in self.mask))
        self._rows = None
        return total

    @property
    def rows(self) -> list[Rows]:
        """Return the runs' rows as a filter of what is left walks them."""
        if self._rows is None:
            self._rows = [Rows.of(run.time_s, run.starts, mask) for run, mask in zip(self.runs, self.mask, strict=True)]
        return self._rows

    @contextlib.contextmanager
    def as_white(self) -> Iterator[None]:
        """Take errors for white noise meanwhile, those of the first readings too."""
        kept = self.colour, self.basis
        self.colour, self.basis = None, [None] * len(self.runs)
        try:
            yield
        finally:
            self.colour, self.basis = kept

    def take_for(self, colour: Colour | None) -> None:
        """Weigh all that follows by how errors last; None: as white noise."""
        self.colour = colour
        self._start_bases()

    @property
    def weighed(self) -> Colour | str | None:
        """Return how readings are weighed: by how errors last; None: as white noise; beside what has no name."""
        return self.colour if self.unnamed is None and self.heat is None else "beside what has no name"

    # ---- simulation -------------------------------------------------------------------------------------

    def ambient_of(self, run_index: int, values: Mapping[str, float]) -> np.ndarray | None:
        """Return the run's ambient (rows,) with fitted constants and knots, None where nothing says any."""
        run = self.runs[run_index]
        constant = values.get(f"ambient_c@{run_index + 1}")
        ambient = run.ambient_c
        if ambient is None and constant is not None:
            ambient = np.full(len(run.time_s), constant)
        if ambient is not None:
            ambient = ambient + values.get(f"{AMBIENT_OFFSET}@{run_index + 1}", values.get(AMBIENT_OFFSET, 0.0))
        for name, hats in self.hats.items():
            prefix = f"{name}@{run_index + 1}."
            if f"{prefix}1" not in values:
                continue
            drift = [values.get(f"{prefix}{k}", 0.0) for k in range(1, hats[run_index].shape[1] + 1)]
            if any(drift):
                if ambient is None:
                    ambient = np.full(len(run.time_s), self._base.get("ambient_c"))
                ambient = ambient + hats[run_index] @ np.asarray(drift)
        return ambient

    def plant_for(self, spec: Spec, values: Values, run_index: int | None = None) -> native.Plant:
        """Return a fresh plant with the spec's effects and values, commands as strong as in a run where one is given.

        An alloy that is shut is refused as the plant would refuse it.
        """
        settings = spec.settings(values, self._base.get)
        if alloy.shut(settings):
            raise native.NativeError(native.OUTSIDE, "the alloy's loop")
        is_on = spec.plant_effects, spec.fixed
        if is_on not in self._plants:
            plant = self._base.copy()
            plant.set_effects(spec.plant_effects)
            plant.set_all(dict(spec.fixed))
            self._plants[is_on] = plant
        plant = self._plants[is_on].copy()
        plant.set_all(settings)
        if run_index is not None and self.runs[run_index].mode == "command" and RUN_DRIVE in spec.effects:
            gain = dict(zip((f.key for f in spec.free), values, strict=True))[f"{DRIVE_GAIN}@{run_index + 1}"]
            for k in range(self.runs[run_index].springs):
                plant.set(f"command_power_w[{k + 1}]", gain * plant.get(f"command_power_w[{k + 1}]"))
        return plant

    def begun(self, run_index: int, values: Mapping[str, float]) -> Run:
        """Return a run as it was read, with what was around its springs as warm as these numbers have it."""
        run, share = self.runs[run_index], values.get(f"{AROUND_SHARE}@{run_index + 1}")
        return run if share is None else replace(run, around_share=share)

    def run_of(self, run_index: int, values: Mapping[str, float]) -> Run:
        """Return a run with what is its own put right: driven as strongly as it was, read as if nothing were off.

        A command's strength is the plant's (`plant_for`).
        """
        run = self.begun(run_index, values)
        gain = values.get(f"{DRIVE_GAIN}@{run_index + 1}", 1.0)
        off_k = values.get(f"{SENSOR_OFFSET}@{run_index + 1}", 0.0)
        if gain != 1.0 and run.mode != "command":
            run = replace(run, drive=run.drive * (gain if run.mode == "power" else math.sqrt(gain)))
        return replace(run, temperature_c=run.temperature_c - off_k) if off_k else run

    def heated(self, run: Run, run_index: int) -> Run:
        """Return a run with the heat that its springs are given without a name, or that is taken away."""
        return run if self.heat is None else replace(run, drive=run.drive + self.heat[run_index])

    def simulate(
        self,
        spec: Spec,
        values: Values,
        run_index: int,
        start_offset: np.ndarray | None = None,
        power_w: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return what the sensors of one run should show, (rows, springs), degC; with so much more power than was logged."""
        self.budget.take()
        by_key = {f.key: float(v) for f, v in zip(spec.free, values, strict=True)}
        run = self.heated(self.run_of(run_index, by_key), run_index)
        if power_w is not None:
            run = replace(run, drive=run.drive + power_w)
        try:
            plant = self.plant_for(spec, values, run_index)
            shown = simulate_run(plant, run, self.ambient_of(run_index, by_key), start_offset)
            return shown + by_key.get(f"{SENSOR_OFFSET}@{run_index + 1}", 0.0)
        except native.NativeError:
            return np.full(run.temperature_c.shape, _BAD)

    def simulate_many(self, jobs: Sequence[tuple[Spec, Values, int]]) -> list[np.ndarray]:
        """Simulate (spec, values, run) jobs in parallel threads."""
        return self.each(lambda job: self.simulate(*job), jobs)

    def each(self, make: Callable[[Any], Any], jobs: Sequence[Any]) -> list[Any]:
        """Return what each job makes, in parallel threads where there are several of both."""
        if self._pool is None or len(jobs) == 1:
            return [make(job) for job in jobs]
        return list(self._pool.map(make, jobs))

    def predictions(self, spec: Spec, values: Values) -> list[np.ndarray]:
        """Return what all runs should show."""
        return self.simulate_many([(spec, values, r) for r in range(len(self.runs))])

    def predictions_without(self, fit: Fit, effect: str) -> list[np.ndarray]:
        """Return what all runs should show with one effect of a fit switched off and every other number as it is."""
        off = fit.spec.without(effect)
        return self.predictions(off, [fit.value(free.key) for free in off.free])

    # ---- residuals --------------------------------------------------------------------------------------

    def residuals(self, predicted: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return measured minus predicted per run less what unnamed causes take up, NaN where not measured."""
        out = [run.temperature_c - p for run, p in zip(self.runs, predicted, strict=True)]
        if self.unnamed is None:
            return out
        taken = self.by_run(self.unnamed @ (self.unnamed.T @ np.concatenate(self.scaled(out))))
        for left, mask, noise, part in zip(out, self.mask, self.noise, taken, strict=True):
            left[mask] -= part * np.broadcast_to(noise, mask.shape)[mask]
        return out

    def scaled(self, fields: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return what is measured of fields (per run, degC), in units of the noise, one vector a run."""
        return [(value / noise)[mask] for value, mask, noise in zip(fields, self.mask, self.noise, strict=True)]

    def leave_out(self, columns: np.ndarray | None, heat: list[np.ndarray] | None = None) -> None:
        """Take what these columns (count, causes) can explain out of all that follows; None: take nothing out.

        Around `heat`, where it is given: per run (rows, springs), W, which is simulated beside what was logged.
        """
        self.unnamed = None if columns is None or not columns.size else np.linalg.qr(columns)[0]
        self.heat = heat

    def evaluate(self, fit: Fit) -> Fit:
        """Return a fit's numbers with what they leave here, nothing fitted again."""
        left = self.residuals(self.predictions(fit.spec, fit.values))
        vector = self.vector(left)
        return replace(
            fit,
            chi2=float(vector @ vector),
            residual=left,
            vector=vector,
            sse=self.plain(left),
            factor=math.nan,
            colour=None,
            nats=math.nan,
            holdout=math.nan,
        )

    def vector(self, fields: Sequence[np.ndarray]) -> np.ndarray:
        """Return fields (per run, degC) as one vector in units of the noise, starts whitened out."""
        return self.vectors([fields])[0]

    def vectors(self, several: Sequence[Sequence[np.ndarray | None]]) -> np.ndarray:
        """Return several fields (per run, degC; None: zero) as vectors, (fields, count): together, which is far quicker."""
        out = np.zeros((len(several), self.count))
        for row, fields in zip(out, several, strict=True):
            parts = zip(self.by_run(row), fields, self.mask, self.noise, strict=True)
            for part, field, mask, noise in parts:
                if field is not None:
                    part[:] = (field / noise)[mask]
        if self.unnamed is not None:
            out -= (out @ self.unnamed) @ self.unnamed.T
        return self._whitened(self.filtered(out.T)).T

    def by_run(self, columns: np.ndarray) -> list[np.ndarray]:
        """Return columns (count, ...) as one piece a run, views of them."""
        return np.split(columns, np.cumsum([int(mask.sum()) for mask in self.mask])[:-1])

    def of_samples(self, values: Sequence[np.ndarray]) -> np.ndarray:
        """Return what is so per run, of each row (rows, 1) or spring (springs,), for each sample, (count,)."""
        return np.concatenate([np.broadcast_to(v, m.shape)[m] for v, m in zip(values, self.mask, strict=True)])

    def filtered(self, columns: np.ndarray) -> np.ndarray:
        """Return columns (count, n), in units of the noise, as innovations of a filter that knows how errors last, if any is known."""
        if self.colour is None:
            return columns
        parts = zip(self.rows, self.by_run(columns), strict=True)
        return np.concatenate([rows.whitened(part, self.colour)[0] for rows, part in parts])

    def _whitened(self, columns: np.ndarray, back: bool = False) -> np.ndarray:
        """Return columns (count, n) with errors of the first readings whitened out, or `back` from there."""
        out = columns.copy()
        for part, basis in zip(self.by_run(out), self.basis, strict=True):
            if basis is not None:
                left = 1.0 - (basis**2).sum(axis=0)
                part += (basis / left if back else -basis) @ (basis.T @ part)
        return out

    def plain(self, residual: Sequence[np.ndarray]) -> float:
        """Return the sum of squared residuals in units of the noise."""
        return sum(float((part**2).sum()) for part in self.scaled(residual))

    def learn_starts(self, spec: Spec, values: Values) -> None:
        """Find how an error of each starting temperature dies out, to keep it out of all that follows.

        A simulation starts at the first measured temperatures, which carry the sensor's noise and hide what a spring was about.
        The effect is nearly linear and the same in all models: it is computed once, and residuals are whitened by it.
        """
        jobs = []
        for r, run in enumerate(self.runs):
            jobs.append((r, np.zeros(run.springs)))
            for k in range(run.springs):
                jobs.append((r, np.eye(run.springs)[k]))
        shown = self.each(lambda job: self.simulate(spec, values, job[0], job[1]), jobs)
        plant = self.plant_for(spec, values)
        at = 0
        for r, run in enumerate(self.runs):
            base = shown[at]
            ambient = self.ambient_of(r, {f.key: float(v) for f, v in zip(spec.free, values, strict=True)})
            around_c = plant.get("ambient_c") if ambient is None else float(ambient[0])
            sigma = np.hypot(self.noise[r], hidden_k(run, around_c, fades_per_s(plant)))
            columns = []
            for k in range(run.springs):
                response = ((shown[at + 1 + k] - base) / self.noise[r])[self.mask[r]]
                response = response * sigma[k]
                if np.isfinite(run.temperature_c[0, k]) and np.linalg.norm(response) > 1:
                    columns.append(response)
            at += 1 + run.springs
            if columns:
                self.start_response[r] = np.column_stack(columns)
        self._start_bases()

    def _start_bases(self) -> None:
        """Find what whitens errors of the first readings out: by the covariance 1 + S S', S the response to one sigma of each."""
        for r, (rows, response) in enumerate(zip(self.rows, self.start_response, strict=True)):
            if response is not None:
                white = response if self.colour is None else rows.whitened(response, self.colour)[0]
                u, size, _ = np.linalg.svd(white, full_matrices=False)
                self.basis[r] = u * np.sqrt(1.0 - 1.0 / np.sqrt(1.0 + size**2))

    def learn_power(self, spec: Spec, values: Values) -> None:
        """Find what rounding of the voltages leaves in each run: to keep it out of what is judged."""
        plant = self.plant_for(spec, values)
        holds, loses = plant.get("heat_capacity_j_per_k"), plant.get("loss_w_per_k")
        for r, run in enumerate(self.runs):
            if errors := power_errors(run, holds, loses, self.noise[r]):
                base, *shown = self.each(
                    lambda job: self.simulate(spec, values, *job), [(r, None, more) for more in (None, *errors)]
                )
                self.power_response[r] = np.column_stack(
                    [((one - base) / self.noise[r])[self.mask[r]] for one in shown]
                )

    def without_errors(self, residual: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return residuals less what errors of the first readings and of rounded voltages leave in them.

        They are estimated with the noise, or what rounding leaves, as their spread and cut at 3 of the noise and at half a
        step: what is further off is structure like any other.
        """
        out = []
        for left, mask, noise, *known in zip(
            residual, self.mask, self.noise, self.start_response, self.power_response, strict=True
        ):
            left = left.copy()
            of_each = [(one, most) for one, most in zip(known, (3.0, math.sqrt(3.0)), strict=True) if one is not None]
            if of_each:
                response = np.column_stack([one for one, _ in of_each])
                most = np.concatenate([np.full(one.shape[1], limit) for one, limit in of_each])
                scaled = (left / noise)[mask]
                normal = response.T @ response + np.eye(response.shape[1])
                size = np.clip(np.linalg.solve(normal, response.T @ scaled), -most, most)
                left[mask] -= (response @ size) * np.broadcast_to(noise, mask.shape)[mask]
            out.append(left)
        return out

    def alike(self, left: Sequence[np.ndarray]) -> float:
        """Return how many readings of what a model leaves, per run (rows, springs) in units of the noise, carry what one of its
        own would."""
        if self.colour is not None:
            return 1.0  # innovations are white
        return statistics.correlation_factor(left, self.longest_lag())

    def in_place(self, vector: np.ndarray) -> list[np.ndarray]:
        """Return a vector (count,) as it was read, per run (rows, springs); nan where nothing counts."""
        fields = [np.full(mask.shape, np.nan) for mask in self.mask]
        for field, mask, part in zip(fields, self.mask, self.by_run(vector), strict=True):
            field[mask] = part
        return fields

    # ---- fitting ----------------------------------------------------------------------------------------

    def jacobian(
        self, spec: Spec, values: np.ndarray, predicted: Sequence[np.ndarray], columns: Sequence[int] | None = None
    ) -> np.ndarray:
        """Return d(residual vector)/d(inner coordinate) by one-sided differences, simulated in parallel."""
        columns = range(len(spec.free)) if columns is None else columns
        jobs: list[tuple[Spec, Values, int]] = []
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
        position = {c: k for k, c in enumerate(columns)}
        changes: list[list[np.ndarray | None]] = [[None] * len(self.runs) for _ in position]
        for (c, r, step), field_c in zip(where, shown, strict=True):
            changes[position[c]][r] = (predicted[r] - field_c) / step
        return self.vectors(changes).T

    def fit(
        self,
        spec: Spec,
        start: Mapping[str, float] | None = None,
        *,
        tolerance: float = 1e-4,
        max_steps: int = 25,
        errors: bool = False,
        near: Fit | None = None,
        settle: bool = True,
    ) -> Fit:
        """Fit the spec's free numbers by bounded least squares. `start` overrides starting values by key.

        A column of the slope is simulated again only where the numbers have moved by REUSED since: a slope that is a few
        hundredths off changes the way to the minimum, not the minimum. `near` is a fit whose slopes serve to begin with.
        Without `settle` it may end before the minimum: for what is only begun. It then has no slopes for another to begin with.
        """
        free = list(spec.free)
        values = np.array([(start or {}).get(f.key, f.start) for f in free], dtype=float)
        values = np.array([min(f.high, max(f.low, v)) for f, v in zip(free, values, strict=True)], dtype=float)
        if not free:
            slopes, covariance = np.zeros((self.count, 0)), np.zeros((0, 0))
            bare = Fit(spec, values, math.nan, self.count, [], slopes, self.weighed, covariance=covariance)
            return self.evaluate(bare)

        def show(numbers: np.ndarray) -> Shown:
            shown = self.predictions(spec, numbers)
            return shown, self.vector(self.residuals(shown))

        way = Descent(
            free,
            show,
            lambda numbers, shown, columns: self.jacobian(spec, numbers, shown, columns),
            lambda vector: self.alike(self.in_place(vector)),
        )
        if near is not None and near.jacobian is not None and len(near.jacobian) == self.count:
            way.begin_near(near)
        found = way.to_minimum(values, tolerance, max_steps, settle)
        jac = found.jac[: self.count]
        shown, vector = way.shown(found.x)
        fit = Fit(
            spec,
            way.outer(found.x),
            float(vector @ vector),
            self.count,
            self.residuals(shown),
            jac if settle or not way.mended else None,
            self.weighed,
            vector,
            firm=way.firm,
        )
        fit.sse = self.plain(fit.residual)
        norms = np.linalg.norm(jac, axis=0)
        span = np.where([f.log for f in free], 0.5, 1.0)
        fit.stuck = [f.key for f, norm, one in zip(free, norms, span, strict=True) if norm * one < 1.0]
        if errors:
            self.add_errors(fit)
        return fit

    def holdout_rmse(self, fit: Fit) -> float:
        """Return the rms error, degC, on blocks held out of the fit, one fold after the other.

        Every fifth block of about two minutes is left out, the numbers are fitted to the rest, and the error counts where
        they have not seen the data. They move little: by the fit's slopes, within their bounds, nothing simulated.
        """
        if not len(fit.values):
            return statistics.rms(fit.residual)
        if math.isfinite(fit.holdout):
            return fit.holdout
        free = fit.spec.free
        z = np.array([f.inner(v) for f, v in zip(free, fit.values, strict=True)])
        low, high = np.array([f.inner(f.low) for f in free]), np.array([f.inner(f.high) for f in free])
        trust = fit.firm * np.array([f.trust for f in free])
        believed = trust * (z - np.array([f.inner(f.start) for f in free]))
        slopes = self.plain_slopes(fit)
        left = np.concatenate(self.scaled(fit.residual))
        fold = self.of_samples([fold_of_rows(run)[:, None] for run in self.runs])
        noise = self.of_samples(self.noise)
        both = np.column_stack([slopes, left])
        weighed = both
        if self.colour is not None:  # as what lasts has them weighed
            weighed = np.column_stack([self.with_slopes(fit).jacobian, self.vector(fit.residual)])
        believed = np.column_stack([np.diag(trust), believed])

        def numbers(out: np.ndarray | None = None) -> np.ndarray:
            rows = weighed if out is None else np.where(out[:, None], 0.0, weighed)
            rows = rows if self.colour is not None else self._whitened(rows)
            return np.asarray(np.linalg.qr(np.vstack([rows, believed]), mode="r"))

        whole = numbers()[: len(z), :-1]
        back = np.linalg.pinv(whole)
        total = 0.0
        for number in range(FOLDS):
            out = fold == number
            inside = numbers(out)
            # in what only the block tells, as of a drive that is all in it, the rest leaves the numbers as they are
            _, told, ways = np.linalg.svd(inside[:, :-1] @ back)
            stays = FIRM * ways[told**2 < HARDLY] @ whole
            inside = np.vstack([inside, np.column_stack([stays, np.zeros(len(stays))])])
            bounds = (np.minimum(low - z, -1e-9), np.maximum(high - z, 1e-9))
            moved = lsq_linear(inside[:, :-1], -inside[:, -1], bounds, method="bvls").x
            total += float(((noise * (left + slopes @ moved))[out] ** 2).sum())
        fit.holdout = math.sqrt(total / max(1, self.count))
        return fit.holdout

    def slopes(self, fit: Fit, columns: Sequence[int] | None = None) -> np.ndarray:
        """Return d(residual vector)/d(inner coordinate) at a fit's numbers."""
        return self.jacobian(fit.spec, fit.values, self.predictions(fit.spec, fit.values), columns)

    def with_slopes(self, fit: Fit) -> Fit:
        """Return a fit with its slopes."""
        return fit if fit.jacobian is not None else replace(fit, jacobian=self.slopes(fit), weighed=self.weighed)

    def plain_slopes(self, fit: Fit) -> np.ndarray:
        """Return a fit's slopes with no error whitened out, (count, free)."""
        if fit.jacobian is not None and self.colour is None:
            return self._whitened(fit.jacobian, back=True)
        with self.as_white():
            return self.slopes(fit)

    def add_errors(self, fit: Fit) -> None:
        """Compute the covariance at the fit, with the residual's size and autocorrelation taken into account.

        A sandwich: J'J inverse around the long-run covariance of J'r over blocks in time (all springs of a block
        together), never less than what white noise alone would give.
        """
        jac = fit.jacobian = self.slopes(fit)
        fit.weighed = self.weighed
        used = [k for k, f in enumerate(fit.spec.free) if f.key not in fit.stuck]
        covariance = np.full((jac.shape[1], jac.shape[1]), 0.0)
        fit.factor = self.alike([left / noise for left, noise in zip(fit.residual, self.noise, strict=True)])
        if used:
            spread = max(1.0, fit.chi2 / max(1, fit.count - len(used)))
            trust = np.array([f.trust for f in fit.spec.free])[used]
            inner = np.linalg.pinv(jac[:, used].T @ jac[:, used] + spread * np.diag(trust**2), rcond=1e-12)
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
            for rows, part, response in zip(self.rows, self.by_run(jac[:, used]), self.power_response, strict=True):
                if response is not None:
                    if self.colour is not None:
                        response = rows.whitened(response, self.colour)[0]
                    moved = inner @ (part.T @ response)
                    covariance[np.ix_(used, used)] += moved @ moved.T
        fit.covariance = covariance

    def longest_lag(self) -> int:
        """Return the number of lags worth summing: a fifth of the shortest run, at most 300."""
        return int(min(300, min(len(run.time_s) for run in self.runs) // 5))

    def _block_of_samples(self) -> np.ndarray:
        """Return the block number of every sample of the residual vector: 20 blocks in time a run."""
        lengths = [len(run.time_s) for run in self.runs]
        return self.of_samples([20 * r + (np.arange(n) * 20 // n)[:, None] for r, n in enumerate(lengths)])
