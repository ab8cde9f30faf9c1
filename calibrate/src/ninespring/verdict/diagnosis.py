"""The diagnosis: fit what is declared, look at what is left, find what is missing, say what cannot be told apart."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
from threadpoolctl import threadpool_limits

from .. import __version__, effects
from ..errors import InputError
from ..export.settings import judged
from ..fit import statistics
from ..fit.declared import base_spec
from ..fit.problem import Problem
from ..fit.spec import RUNS_OWN, Fit, Spec
from ..logs import condense
from ..logs.run import Run
from ..models import Array, Model
from ..search import lasting, search, unnamed
from ..search.certainty import CERTAIN, NAMED, Witness, witness
from ..search.evidence import EQUIVALENT, difference, excess, likelihood, log_evidence, unexplained
from . import contacts, doubt, experiments, plausibility, resistance, runs_apart, unknown_heat, unseen
from .residual import depends_on
from .result import DRIFT_LEFT_OUT, as_shown, model_of, parameters_of

SCHEMA = "ninespring.diagnosis/1"
MOST_OF_IT = 0.5
"""Part of what is beyond the noise without an effect that it explains, where more is explained than left."""
LEAST_PART = 0.01
"""Of a drive or a reading, less is not told as a cause: a board measures power no better, its voltages step by 4 mV."""
PROBABLE = CERTAIN - 0.01
"""The most that an effect is sure with a number at its bound."""
PINNED = 1e-5
"""Spread, in a number's inner coordinate, that leaves it where it is."""


@dataclass
class Diagnosis:
    """Everything a diagnosis found: the result for programs and what the report draws."""

    result: dict[str, Any]
    model: Model
    problem: Problem
    baseline: Fit
    final: Fit
    heat: unknown_heat.UnknownHeat

    @property
    def effects(self) -> list[str]:
        """Names of what was found, strongest first."""
        return [one["name"] for one in self.result["effects"]]

    def __repr__(self) -> str:
        before, after = self.result["baseline"]["rmse_c"], self.result["after"]["rmse_c"]
        return f"<diagnosis: {', '.join(self.effects) or 'nothing found'}; {before:.2f} K before, {after:.2f} K after>"


def prepare(array: Array, runs: Sequence[Run], declared: Mapping[str, float] | None = None) -> Problem:
    """Return the problem of these runs, condensed where they are long."""
    share = max(600, 6000 // max(1, len(runs)))
    return Problem(array, [condense(run, share) for run in runs], declared)


def first_fit(problem: Problem, spec: Spec) -> Fit:
    """Fit the declared model, errors of the first readings projected out; then with spikes left out and those errors as
    this model has them, again."""
    problem.learn_starts(spec, [free.start for free in spec.free])
    fit = problem.fit(spec, tolerance=1e-3)
    if problem.mask_spikes(fit.residual):
        problem.learn_starts(fit.spec, fit.values)
        fit = problem.fit(spec, fit.as_dict(), tolerance=1e-3)
    problem.learn_starts(fit.spec, fit.values)
    noise = [statistics.noise_floor(left, run.starts) for left, run in zip(fit.residual, problem.runs, strict=True)]
    problem.noise = [np.fmin(a, b) for a, b in zip(problem.noise, noise, strict=True)]
    problem._tidy_noise()
    problem.learn_power(fit.spec, fit.values)
    return problem.fit(spec, fit.as_dict(), tolerance=1e-5, errors=True)


def _finish(problem: Problem, fit: Fit) -> Fit:
    if fit.covariance is None:
        again = problem.fit(fit.spec, fit.as_dict(), tolerance=1e-6, errors=True)
        return again if again.chi2 <= fit.chi2 * (1 + 1e-6) else fit
    return fit


def with_everything(problem: Problem, clean: Fit, base: Fit) -> Fit:
    """Return a fit that was made beside what has no name, with that in the error: the effects' numbers stay, with their
    errors, and the declared numbers, and those of a run alone, take up what they can.

    All are fitted again where that would leave more than the declared model alone does.
    """
    own = np.array([free.effect is None or free.run is not None for free in clean.spec.free])
    pinned = [
        free if mine else replace(free, start=float(value), prior=PINNED)
        for free, value, mine in zip(clean.spec.free, clean.values, own, strict=True)
    ]
    spec = replace(clean.spec, free=tuple(pinned))
    fit = problem.fit(spec, clean.as_dict(), tolerance=1e-4, errors=True)
    if fit.sse > base.sse:
        return problem.fit(clean.spec, clean.as_dict(), tolerance=1e-4, errors=True)
    covariance = fit.covariance
    if clean.covariance is not None and covariance is not None:
        together = np.outer(own, own)
        covariance = np.where(together, covariance, np.where(np.outer(~own, ~own), clean.covariance, 0.0))
    return replace(fit, spec=clean.spec, covariance=covariance)


def in_order(found: search.Search, base: Fit, final: Fit, adopted: Sequence[str]) -> list[tuple[str, Fit]]:
    """Return adopted effects, the one that explains most first, each with the fit of all up to it."""
    out: list[tuple[str, Fit]] = []
    rest = list(adopted)
    while rest:
        options = []
        for effect in rest:
            spec = final.spec
            for other in rest:
                if other != effect:
                    spec = spec.without(other)
            key = found.key(spec)
            if len(rest) == 1:
                fit = final
            elif key in found.fits:
                fit = found.fits[key]
            else:
                fit = found.fits[key] = found.problem.fit(spec, final.as_dict(), tolerance=1e-3, max_steps=14)
            options.append((fit.sse, effect, fit))
        _, effect, fit = min(options, key=lambda one: one[0])
        rest.remove(effect)
        out.append((effect, fit))
    return out


def variant_of(fit: Fit, effect: str) -> str:
    """Return which variant of an effect a fit has."""
    return dict(fit.spec.variant).get(effect, "")


def diagnose(
    array: Array,
    runs: Sequence[Run],
    *,
    model: Model | None = None,
    frozen: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Diagnose logs. `model` gives declared values and effects already on; `frozen` keeps them as they are."""
    # Simulations run in threads of their own: a linear algebra that starts more only gets in their way.
    with threadpool_limits(1):
        return _diagnose(array, runs, model, frozen, progress)


def with_effects_of(spec: Spec, model: Model, known: Sequence[effects.Candidate], frozen: bool) -> Spec:
    """Return the spec with a model's effects on, each in the variant that the model's parameters speak of.

    Its numbers start at the model's values; where frozen they stay there.
    """
    given = model.parameters

    def matches(one: effects.Candidate) -> int:
        numbers = sum(name in given for free in one.free for name in free.names)
        return numbers + sum(1 if given.get(name) == value else -1 for name, value in one.fixed if name in given)

    for effect in model.effects:
        if effect in spec.plant_effects:
            continue
        options = [c for c in known if c.effect == effect]
        if frozen or not options:
            spec = spec.with_effect(effect, (), (), max(options, key=matches).variant if options else "")
            continue
        one = max(options, key=matches)
        free = [replace(f, start=next((given[n] for n in f.names if n in given), f.start)) for f in one.free]
        spec = spec.with_effect(effect, free, one.fixed, one.variant, one.also_on)
    return spec


def rivals_of(
    found: search.Search,
    final: Fit,
    adopted: Sequence[str],
    contenders: Sequence[tuple[str, Fit]],
    progress: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Return what the data cannot tell from an effect that was named, each with the experiment that would."""
    problem = found.problem
    rivals: list[dict[str, Any]] = []
    seen = set()
    for instead, other in sorted(contenders, key=lambda one: one[1].chi2):
        extra = [e for e in other.spec.effects if e not in final.spec.effects]
        if instead not in adopted or not extra or (instead, extra[0]) in seen:
            continue
        apart = difference(problem, final, other)
        ahead = log_evidence(problem, final, other)
        if ahead >= search.TOLD_APART and apart >= EQUIVALENT:
            continue
        seen.add((instead, extra[0]))
        progress(f"how to tell {extra[0]} from {instead}")
        trial = experiments.separate(problem, final, other)
        other = _finish(problem, other)
        rivals.append(
            {
                "instead_of": instead,
                "name": extra[0],
                "variant": variant_of(other, extra[0]),
                "rmse_c": statistics.rms(other.residual),
                "holdout_rmse_c": problem.holdout_rmse(other),
                "evidence": ahead,
                "predictions_differ_c": apart * problem.noise_c,
                "parameters": parameters_of(problem, other, extra[0]),
                "separating_experiment": trial.text,
                "experiment": trial.as_dict(),
            }
        )
    return rivals


def share_with(listed: Sequence[dict[str, Any]], rivals: Sequence[Mapping[str, Any]], same_c: float) -> None:
    """Share what speaks for a named effect with rivals that show the same readings: only the two in combination are fixed.

    That one of them has fewer numbers makes it simpler, not truer.
    """
    for entry in listed:
        alike = [
            one
            for one in rivals
            if one["instead_of"] == entry["name"]
            and one["evidence"] < search.TOLD_APART
            and one["predictions_differ_c"] < same_c
        ]
        if not alike:
            continue
        instead = [effects.sentence(one["name"], one["parameters"], one["variant"]) for one in alike]
        entry["probability"] /= 1 + len(alike)
        entry["certainty"] = "probable"
        entry["text"] += f" Or: {' Or: '.join(instead)} These readings fix them only in combination."


def candidates_of(found: search.Search, final: Fit, base: Fit) -> list[dict[str, Any]]:
    """Return every model that the search fitted, the likeliest first."""
    candidates = [
        {
            "effects": [f"{e} ({v})" if v else e for e, v in key],
            "rmse_c": statistics.rms(fit.residual),
            "evidence_over_baseline": float(log_evidence(found.problem, fit, base)),
            "adopted": fit.spec.variant == final.spec.variant,
        }
        for key, fit in found.fits.items()
    ]
    return sorted(candidates, key=lambda one: -one["evidence_over_baseline"])


def _diagnose(
    array: Array, runs: Sequence[Run], model: Model | None, frozen: bool, progress: Callable[[str], None]
) -> Diagnosis:
    begun = time.monotonic()
    declared = dict(model.parameters) if model else {}
    problem = prepare(model.array if model else array, runs, declared)
    progress("fitting what is declared")
    spec = base_spec(problem, frozen)
    known = effects.candidates(problem)
    if model:
        spec = with_effects_of(spec, model, known, frozen)
    base = first_fit(problem, spec)
    own = effects.of_runs(problem)
    found = search.Search(problem, [c for c in (*known, *own) if c.effect not in spec.effects], base, progress)
    final, without, contenders = found.run()
    progress("what v / i says")
    swapped = plausibility.swapped(problem.runs)
    # beside another spring's temperature v / i would only accuse contacts
    if steps := ({} if swapped else resistance.witness(problem, final) or {}).get("contacts"):
        # v i is measured with the contact: its heat is not the spring's, and everything is looked for again without it
        contacts.take_heat_out(problem, steps)
        base = first_fit(problem, spec)
        found = search.Search(problem, found.candidates, base, progress)
        final, without, contenders = found.run()
    problem.learn_power(final.spec, final.values)
    hidden: list[unnamed.Hidden] = []
    if not swapped and unexplained(problem, final):
        found, (final, without, contenders), hidden = _where_something_is_left(
            problem, found, final, without, contenders
        )
    declared_alone, base = base, found.base
    progress("held-out blocks")
    final = _finish(problem, final)
    # where the ambient was not logged, that it drifted is no stand-in
    guessed = all(run.ambient_c is None for run in problem.runs)
    free_to_bend = (*RUNS_OWN, *(["ambient_drift"] if guessed else []))
    witnesses: dict[str, Witness] = {}
    judge = found
    judged_by = unseen.Unseen(problem, found, declared_alone)
    while fresh := [effect for effect in without if effect not in witnesses]:
        likely = final if hidden else lasting.likeliest(problem, final)
        enough = {effect: True for effect in fresh}
        for effect in fresh:
            flexible = found.is_flexible(final, effect) and effect not in free_to_bend
            witnesses[effect] = witness(problem, final, effect, without[effect], flexible)
            if not hidden:
                # each account at its likeliest: what least squares made of the one without it is no evidence
                other = lasting.likeliest(problem, without[effect])
                nats = log_evidence(problem, likely, other)
                witnesses[effect] = replace(witnesses[effect], nats=nats)
                enough[effect] = nats - found.price() >= search.MIN_EVIDENCE
        # beside causes without a name that leave structure themselves, a name must explain more than it leaves
        least = MOST_OF_IT if hidden and unexplained(problem, final) else 0.0
        doubtful = [
            effect
            for effect in fresh
            if not enough[effect]
            or (
                (witnesses[effect].probability() < NAMED or witnesses[effect].share < least)
                and (hidden or not judged_by.tells(final, without[effect]))
            )
        ]
        if not doubtful:
            break
        # judged together, beside one another: what one of them stood in for does not count against the rest
        for effect in doubtful:
            final = judge.reduced(final, effect)
        # another may be what it stood in for
        others = [one for one in judge.candidates if one.effect not in doubtful]
        judge = search.Search(problem, others, found.base, progress, found.fits)
        final, without, contenders = judge.settle(judge.forward(final))
        final = _finish(problem, final)
    progress("a run that the fit never saw")
    not_kept: list[str] = []
    instead = ""
    if not hidden:
        kept, not_kept = judged_by.kept(final, judge.reduced)
        if kept is None:
            # as anybody fits it, by least squares: nothing that is known of its errors predicts better
            problem.take_for(None)
            base = declared_alone
            found = judge = search.Search(problem, found.candidates, base, progress)
            kept, contenders = judged_by.plain(found), []
            which = f"the declared model{unseen.WITH_LAG * (kept is not base)}, by least squares"
            instead = f". The model is {which}: nothing else that was tried predicts as well"
        if not_kept or instead:
            final = _finish(problem, kept)
            without = {e: judge.reduced(final, e) for e in final.spec.effects if e not in base.spec.effects}
            for effect in without:
                witnesses.setdefault(effect, witness(problem, final, effect, without[effect], False))
    headline = judged_by.as_dict(final, instead)
    final = runs_apart.with_spread(problem, final)
    left_over = unexplained(problem, final) or bool(hidden)
    adopted = [e for e in final.spec.effects if e not in base.spec.effects]
    strength = {e: log_evidence(problem, final, without[e]) for e in adopted}
    steps = in_order(found, base, final, adopted)
    adopted = [effect for effect, _ in steps]
    apart_from_final = rivals_of(found, final, adopted, contenders, progress)
    tried = candidates_of(found, final, base)
    if hidden:
        # from here on everything is in the error again: a model is for an array in which what has no name still acts
        problem.leave_out(None)
        base = declared_alone
        again = {id(fit): with_everything(problem, fit, base) for fit in [final, *(fit for _, fit in steps)]}
        steps = [(effect, again[id(fit)]) for effect, fit in steps]
        final = again[id(final)]
    # as declared, by itself: with what lasts as the found model leaves it, it would be fitted to that
    before = base if problem.colour is None else problem.evaluate(declared_alone)
    if left_over and not hidden and problem.colour is None:
        likelihood(problem, final)
        final.holdout = problem.holdout_rmse(final, final.colour)
    before_out, final_out = problem.holdout_rmse(before), problem.holdout_rmse(final)

    bounds = set(final.at_bounds())
    listed, runs_differ = [], []
    for effect, growing in steps:
        if effect in RUNS_OWN:
            runs_differ.append(runs_apart.entry(problem, final, effect, strength[effect], witnesses[effect]))
            continue
        probability = max(NAMED, witnesses[effect].probability())  # where less, what was not seen tells of it
        if bounds & {free.key for free in final.spec.free if free.effect == effect}:
            # what would be beyond it is no such effect
            probability = min(probability, PROBABLE)
        entry = {
            "name": effect,
            "rmse_c": statistics.rms(growing.residual),
            "holdout_rmse_c": problem.holdout_rmse(growing),
            "evidence": strength[effect],
            "parameters": parameters_of(problem, final, effect),
            "probability": probability,
            "certainty": "certain" if probability >= CERTAIN else "probable",
            "witness": asdict(witnesses[effect]),
            "on_chip": effect in effects.ON_CHIP,
            "in_words": effects.IN_WORDS[effect],
            "text": effects.sentence(effect, parameters_of(problem, final, effect), variant_of(final, effect)),
        }
        if variant := variant_of(final, effect):
            entry["variant"] = variant
        if effect in effects.WHY_NOT_ON_CHIP:
            entry["why_not_on_chip"] = effects.WHY_NOT_ON_CHIP[effect]
        listed.append(entry)

    share_with(listed, apart_from_final, EQUIVALENT * problem.noise_c)

    progress("what v / i says")
    second = None if swapped else resistance.witness(problem, final)
    impossible = doubt.impossible(second)
    if second and impossible:
        second |= {"effects": []}
    listed += [
        resistance.entry(one, statistics.rms(final.residual), final_out) for one in (second or {}).get("effects", [])
    ]

    rho = statistics.autocorrelation([r / n for r, n in zip(final.residual, problem.noise, strict=True)], 1)
    depends, note = depends_on(problem, final)
    warnings = [f"{Path(run.name).name}: {text}" for run in problem.runs for text in run.notes]
    warnings += not_kept
    if any(free.knot is not None for free in final.spec.free):
        warnings.append(f"model.toml: {DRIFT_LEFT_OUT}; log ambient_c to have it predicted")
    if left_over and problem.budget.short:
        warnings.append(
            f"the search ended at its bound of {problem.budget.enough} simulations: there may be more to find"
        )
    if left_over and not adopted:
        warnings += [
            f"{effect} ({effects.IN_WORDS[effect]}) would explain {one.share:.0%} of what is left, but not as well at all "
            f"times: {one.probability():.0%} likely, it is not named"
            for effect, one in witnesses.items()
            if one.share > MOST_OF_IT and effect in effects.IN_WORDS
        ]
    doubts = doubt.of_log(problem, problem.runs, swapped, (base,) if final is base else (base, final), left_over)
    warnings += doubts + impossible + doubt.about_power(problem) + plausibility.coarse(runs)
    if left_over:
        note = ("structure well above the noise remains that no effect of the library explains. " + note).strip()
    else:
        note = note or "white at the noise floor"
    absent = found.absent(final)
    if problem.colour is not None:
        slopes = problem.plain_slopes(final)
        problem.take_for(None)
        final = replace(final, jacobian=slopes)
    heat = unknown_heat.find(problem, final, progress)
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "tool": f"ninespring {__version__}",
        "logs": [{"file": Path(r.name).name, "sha256": r.sha256, "rows": len(r.time_s)} for r in runs],
        "baseline": {
            "rmse_c": statistics.rms(before.residual),
            "holdout_rmse_c": before_out,
            "noise_c": problem.noise_c,
            "parameters": parameters_of(problem, before),
            "effects": list(base.spec.effects),
        },
        "effects": listed,
        "rivals": apart_from_final,
        "after": {
            "rmse_c": statistics.rms(final.residual),
            "holdout_rmse_c": final_out,
            "parameters": parameters_of(problem, final),
        },
        **({"unseen": headline} if headline else {}),
        "unexplained": bool(left_over),
        "unknown_heat": heat.as_dict(),
        "runs_differ": runs_differ,
        "unnamed": [
            one.as_dict()
            for one in unnamed.drifts(hidden)
            if one.possible and (one.cause.kind in unnamed.UNITS or abs(one.size) >= LEAST_PART)
        ],
        **(
            {"resistance": {key: one for key, one in second.items() if key not in ("effects", "contacts")}}
            if second
            else {}
        ),
        "residual": {
            "autocorrelation_lag1": float(np.clip(rho[1], -1.0, 1.0)),
            "structure_c": math.sqrt(excess(problem, final)) * problem.noise_c,
            "rmse_per_spring_c": [finite(v) for v in doubt.per_spring(final.residual)],
            "noise_per_spring_c": [
                finite(v) for v in np.sqrt(np.nanmean(np.square(np.asarray(problem.noise)), axis=0))
            ],
            "depends_on": depends,
            "note": note,
        },
        "candidates": tried[:40],
        "identifiability": {
            "not_identifiable": sorted(set(final.stuck)),
            "at_bounds": final.at_bounds(),
            "correlated": [{"a": a, "b": b, "correlation": r} for a, b, r in final.correlations()],
        },
        "warnings": warnings,
        "doubts": doubts,
        "seconds": round(time.monotonic() - begun, 2),
        "simulations": problem.simulations,
    }
    made = model_of(problem, final, as_shown(problem, final), result, absent)
    resistance.into_model(made, second)
    doubt.into_model(made, problem, final, doubts)
    judged(result["effects"], made)
    validate(result)
    return Diagnosis(result, made, problem, base, final, heat)


def _where_something_is_left(
    problem: Problem, first: search.Search, final: Fit, without: dict[str, Fit], contenders: list[tuple[str, Fit]]
) -> unnamed.Beside:
    """Search again, beside causes without a name and with what is left taken for noise that lasts: the likeliest of all."""
    plain: unnamed.Beside = (first, (final, without, contenders), [])
    beside = unnamed.search_beside(problem, first, final) or plain
    if not all(one.possible for one in beside[2]):
        problem.leave_out(None)
        beside = plain
    hidden, taken = beside[2], (problem.unnamed, problem.heat)
    nats = lasting.nats_beside(problem, beside[1][0], hidden, unnamed.KINDS)
    problem.leave_out(None)
    if hidden and lasting.nats_beside(problem, final, (), 1) > nats:
        beside, hidden, taken = plain, [], (None, None)
        nats = lasting.nats_beside(problem, final, (), 1)
    first.progress("noise that lasts")
    searched, result = lasting.search_lasting(problem, first, final)
    if lasting.nats_beside(problem, result[0], (), 1) > nats:
        return searched, result, []
    problem.unnamed, problem.heat = taken
    problem.take_for(None)
    return beside


def finite(value: float) -> float | None:
    """Return the number, None where it is none (JSON has no NaN)."""
    return float(value) if math.isfinite(value) else None


def schema() -> dict[str, Any]:
    """Return the JSON schema of diagnosis.json."""
    return json.loads((resources.files("ninespring.verdict") / "diagnosis.schema.json").read_text("utf-8"))


def validate(result: Mapping[str, Any]) -> None:
    """Check a result against the schema."""
    jsonschema.validate(result, schema())


def fit_effects(
    array: Array,
    runs: Sequence[Run],
    wanted: Sequence[str],
    progress: Callable[[str], None] = lambda text: None,
    declared: Mapping[str, float] | None = None,
) -> tuple[Problem, Fit, Fit]:
    """Fit the declared model with the effects named; return the problem, the fit and the declared model's fit."""
    with threadpool_limits(1):
        problem = prepare(array, runs, declared)
        known = effects.candidates(problem)
        base = first_fit(problem, base_spec(problem))
        found = search.Search(problem, known, base, progress)
        fit = base
        for effect in wanted:
            screen = found.screen(fit)
            options = [k for k, c in enumerate(screen.candidates) if c.effect == effect]
            if not options:
                raise InputError(f"{effect} cannot show in these logs: nothing in them depends on it")
            best = max(options, key=lambda k: screen.forecast([k])[0])
            progress(f"fitting {effect}")
            fit = found.refit(fit, [screen.candidates[best]], [screen.forecast([best])[1].get(best, 1.0)])
        problem.learn_power(fit.spec, fit.values)
        return problem, _finish(problem, fit), base
