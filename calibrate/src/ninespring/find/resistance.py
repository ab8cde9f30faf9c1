"""Resistance as a second witness: what v / i of every spring says of phases, temperature and contacts.

The fitted thermal model says how hot each spring is and what part of it is austenite; resistance is then linear in its own
numbers, each phase's resistance, its rise with temperature and a contact in series, and each is weighed by what it explains.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..model import effects
from ..model.models import Model
from . import contacts
from .certainty import CERTAIN
from .readings import SEEN, nats_of, readings, solve

LEAST_NATS = 3.0
"""Evidence, after the price of numbers and of choosing, from which v / i names an effect: one in twenty."""
SMALLEST_RISE = 3e-4
"""Per K: a third of NiTi's usual rise; below it the steps of a board's voltage readings (4 mV of some 0.2 V) explain as much."""
SMALLEST_PHASE = 0.02
"""Difference between the phases, as a part of the resistance, that is told."""


def entry(found: dict[str, Any], rmse_c: float | None, holdout_rmse_c: float | None) -> dict[str, Any]:
    """Return an effect that v / i names as diagnosis.json lists it: the temperatures' errors, if any, stay as they are."""
    name, variant = found["name"], found.get("variant", "")
    return found | {
        "rmse_c": rmse_c,
        "holdout_rmse_c": holdout_rmse_c,
        "on_chip": name in effects.ON_CHIP,
        "in_words": effects.IN_WORDS[name],
        "text": effects.sentence(name, found["parameters"], variant),
        "seen_by": "v / i",
    }


def told(name: str, nats: float, parameters: dict[str, Any], chosen_from: int = 1) -> dict[str, Any]:
    """Return an effect; certain or probable by the evidence that is left after the price of choosing."""
    probability = 1.0 / (1.0 + math.exp(-min(nats - math.log(chosen_from), 50.0)))
    certainty = "certain" if probability >= CERTAIN else "probable"
    return {
        "name": name,
        "evidence": nats,
        "parameters": parameters,
        "probability": probability,
        "certainty": certainty,
    }


def of_contact(one: contacts.Step) -> dict[str, Any]:
    """Return a contact's change as an effect."""
    parameters = {f"contact_ohm[{one.spring + 1}]": {"value": one.ohm, "stderr": one.error, "unit": "ohm"}}
    return told("contact_resistance", one.nats, parameters, one.tried) | {"variant": one.words}


def into_model(model: Model, second: dict[str, Any] | None) -> None:
    """Put what v / i determined into a model, where both phases were seen: one without the other would be wrong.

    A contact that changed during a log is that day's: it is told, and left out.
    """
    named = {one["name"]: one["parameters"] for one in (second or {}).get("effects", [])}
    if "resistance_phase" not in named:
        return
    for effect in ("resistance_phase", "resistance_temperature"):
        for name, number in named.get(effect, {}).items():
            model.parameters[name], model.stderr[name] = number["value"], number["stderr"]
        if effect in named and effect not in model.effects:
            model.effects.append(effect)


def witness(problem: Problem, fit: Fit) -> dict[str, Any] | None:
    """Return what v / i says: its error before and after, the effects it names, their numbers; None without v and i."""
    read = readings(problem, fit)
    if read is None:
        return None
    hot = read.phase > 0.5
    rare = hot if hot.sum() < SEEN else ~hot if (~hot).sum() < SEEN else np.zeros_like(hot)
    # too few readings of a phase tell nothing of it, and left among the others they would be a contact
    read = read.of(~rare)
    if not len(read.ohm):
        return None
    two_phases = bool(np.ptp(read.phase) > 0.5)
    # every spring has a resistance of its own: wires differ; what is shared is how it changes
    own = {f"own {k}": (read.spring == k).astype(float) for k in sorted({int(one) for one in read.spring})}
    columns = own
    model = first = solve(read, columns)
    found: list[dict[str, Any]] = []

    def combined(parts: dict[str, float]) -> dict[str, Any]:
        """Return a sum of fitted numbers as one, with its error."""
        weights = np.array([parts.get(key, 0.0) for key in model.names])
        error = float(np.sqrt(max(0.0, weights @ model.covariance @ weights)))
        return {"value": float(weights @ model.values), "stderr": error, "unit": "ohm"}

    mean = {key: 1.0 / len(own) for key in own}
    plain = own | ({"phase": read.phase, "rise austenite": read.over_k * read.phase} if two_phases else {})
    plain |= {"rise martensite": read.over_k * (1.0 - read.phase) if two_phases else read.over_k}
    # a contact that got worse is no longer wire
    alike = contacts.find(read, plain)[1].values[: len(own)]
    # a longer wire has more of everything: what is shared counts in proportion to a spring's own resistance
    share = (alike / alike.mean())[np.searchsorted(sorted({int(one) for one in read.spring}), read.spring)]
    if two_phases:
        trial = solve(read, columns | {"phase": read.phase * share})
        nats = nats_of(read, model, trial)
        if nats > LEAST_NATS:
            columns, model = columns | {"phase": read.phase * share}, trial
    resistances = {"resistance_martensite_ohm": mean}
    if "phase" in columns:
        resistances["resistance_austenite_ohm"] = mean | {"phase": 1.0}
    phase_nats = nats_of(read, first, model)
    over_k = read.over_k * share
    rising = {"rise martensite": over_k * (1.0 - read.phase), "rise austenite": over_k * read.phase}
    if not two_phases:
        rising = {"rise martensite": over_k}
    trial = solve(read, columns | rising)
    rise_nats = nats_of(read, model, trial)
    # how far a spring transformed each time nobody knows: what rises does so while it stays hot, too
    each = own | read.hot_times()
    if min(rise_nats, nats_of(read, solve(read, each), solve(read, each | rising))) > LEAST_NATS:
        columns, model = columns | rising, trial
    if "phase" in columns and "rise martensite" in columns:
        # each beside the other: what one explains alone the other may explain as well
        phase_nats = nats_of(read, solve(read, {k: v for k, v in columns.items() if k != "phase"}), model)
        if phase_nats <= LEAST_NATS:
            columns = {k: v for k, v in columns.items() if k != "phase"}
            model = solve(read, columns)
            rise_nats = nats_of(read, first, model)
    change = model.values[model.names.index("phase")] if "phase" in columns else 0.0
    if "phase" in columns and abs(change) > SMALLEST_PHASE * float(np.median(read.ohm)):
        found.append(told("resistance_phase", phase_nats, {key: combined(parts) for key, parts in resistances.items()}))
    if "rise martensite" in columns:
        rises = {}
        for key in rising:
            name = f"resistance_{key.removeprefix('rise ')}_rise_per_k"
            base, slope = (
                combined(resistances.get(f"resistance_{key.removeprefix('rise ')}_ohm", mean)),
                combined({key: 1.0}),
            )
            shares = {"value": slope["value"] / base["value"], "stderr": slope["stderr"] / base["value"], "unit": "1/K"}
            rises[name] = shares
        if max(abs(one["value"]) for one in rises.values()) > SMALLEST_RISE:
            found.append(told("resistance_temperature", rise_nats, rises))
    steps, model = contacts.find(read, columns)
    steps = contacts.dated(problem, steps)
    found += [of_contact(one) for one in steps]
    typical = float(np.sqrt(np.mean(read.noise**2)))
    count = len(read.ohm)
    return {
        "rows": count,
        "noise_ohm": typical,
        "before_ohm": float(np.sqrt(np.mean((first.rest * read.noise) ** 2))),
        "after_ohm": float(np.sqrt(np.mean((model.rest * read.noise) ** 2))),
        "effects": found,
        "contacts": steps,
        "parameters": {key: combined(parts) for key, parts in resistances.items()},
    }
