"""A fit without any thermometer: the springs' own resistance, v / i, says when each one transforms.

Each spring's transformation is a fixed point on its temperature scale, passed on heating and on cooling; a neighbour's heat
shows as an earlier crossing. So heat capacity, losses and couplings follow on the scale that the declared alloy gives: what
that scale is, and nothing else, only a thermometer can say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .. import native
from ..errors import InputError
from ..logs.run import Run
from ..models import Array, Model
from .declared import base_spec
from .problem import _BAD, Problem
from .simulate import simulate_run
from .spec import Fit, Free, Spec

if TYPE_CHECKING:
    from ..search.certainty import Witness

DRIVEN_A = 0.2
"""Currents from which v / i is a measurement of resistance, not of the sensor's offset."""
CROSSED = 0.03
"""Part of its cold resistance by which a spring's v / i must have changed to have passed its transformation."""
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


class Resistances(Problem):
    """A problem whose readings are milliohms, not degrees: everything else is as with thermometers."""

    def __init__(self, array: Array, runs: Sequence[Run]) -> None:
        self.boards = list(runs)
        read = []
        for run in runs:
            assert run.current_a is not None and run.voltage_v is not None
            driven = run.current_a > DRIVEN_A
            ohm = np.where(driven, run.voltage_v / np.where(driven, run.current_a, 1.0), np.nan)
            read.append(replace(run, temperature_c=1e3 * ohm))
        super().__init__(array, read)

    def simulate(
        self, spec: Spec, values: Sequence[float], run_index: int, start_offset: np.ndarray | None = None
    ) -> np.ndarray:
        """Return what v / i of one run should be, (rows, springs), milliohm; from cold, at the logged ambient."""
        run = self.boards[run_index]
        with self._count_lock:
            self.simulations += 1
        try:
            plant = self.plant_for(spec, values)
            if run.ambient_c is not None:
                plant.set_ambient(float(run.ambient_c[0]))
            plant.set_fan(float(run.fan[0]))
            plant.reset()
            return 1e3 * plant.readings(run.time_s, run.drive, run.fan, run.ambient_c)
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
    read = np.concatenate([run.temperature_c for run in problem.runs]) * 1e-3
    with np.errstate(all="ignore"):
        cold, highest = np.nanpercentile(read, 5, axis=0), np.nanpercentile(read, 98, axis=0)
    # far beyond what noise makes of so many readings
    noise = 1e-3 * np.max(problem.noise, axis=0)
    crossed = np.flatnonzero(highest - cold > np.maximum(CROSSED * cold, 8.0 * noise))
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

    spec = base_spec(problem).with_effect(
        "latent_heat",
        [replace(number("latent_heat_j", get("latent_heat_j"), LIKE_DECLARED), effect="latent_heat")],
        (),
        "",
    )
    wires = [number("resistance_martensite_ohm", mean, LIKE_DECLARED)]
    wires.append(number("resistance_austenite_ohm", mean * ratio, LIKE_DECLARED))
    wires += [number(f"resistance_scale[{k + 1}]", float(cold[k]) / mean, ALIKE) for k in np.flatnonzero(known)]
    wires = [replace(one, effect="resistance_phase") for one in wires]
    spec = spec.with_effect("resistance_phase", wires, (), "", ("spring_mismatch",))
    first = problem.fit(spec, tolerance=1e-2, max_steps=1)
    found = problem.fit(spec, tolerance=1e-4, max_steps=40)
    return problem, problem.fit(spec, found.as_dict(), tolerance=1e-6, max_steps=20, errors=True), first


def with_effects(
    problem: Resistances, found: Fit, progress: Callable[[str], None] = lambda text: None
) -> tuple[Fit, dict[str, Witness]]:
    """Search for the effects of the array that v / i shows; return the fit with those named, and what speaks for each."""
    from .. import effects
    from ..search.certainty import NAMED, witness
    from ..search.search import Search

    known = [
        one
        for one in effects.candidates(problem)
        if one.effect in effects.ON_CHIP and one.effect not in found.spec.effects and not one.flexible
    ]
    search = Search(problem, known, found, progress)
    chosen, without, _ = search.run()
    witnesses = {name: witness(problem, chosen, name, other, False) for name, other in without.items()}
    for name in [one for one, said in witnesses.items() if said.probability() < NAMED]:
        chosen = search.reduced(chosen, name)
        del witnesses[name]
    if witnesses:
        chosen = problem.fit(chosen.spec, chosen.as_dict(), tolerance=1e-6, max_steps=20, errors=True)
    return chosen, witnesses


def model_of_fit(problem: Resistances, found: Fit) -> Model:
    """Return the model.toml of such a fit; its provenance says whose scale its temperatures have."""
    from ..verdict.result import model_of

    plant = problem.plant_for(found.spec, found.values)
    shown = [replace(run, temperature_c=simulate_run(plant.copy(), run, run.ambient_c, {})) for run in problem.boards]
    model = model_of(problem, found, shown)
    del model.provenance["rmse_after_c"]
    model.provenance["note"] = SCALE
    return model
