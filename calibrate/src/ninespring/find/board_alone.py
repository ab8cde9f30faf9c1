"""The diagnosis of logs without any temperature: what v / i says of the array, and what it cannot say."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ..export.settings import judged
from ..infer import from_resistance
from ..infer.fit import Fit
from ..infer.result import parameters_of
from ..infer.rounding import DRIVEN_A
from ..infer.scene import scene_of
from ..io import results, statistics
from ..io.logs.run import Run
from ..model import effects
from ..model.models import Array, Model
from ..model.simulate import simulate_run
from . import contacts, resistance
from .certainty import NAMED, Witness, witness
from .diagnosis import identifiability_of, share_with
from .evidence import unexplained
from .readings import REFERENCE_C, Readings, colder, settled
from .residual import depends_on
from .search import Search

LEFT = "structure well above the noise of v / i remains that no effect of the library explains"


def changed_contacts(problem: from_resistance.Resistances, fit: Fit) -> list[contacts.Step]:
    """Return the contacts that changed, by what a fit leaves of v / i where its springs stay in one phase."""
    parts = []
    for r, run in enumerate(problem.boards):
        assert run.current_a is not None
        traced = simulate_run(problem.plant_for(fit.spec, fit.values), run, run.ambient_c, trace=True)
        here = settled(run, traced[:, :, 1]) & np.isfinite(fit.residual[r]) & (run.current_a > DRIVEN_A)
        rows, springs = np.nonzero(here)
        noise_mv = np.broadcast_to(problem.noise[r], here.shape)
        current = run.current_a[here]
        ohm, noise = 1e-3 * fit.residual[r][here] / current, 1e-3 * noise_mv[here] / current
        hot_c, phase = traced[:, :, 0], traced[:, :, 1][here]
        cold = colder(problem, fit, hot_c)[here]
        at = springs, np.full(len(ohm), r), run.time_s[rows]
        parts.append((ohm, *at, phase, hot_c[here] - REFERENCE_C, noise, cold))
    read = Readings.joined(parts)
    columns = read.own()
    # beside what else a fit may have wrong of resistances
    columns["rise martensite"] = read.over_k * (1.0 - read.phase)
    if (read.phase > 0.5).any():
        columns |= {"phase": read.phase, "rise austenite": read.over_k * read.phase}
    return contacts.dated(problem, contacts.find(read, columns)[0])


def without(run: Run, r: int, steps: Sequence[contacts.Step]) -> Run:
    """Return a run as it were without the changes of contacts."""
    assert run.current_a is not None and run.voltage_v is not None
    ohm = contacts.added_ohm(run, r, steps)
    return replace(contacts.without_heat(run, ohm), voltage_v=run.voltage_v - run.current_a * ohm)


def middle_instead(array: Array, listed: Sequence[results.Effect]) -> list[results.Rival]:
    """Return what else all outer springs alike are where there is one other spring: that one, with the losses of all free."""
    if (array.rows, array.cols) != (3, 3):
        return []
    number = next((one.parameters.get("outer_loss_scale") for one in listed if one.name == "edge_loss"), None)
    if number is None:
        return []
    other = results.Number(value=1.0 / number.value, stderr=(number.stderr or 0.0) / number.value**2, unit="1")
    mass = results.Number(value=1.0, stderr=0.0, unit="1")
    same = results.Rival(
        instead_of="edge_loss",
        name="spring_mismatch",
        variant="spring 5",
        rmse_c=0.0,
        evidence=0.0,
        predictions_differ_c=0.0,
        parameters={"loss_scale[5]": other, "heat_capacity_scale[5]": mass},
        separating_experiment="none: it is the same in other words",
    )
    return [same]


def diagnose(
    array: Array, runs: Sequence[Run], progress: Callable[[str], None] = lambda text: None
) -> tuple[results.BoardDiagnosis, Model]:
    """Return the diagnosis, every error in degrees left open, and the model that comes of it."""
    begun = time.monotonic()
    with threadpool_limits(1):
        problem, alone, first = from_resistance.fit(array, runs)
        progress("effects that v / i shows")
        found, witnesses = with_effects(problem, alone, progress)
        left_over = unexplained(problem, found)
        steps = changed_contacts(problem, found) if left_over else []
        if steps:
            progress("contacts that changed")
            other, cleared, _ = from_resistance.fit(array, [without(run, r, steps) for r, run in enumerate(runs)])
            again, seen = with_effects(other, cleared, progress)
            # while more than contacts is missing, phases are not known well enough to accuse them
            if unexplained(other, again):
                steps = []
            else:
                problem, alone, found, witnesses, left_over = other, cleared, again, seen, False
        depends, note = depends_on(problem, found)
    listed = []
    for name, one in witnesses.items():
        numbers, variant = parameters_of(problem, found, name), dict(found.spec.variant).get(name, "")
        listed.append(resistance.told(name, float(one.nats), numbers, 1, variant, one.probability()))
    listed += [resistance.of_contact(one) for one in steps]
    share_with(listed, middle_instead(array, listed), math.inf)
    listed.sort(key=lambda one: -one.evidence)
    numbers = {key: one for e in (None, *alone.spec.effects) for key, one in parameters_of(problem, found, e).items()}
    told = results.BoardDiagnosis(
        logs=[results.Read(file=Path(r.name).name, sha256=r.sha256, rows=len(r.time_s)) for r in runs],
        baseline=results.Baseline(
            rmse_c=None,
            holdout_rmse_c=None,
            noise_c=None,
            rmse_v=1e-3 * statistics.rms(first.residual),
            noise_v=1e-3 * problem.noise_c,
            effects=list(alone.spec.effects),
        ),
        effects=listed,
        rivals=[],
        after=results.After(
            rmse_c=None, holdout_rmse_c=None, rmse_v=1e-3 * statistics.rms(found.residual), parameters=numbers
        ),
        unexplained=bool(left_over),
        residual=results.Residual(
            autocorrelation_lag1=float(np.clip(statistics.autocorrelation(found.residual, 1)[1], -1.0, 1.0)),
            depends_on=depends,
            note=f"{LEFT}. {note}".strip() if left_over else note or "white at the noise of v",
        ),
        identifiability=identifiability_of(found),
        warnings=[from_resistance.SCALE, *(f"{Path(run.name).name}: {text}" for run in runs for text in run.notes)],
        seconds=round(time.monotonic() - begun, 2),
        simulations=problem.simulations,
    )
    made = from_resistance.model_of_fit(problem, found)
    judged(told.effects, made)
    results.checked(told)
    return told, made


def with_effects(
    problem: from_resistance.Resistances, found: Fit, progress: Callable[[str], None] = lambda text: None
) -> tuple[Fit, dict[str, Witness]]:
    """Search for the effects of the array that v / i shows; return the fit with those named, and what speaks for each."""
    known = [
        one
        for one in effects.candidates(scene_of(problem))
        if one.effect in effects.ON_CHIP and one.effect not in found.spec.effects and not one.flexible
    ]
    search = Search(problem, known, found, progress)
    chosen, without = of_the_array(problem, search, *search.run()[:2])
    witnesses = {name: witness(problem, chosen, name, other, False) for name, other in without.items()}
    for name in [one for one, said in witnesses.items() if said.probability() < NAMED]:
        chosen = search.reduced(chosen, name)
        del witnesses[name]
    if witnesses:
        chosen = problem.fit(chosen.spec, chosen.as_dict(), tolerance=1e-6, max_steps=20, errors=True)
    return chosen, witnesses


def of_the_array(
    problem: from_resistance.Resistances, search: Search, chosen: Fit, without: dict[str, Fit]
) -> tuple[Fit, dict[str, Fit]]:
    """Return the fit with what is said of one spring said of the array, where that explains as much with no more numbers.

    All outer springs losing more is the middle one losing less: only from numbers that are about right does it show.
    """
    for name, variant in chosen.spec.variant:
        if name not in without or not variant.startswith("spring "):
            continue
        for one in search.candidates:
            if one.effect in chosen.spec.effects or one.variant.startswith("spring "):
                continue
            search.progress(f"could it be {one.effect} instead of {name}?")
            spec = one.added_to(chosen.spec.without(name))
            other = problem.fit(spec, chosen.as_dict() | one.start_at(1.0), tolerance=1e-3, max_steps=14)
            search.fits[search.key(spec)] = other
            if search.preferred(other, chosen):
                return search.settle(other)[:2]
    return chosen, without
