"""The diagnosis of logs without any temperature: what v / i says of the array, and what it cannot say."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from .. import __version__
from ..infer import from_resistance
from ..infer.fit import Fit
from ..infer.result import parameters_of
from ..infer.rounding import DRIVEN_A
from ..infer.scene import scene_of
from ..io import statistics
from ..io.logs.run import Run
from ..model import effects
from ..model.models import Array, Model
from ..model.simulate import simulate_run
from . import contacts, resistance
from .certainty import CERTAIN, NAMED, Witness, witness
from .diagnosis import SCHEMA, share_with, validate
from .evidence import unexplained
from .readings import REFERENCE_C, Readings, settled
from .residual import depends_on
from .search import Search

LEFT = "structure well above the noise of v / i remains that no effect of the library explains"


def changed_contacts(problem: from_resistance.Resistances, fit: Fit) -> list[contacts.Step]:
    """Return the contacts that changed, by what a fit leaves of v / i where its springs stay in one phase."""
    parts = []
    for r, run in enumerate(problem.boards):
        assert run.current_a is not None
        traced = simulate_run(problem.plant_for(fit.spec, fit.values), run, run.ambient_c, {}, trace=True)
        here = settled(run, traced[:, :, 1]) & np.isfinite(fit.residual[r]) & (run.current_a > DRIVEN_A)
        rows, springs = np.nonzero(here)
        noise_mv = np.broadcast_to(problem.noise[r], here.shape)
        current = run.current_a[here]
        ohm, noise = 1e-3 * fit.residual[r][here] / current, 1e-3 * noise_mv[here] / current
        over_k = traced[:, :, 0][here] - REFERENCE_C
        parts.append((ohm, springs, np.full(len(ohm), r), run.time_s[rows], traced[:, :, 1][here], over_k, noise))
    read = Readings(*(np.concatenate([part[n] for part in parts]) for n in range(7)))
    columns = {f"own {k}": (read.spring == k).astype(float) for k in np.unique(read.spring)}
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


def middle_instead(array: Array, listed: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return what else all outer springs alike are where there is one other spring: that one, with the losses of all free."""
    if (array.rows, array.cols) != (3, 3):
        return []
    number = next((one["parameters"].get("outer_loss_scale") for one in listed if one["name"] == "edge_loss"), None)
    if number is None:
        return []
    other = {"value": 1.0 / number["value"], "stderr": (number["stderr"] or 0.0) / number["value"] ** 2, "unit": "1"}
    mass = {"value": 1.0, "stderr": 0.0, "unit": "1"}
    rival = {"instead_of": "edge_loss", "name": "spring_mismatch", "variant": "spring 5", "evidence": 0.0}
    numbers = {"loss_scale[5]": other, "heat_capacity_scale[5]": mass}
    return [rival | {"parameters": numbers, "predictions_differ_c": 0.0}]


def diagnose(
    array: Array, runs: Sequence[Run], progress: Callable[[str], None] = lambda text: None
) -> tuple[dict[str, Any], Model]:
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
        variant, parameters = dict(found.spec.variant).get(name, ""), parameters_of(problem, found, name)
        probability = one.probability()
        said = {"name": name, "evidence": float(one.nats), "parameters": parameters, "probability": probability}
        said |= {"certainty": "certain" if probability >= CERTAIN else "probable"}
        listed.append(resistance.entry(said | ({"variant": variant} if variant else {}), None, None))
    listed += [resistance.entry(resistance.of_contact(one), None, None) for one in steps]
    share_with(listed, middle_instead(array, listed), math.inf)
    listed.sort(key=lambda one: -one["evidence"])
    no_degrees = {"rmse_c": None, "holdout_rmse_c": None}
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "tool": f"ninespring {__version__}",
        "logs": [{"file": Path(r.name).name, "sha256": r.sha256, "rows": len(r.time_s)} for r in runs],
        "baseline": {
            **no_degrees,
            "noise_c": None,
            "rmse_v": 1e-3 * statistics.rms(first.residual),
            "noise_v": 1e-3 * problem.noise_c,
            "effects": list(alone.spec.effects),
        },
        "effects": listed,
        "rivals": [],
        "after": {
            **no_degrees,
            "rmse_v": 1e-3 * statistics.rms(found.residual),
            "parameters": {
                key: one for e in (None, *alone.spec.effects) for key, one in parameters_of(problem, found, e).items()
            },
        },
        "unexplained": bool(left_over),
        "residual": {
            "autocorrelation_lag1": float(np.clip(statistics.autocorrelation(found.residual, 1)[1], -1.0, 1.0)),
            "depends_on": depends,
            "note": f"{LEFT}. {note}".strip() if left_over else note or "white at the noise of v",
        },
        "identifiability": {
            "not_identifiable": sorted(set(found.stuck)),
            "at_bounds": found.at_bounds(),
            "correlated": [{"a": a, "b": b, "correlation": r} for a, b, r in found.correlations()],
        },
        "warnings": [from_resistance.SCALE, *(f"{Path(run.name).name}: {text}" for run in runs for text in run.notes)],
        "seconds": round(time.monotonic() - begun, 2),
        "simulations": problem.simulations,
    }
    validate(result)
    return result, from_resistance.model_of_fit(problem, found)


def verdict(result: dict[str, Any]) -> str:
    """Return the outcome in one sentence."""
    before, after = result["baseline"], result["after"]
    names = " and ".join(one["name"] for one in result["effects"])
    error = (
        f"voltages are met to {1e3 * after['rmse_v']:.1f} mV ({1e3 * before['rmse_v']:.1f} as declared, "
        f"{1e3 * before['noise_v']:.1f} is what a board's readings are good for)"
    )
    more = " Something else is missing that no effect of the library explains." if result["unexplained"] else ""
    return (
        f"No thermometer: {error}. {f'Missing: {names}.' if names else 'No effect is missing that v / i shows.'}{more}"
    )


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
            spec = chosen.spec.without(name).with_effect(one.effect, one.free, one.fixed, one.variant, one.also_on)
            other = problem.fit(spec, chosen.as_dict() | one.start_at(1.0), tolerance=1e-3, max_steps=14)
            search.fits[search.key(spec)] = other
            if search.preferred(other, chosen):
                return search.settle(other)[:2]
    return chosen, without
