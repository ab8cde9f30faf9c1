"""A fit without any thermometer: the springs' own resistance, v / i, says when each one transforms.

Each spring's transformation is a fixed point on its temperature scale, passed on heating and on cooling; a neighbour's heat
shows as an earlier crossing. So heat capacity, losses and couplings follow on the scale that the declared alloy gives: what
that scale is, and nothing else, only a thermometer can say.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..io.logs.branch import CROSSED
from ..io.logs.run import Run
from ..model import native
from ..model.models import Array, Model
from ..model.simulate import simulate_run
from ..model.spec import Free, Spec, Values
from .declared import base_spec
from .fit import Fit
from .problem import _BAD, Problem
from .result import model_of
from .rounding import ROUNDING_V, steady

NOISE_V = 2.0 * ROUNDING_V
"""What a voltage is told to, at best: rounding that stays the same is then never structure of half the noise."""
WEAK_EVERY = 10
"""Rows of which one counts while a spring's current is weak."""
LIKE_DECLARED = math.log(1.3)
"""What is believed of latent heat and of the phases' resistances: within a third of what is declared."""
ALIKE = 0.1
"""What is believed of the springs' resistances among each other."""
SCALE = (
    "temperatures are on the scale of the declared alloy: if it transforms elsewhere, or starts from another room, heat "
    "capacity, losses and couplings are off by as many per cent as that distance is; only a thermometer can say"
)


def has_none(runs: Sequence[Run]) -> bool:
    """Return whether these runs have currents and voltages but no temperature at all."""
    return all(run.voltage_v is not None and not np.isfinite(run.temperature_c).any() for run in runs)


def ohm_of(run: Run) -> np.ndarray:
    """Return v / i of a run, (rows, springs), ohm; NaN where it is no resistance."""
    assert run.current_a is not None and run.voltage_v is not None
    here = steady(run)
    return np.where(here, run.voltage_v / np.where(here, run.current_a, 1.0), np.nan)


class Resistances(Problem):
    """A problem whose readings are millivolts, not degrees: each spring's voltage less what its current would make of it cold.

    Everything else is as with thermometers. Volts, because what a board's reading is off by is the same at every current.
    """

    reads_ohm = True

    def __init__(self, array: Array, runs: Sequence[Run]) -> None:
        self.boards = list(runs)
        ohm = np.concatenate([ohm_of(run) for run in runs])
        current = np.concatenate([run.current_a for run in runs if run.current_a is not None])
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            # at small currents rounding is a good part of v / i
            strong = current > 0.5 * np.nanmax(np.where(np.isfinite(ohm), current, np.nan), axis=0)
            ohm = np.where(strong, ohm, np.nan)
            self.cold_ohm, self.hot_ohm = np.nanpercentile(ohm, 5, axis=0), np.nanpercentile(ohm, 98, axis=0)
            self.strong_a = np.nanmedian(np.where(np.isfinite(ohm), current, np.nan), axis=0)
        read = [replace(run, temperature_c=self._over_cold(self._told(run), run)) for run in runs]
        super().__init__(array, read)
        self.noise = [np.maximum(one, 1e3 * NOISE_V) for one in self.noise]

    @property
    def hottest_c(self) -> float:
        """How hot nobody measured: springs that have passed their transformation may show all that heat does."""
        return math.inf

    def _told(self, run: Run) -> np.ndarray:
        """Return v / i, one in WEAK_EVERY where a spring is only kept readable: there rounding is off by the same again and again."""
        assert run.current_a is not None
        weak = run.current_a <= 0.5 * self.strong_a
        weak[::WEAK_EVERY] = False
        return np.where(weak, np.nan, ohm_of(run))

    def _over_cold(self, ohm: np.ndarray, run: Run) -> np.ndarray:
        assert run.current_a is not None
        return 1e3 * run.current_a * (ohm - self.cold_ohm)

    def simulate(
        self,
        spec: Spec,
        values: Values,
        run_index: int,
        start_offset: np.ndarray | None = None,
        power_w: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return what the springs of one run should show, (rows, springs), mV; from cold, at the logged ambient."""
        run = self.boards[run_index]
        self.budget.take()
        try:
            plant = self.plant_for(spec, values)
            if run.ambient_c is not None:
                plant.set_ambient(float(run.ambient_c[0]))
            plant.set_fan(float(run.fan[0]))
            plant.reset()
            ohm = plant.readings(run.time_s, run.drive, run.fan, run.ambient_c)
            # a row's readings are means until the next
            return self._over_cold(0.5 * (ohm + np.concatenate([ohm[1:], ohm[-1:]])), run)
        except native.NativeError:
            return np.full(run.drive.shape, _BAD)


def fit(array: Array, runs: Sequence[Run]) -> tuple[Resistances, Fit, Fit]:
    """Fit the declared array to v / i; return the problem, the fit and how well the declared numbers did."""
    for run in runs:
        if run.ambient_c is None:
            raise InputError("without thermometers the room must be known: log ambient_c", run.name, 1)
        if len(run.starts) > 1:
            raise InputError("without thermometers nothing says how warm the springs are after a gap in time", run.name)
    problem = Resistances(array, runs)
    cold, rise = problem.cold_ohm, problem.hot_ohm - problem.cold_ohm
    # far beyond what rounding and noise make of so many readings
    seen = 8e-3 * np.max(problem.noise, axis=0) / problem.strong_a
    crossed = np.flatnonzero(rise > np.maximum(CROSSED * cold, seen))
    if not crossed.size:
        raise InputError(
            "no spring's v / i ever changes: without a thermometer each spring must pass its transformation, on heating and "
            "on cooling (drive it to 100 % and off again)",
            runs[0].name,
        )
    get = problem.base_value
    known = np.isfinite(cold)
    mean = float(np.mean(cold[known]))
    ratio = get("resistance_austenite_ohm") / get("resistance_martensite_ohm")

    def number(name: str, start: float, spread: float) -> Free:
        unit = native.parameter_table()[name.partition("[")[0]].unit
        return Free(name, start, 0.2 * start, 5.0 * start, unit, (name,), True, prior=spread)

    latent = replace(number("latent_heat_j", get("latent_heat_j"), LIKE_DECLARED), effect="latent_heat")
    spec = base_spec(problem).with_effect("latent_heat", [latent], (), "")
    wires = [number("resistance_martensite_ohm", mean, LIKE_DECLARED)]
    wires.append(number("resistance_austenite_ohm", mean * ratio, LIKE_DECLARED))
    wires += [number(f"resistance_scale[{k + 1}]", float(cold[k]) / mean, ALIKE) for k in np.flatnonzero(known)]
    wires = [replace(one, effect="resistance_phase") for one in wires]
    spec = spec.with_effect("resistance_phase", wires, (), "", ("spring_mismatch",))
    first = problem.fit(spec, tolerance=1e-2, max_steps=1)
    found = problem.fit(spec, tolerance=1e-4, max_steps=40)
    return problem, problem.fit(spec, found.as_dict(), tolerance=1e-6, max_steps=20, errors=True), first


def model_of_fit(problem: Resistances, found: Fit) -> Model:
    """Return the model.toml of such a fit; its provenance says whose scale its temperatures have."""
    plant = problem.plant_for(found.spec, found.values)
    shown = [replace(run, temperature_c=simulate_run(plant.copy(), run, run.ambient_c)) for run in problem.boards]
    model = model_of(problem, found, shown)
    del model.provenance["rmse_after_c"]
    model.provenance["note"] = SCALE
    return model
