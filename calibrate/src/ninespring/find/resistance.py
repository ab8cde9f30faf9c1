"""Resistance as a second witness: what v / i of every spring says of phases, temperature and contacts.

The fitted thermal model says how hot each spring is and what part of it is austenite; resistance is then linear in its own
numbers, each phase's resistance, its rise with temperature and a contact in series, and each is weighed by what it explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import results
from ..model import effects
from ..model.models import Model
from . import contacts
from .certainty import CERTAIN, PROBABLE
from .evidence import UNEXPLAINED
from .readings import SEEN, Linear, Readings, nats_of, readings, solve

OF_THE_WIRE = "resistance_phase", "resistance_temperature"
"""Effects that v / i puts into a model."""
LEAST_NATS = 3.0
"""Evidence, after the price of numbers and of choosing, from which v / i names an effect: one in twenty."""
SMALLEST_RISE = 3e-4
"""Per K: a third of NiTi's usual rise; below it the steps of a board's voltage readings (4 mV of some 0.2 V) explain as much."""
SMALLEST_PHASE = 0.02
"""Difference between the phases, as a part of the resistance, that is told."""


@dataclass
class Second:
    """What v / i says: its error before and after, the effects that it names, the contacts that changed."""

    told: results.Resistance
    effects: list[results.Effect]
    contacts: list[contacts.Step]
    """None where v / i is unexplained with them."""


def told(
    name: str,
    nats: float,
    parameters: results.Parameters,
    chosen_from: int = 1,
    variant: str = "",
    probability: float | None = None,
) -> results.Effect:
    """Return an effect that v / i names; as likely as is said, else by the evidence that is left after the price of choosing.

    Of temperatures it explains nothing: their errors stay as they are.
    """
    if probability is None:
        probability = 1.0 / (1.0 + math.exp(-min(nats - math.log(chosen_from), 50.0)))
    return results.Effect(
        name=name,
        rmse_c=None,
        holdout_rmse_c=None,
        evidence=nats,
        parameters=parameters,
        on_chip=name in effects.ON_CHIP,
        in_words=effects.IN_WORDS[name],
        probability=probability,
        certainty="certain" if probability >= CERTAIN else "probable",
        text=effects.sentence(name, parameters, variant),
        variant=variant or results.UNSET,
        seen_by="v / i",
    )


def of_contact(one: contacts.Step) -> results.Effect:
    """Return a contact's change as an effect."""
    number = results.Number(value=one.ohm, stderr=one.error, unit="ohm")
    return told("contact_resistance", one.nats, {f"contact_ohm[{one.spring + 1}]": number}, one.tried, one.words)


def into_model(model: Model, second: Second | None) -> None:
    """Put what v / i determined into a model, where both phases were seen: one without the other would be wrong.

    A contact that changed during a log is that day's: it is told, and left out.
    """
    named = {one.name: one.parameters for one in (second.effects if second else ())}
    if "resistance_phase" not in named:
        return
    for effect in OF_THE_WIRE:
        for name, number in named.get(effect, {}).items():
            model.parameters[name], model.stderr[name] = number.value, number.stderr
        if effect in named and effect not in model.effects:
            model.effects.append(effect)


@dataclass
class _Explained:
    """A linear account of v / i: its columns, their fit, and what phases and temperature explain, nats."""

    columns: dict[str, np.ndarray]
    model: Linear
    rising: dict[str, np.ndarray]
    two_resistances: bool
    """The phases alone tell two resistances apart."""
    phase_nats: float
    rise_nats: float


def _enough(read: Readings | None) -> Readings | None:
    """Return the readings of phases that have enough of them, None where none is left."""
    if read is None:
        return None
    hot = read.phase > 0.5
    rare = hot if hot.sum() < SEEN else ~hot if (~hot).sum() < SEEN else np.zeros_like(hot)
    # too few readings of a phase tell nothing of it, and left among the others they would be a contact
    read = read.of(~rare)
    return read if len(read.ohm) else None


def _share_of_each(read: Readings, own: dict[str, np.ndarray], two_phases: bool) -> np.ndarray:
    """Return how much wire each reading's spring has, as a share of the mean's.

    A longer wire has more of everything: what is shared counts in proportion to a spring's own resistance.
    """
    plain = own | ({"phase": read.phase, "rise austenite": read.over_k * read.phase} if two_phases else {})
    plain |= {"rise martensite": read.over_k * (1.0 - read.phase) if two_phases else read.over_k}
    # a contact that got worse is no longer wire
    alike = contacts.find(read, plain)[1].values[: len(own)]
    return (alike / alike.mean())[np.searchsorted(sorted({int(one) for one in read.spring}), read.spring)]


def _explained(read: Readings, own: dict[str, np.ndarray], two_phases: bool) -> _Explained:
    """Return what of v / i phases and temperature explain, each where it is worth its numbers."""
    columns = own
    model = first = solve(read, columns)
    share = _share_of_each(read, own, two_phases)
    if two_phases:
        trial = solve(read, columns | {"phase": read.phase * share})
        if nats_of(read, model, trial) > LEAST_NATS:
            columns, model = columns | {"phase": read.phase * share}, trial
    two_resistances = "phase" in columns
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
    return _Explained(columns, model, rising, two_resistances, phase_nats, rise_nats)


def _named(
    read: Readings, found: _Explained, resistances: dict[str, dict[str, float]], mean: dict[str, float]
) -> list[results.Effect]:
    """Return the effects of the wire that are large enough to be told."""
    model, out = found.model, []
    change = model.values[model.names.index("phase")] if "phase" in found.columns else 0.0
    if abs(change) > SMALLEST_PHASE * float(np.median(read.ohm)):
        numbers = {key: _combined(model, parts) for key, parts in resistances.items()}
        out.append(told("resistance_phase", found.phase_nats, numbers))
    if "rise martensite" in found.columns:
        rises = {}
        for key in found.rising:
            phase = key.removeprefix("rise ")
            base = _combined(model, resistances.get(f"resistance_{phase}_ohm", mean)).value
            slope = _combined(model, {key: 1.0})
            rises[f"resistance_{phase}_rise_per_k"] = results.Number(
                value=slope.value / base, stderr=slope.stderr / base, unit="1/K"
            )
        if max(abs(one.value) for one in rises.values()) > SMALLEST_RISE:
            out.append(told("resistance_temperature", found.rise_nats, rises))
    return out


def _combined(model: Linear, parts: dict[str, float]) -> results.Number:
    """Return a sum of fitted numbers as one, with its error."""
    weights = np.array([parts.get(key, 0.0) for key in model.names])
    error = float(np.sqrt(max(0.0, weights @ model.covariance @ weights)))
    return results.Number(value=float(weights @ model.values), stderr=error, unit="ohm")


def witness(problem: Problem, fit: Fit) -> Second | None:
    """Return what v / i says: its error before and after, the effects it names, their numbers; None without v and i."""
    read = _enough(readings(problem, fit))
    if read is None:
        return None
    two_phases = bool(np.ptp(read.phase) > 0.5)
    own = read.own()  # what is shared is how it changes
    found = _explained(read, own, two_phases)
    mean = {key: 1.0 / len(own) for key in own}
    resistances = {"resistance_martensite_ohm": mean}
    if found.two_resistances:
        resistances["resistance_austenite_ohm"] = mean | {"phase": 1.0}
    named = _named(read, found, resistances, mean)
    steps, model = contacts.find(read, found.columns)
    steps = contacts.dated(problem, steps)
    rms_ohm = lambda rest: float(np.sqrt(np.mean((rest * read.noise) ** 2)))  # noqa: E731
    said = results.Resistance(
        rows=len(read.ohm),
        noise_ohm=float(np.sqrt(np.mean(read.noise**2))),
        before_ohm=rms_ohm(solve(read, own).rest),
        after_ohm=rms_ohm(model.rest),
        parameters={key: _combined(model, parts) for key, parts in resistances.items()},
    )
    listed = [*named, *(of_contact(one) for one in steps)]
    if model.spread <= 1.0 + UNEXPLAINED**2:
        return Second(said, listed, steps)
    # something else acts in v / i, and what is named may stand in for it: no heat is taken out for that
    for one in listed:
        one.probability, one.certainty = min(one.probability, PROBABLE), "probable"
    return Second(said, listed, [])
