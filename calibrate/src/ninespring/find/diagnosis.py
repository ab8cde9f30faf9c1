"""The diagnosis: fit what is declared, look at what is left, find what is missing, say what cannot be told apart."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from ..errors import InputError
from ..export.settings import judged
from ..infer.declared import base_spec
from ..infer.fit import Fit
from ..infer.problem import Problem
from ..infer.result import DRIFT_LEFT_OUT, as_shown, model_of, parameters_of
from ..infer.scene import scene_of
from ..io import results, statistics
from ..io.logs import condense
from ..io.logs.run import Run
from ..model import effects
from ..model.effects.sensor_gain import GAIN, OR_ITS_SPRING, or_its_spring
from ..model.effects.spring_mismatch import EACH
from ..model.models import Array, Model
from ..model.spec import RUN_AMBIENT, RUNS_OWN, Spec
from . import (
    contacts,
    doubt,
    experiments,
    lasting,
    loose,
    plausibility,
    resistance,
    rested,
    runs_apart,
    search,
    unknown_heat,
    unnamed,
    unseen,
)
from .certainty import CERTAIN, NAMED, PROBABLE, Witness, witness
from .evidence import EQUIVALENT, difference, excess, log_evidence, unexplained
from .residual import depends_on

MOST_ROWS, MOST_READINGS = 3_000, 27_000
"""Of all logs that are fitted: what takes minutes to settle needs no more rows of hours, and each is simulated ten thousand times; of all
their springs: a diagnosis keeps the slopes of some fifty fits, 1 GB of them."""
MOST_OF_IT = 0.5
"""Part of what is beyond the noise without an effect that it explains, where more is explained than left."""
ACCOUNTS = 4
"""Of what was fitted, the likeliest accounts of which one may foretell best."""
LEAST_PART = 0.01
"""Of a drive or a reading, less is not told as a cause: a board measures power no better, its voltages step by 4 mV."""


@dataclass
class Diagnosis:
    """Everything a diagnosis found: what is told of it and what the report draws."""

    told: results.Diagnosis
    model: Model
    problem: Problem
    baseline: Fit
    final: Fit
    """What was found."""
    shown: Fit
    """What the logs are told of by: that, or what is given instead."""
    heat: unknown_heat.UnknownHeat

    @property
    def effects(self) -> list[str]:
        """Names of what was found, strongest first."""
        return [one.name for one in self.told.effects]

    @functools.cached_property
    def result(self) -> dict[str, Any]:
        """What diagnosis.json holds."""
        return results.plain(self.told)

    def __repr__(self) -> str:
        before, after = self.told.baseline.rmse_c, self.told.after.rmse_c
        return f"<diagnosis: {', '.join(self.effects) or 'nothing found'}; {before:.2f} K before, {after:.2f} K after>"


def prepare(array: Array, runs: Sequence[Run], declared: Mapping[str, float] | None = None) -> Problem:
    """Return the problem of these runs, condensed where they are long."""
    rows = min(MOST_ROWS, MOST_READINGS // array.springs)
    share = max(600, rows // max(1, len(runs)))
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
    """Return a fit at its minimum, with the errors of its numbers."""
    if fit.covariance is not None:
        return fit
    again = problem.fit(fit.spec, fit.as_dict(), tolerance=1e-6, errors=True)
    if again.chi2 <= fit.chi2 * (1 + 1e-6):
        return again
    fit = replace(fit)
    problem.add_errors(fit)
    return fit


def with_everything(problem: Problem, clean: Fit, base: Fit) -> Fit:
    """Return a fit that was made beside what has no name, with that in the error: the effects' numbers stay, with their
    errors, and the declared numbers, and those of a run alone, take up what they can.

    All are fitted again where that would leave more than the declared model alone does.
    """
    fit = problem.fit(unseen.pinned(clean).spec, clean.as_dict(), tolerance=1e-4, errors=True)
    if fit.sse > base.sse:
        return problem.fit(clean.spec, clean.as_dict(), tolerance=1e-4, errors=True)
    covariance = None  # that of the pinned numbers says how firmly they were held, not how well they are known
    if clean.covariance is not None and fit.covariance is not None:
        own = np.array([free.effect is None or free.run is not None for free in clean.spec.free])
        together = np.outer(own, own)
        covariance = np.where(together, fit.covariance, np.where(np.outer(~own, ~own), clean.covariance, 0.0))
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
        numbers = sum(len({given.get(name) for name in free.names} - {None}) == 1 for free in one.free)
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
        spec = replace(one, free=tuple(free)).added_to(spec)
    return spec


def rivals_of(
    found: search.Search,
    final: Fit,
    adopted: Sequence[str],
    contenders: Sequence[tuple[str, Fit]],
    progress: Callable[[str], None],
) -> list[results.Rival]:
    """Return what the data cannot tell from an effect that was named, each with the experiment that would."""
    problem = found.problem
    rivals: list[results.Rival] = []
    seen = set()
    for instead, other in sorted(contenders, key=lambda one: one[1].chi2):
        extra = [e for e in other.spec.effects if e not in final.spec.effects]
        if not extra and _another_law(final, other, instead):
            extra = [instead]
        if instead not in adopted or not extra or (instead, extra[0]) in seen:
            continue
        apart = difference(problem, final, other)
        ahead = log_evidence(problem, final, other)
        if ahead >= search.TOLD_APART and apart >= EQUIVALENT:
            continue
        seen.add((instead, extra[0]))
        progress(f"how to tell {extra[0]} from {instead}")
        experiment, in_words = experiments.separate(problem, final, other)
        other = _finish(problem, other)
        rivals.append(
            results.Rival(
                instead_of=instead,
                name=extra[0],
                variant=variant_of(other, extra[0]),
                rmse_c=statistics.rms(other.residual),
                holdout_rmse_c=problem.holdout_rmse(other),
                evidence=ahead,
                predictions_differ_c=apart * problem.noise_c,
                parameters=parameters_of(problem, other, extra[0]),
                separating_experiment=in_words,
                experiment=experiment,
            )
        )
    return rivals


def _another_law(one: Fit, other: Fit, effect: str) -> bool:
    """Return whether two fits have an effect with the same numbers by two laws."""
    keys = [{free.key for free in fit.spec.free if free.effect == effect} for fit in (one, other)]
    return keys[0] == keys[1] != set() and variant_of(one, effect) != variant_of(other, effect)


def share_with(listed: Sequence[results.Effect], rivals: Sequence[results.Rival], same_c: float) -> None:
    """Share what speaks for a named effect with rivals that show the same readings: only the two in combination are fixed. None is certain
    beside another that is not told apart.

    That one of them has fewer numbers makes it simpler, not truer.
    """
    for entry in listed:
        untold = [one for one in rivals if one.instead_of == entry.name and one.evidence < search.TOLD_APART]
        if any(one.name != entry.name for one in untold):
            entry.probability, entry.certainty = min(entry.probability, PROBABLE), "probable"
        alike = [one for one in untold if one.predictions_differ_c < same_c]
        if not alike:
            continue
        instead = [effects.sentence(one.name, one.parameters, one.variant or "") for one in alike]
        if others := sum(one.name != entry.name for one in alike):  # by another law it is the same name
            entry.probability /= 1 + others
            entry.certainty = "probable"
        how = "fix them only in combination" if others else "do not tell which"
        entry.text += f" Or: {' Or: '.join(instead)} These readings {how}."


def candidates_of(found: search.Search, final: Fit, base: Fit) -> list[results.Candidate]:
    """Return every model that the search fitted, the likeliest first."""
    candidates = [
        results.Candidate(
            effects=[f"{e} ({v})" if v else e for e, v in key],
            rmse_c=statistics.rms(fit.residual),
            evidence_over_baseline=float(log_evidence(found.problem, fit, base)),
            adopted=fit.spec.variant == final.spec.variant,
        )
        for key, fit in found.fits.items()
    ]
    return sorted(candidates, key=lambda one: -one.evidence_over_baseline)


@dataclass(kw_only=True)
class _Case:
    """A diagnosis under way: what was found so far."""

    problem: Problem
    search: search.Search
    """What found it, beside its base: what is declared, with what lasts taken for noise where something is left."""
    declared: Fit
    """The declared model alone."""
    final: Fit
    without: dict[str, Fit]
    """The final fit without each effect that it has found."""
    contenders: list[tuple[str, Fit]] = field(default_factory=list)
    swapped: list[str] = field(default_factory=list)
    """Columns that are, in words."""
    hidden: list[unnamed.Hidden] = field(default_factory=list)
    fits: Mapping[Any, Fit] = field(default_factory=dict)
    """By least squares, of the first search."""
    loose: list[loose.Loose] = field(default_factory=list)
    """Thermometers that were for a while, none of whose readings count then."""
    witnesses: dict[str, Witness] = field(default_factory=dict)
    not_kept: list[str] = field(default_factory=list)
    """Effects that foretell a run no better, in words."""
    instead: Fit | None = None
    """What is given because it foretells better than what was found, whose names stay, none that it has not for certain."""
    carried: Fit | None = None
    """What is given in place of the final fit where that foretells worse: without what is of that day."""

    @property
    def adopted(self) -> list[str]:
        """Effects that were found."""
        return [e for e in self.final.spec.effects if e not in self.declared.spec.effects]


_Account = tuple[_Case, search.Search, unseen.Unseen]
"""What was found, the search that judged it, and what it foretells."""


def _diagnose(
    array: Array, runs: Sequence[Run], model: Model | None, frozen: bool, progress: Callable[[str], None]
) -> Diagnosis:
    begun = time.monotonic()
    case, judge, judged_by = _foretelling(array, runs, model, frozen, progress)
    problem = case.problem
    progress("a run that the fit never saw")
    headline = _foretold(case, judge, judged_by)
    left_over = unexplained(problem, case.final) or bool(case.hidden)
    strength = {e: log_evidence(problem, case.final, case.without[e]) for e in case.adopted}
    steps = in_order(case.search, case.search.base, case.final, case.adopted)
    rivals = rivals_of(case.search, case.final, [effect for effect, _ in steps], case.contenders, progress)
    tried = candidates_of(case.search, case.final, case.search.base)
    if case.hidden:
        steps = _with_what_has_no_name(case, steps)
    listed, differ = _listed(case, steps, strength)
    share_with(listed, rivals, EQUIVALENT * problem.noise_c)
    absent = case.search.absent(case.final)
    given, after = _the_given(case, judged_by)
    # what is told of the logs, and of what is left of them, is told by the model that is given
    shown = given if case.instead else case.final
    # what is declared, by itself: by least squares, as anybody fits it
    baseline = results.Baseline(
        noise_c=problem.noise_c,
        effects=list(case.declared.spec.effects),
        **msgspec.structs.asdict(_after(problem, case.declared)),
    )
    progress("what v / i says")
    second = None if case.swapped else resistance.witness(problem, shown)
    impossible = doubt.impossible(second)
    if second and impossible:
        second.effects = []
    for one in second.effects if second else ():
        one.rmse_c, one.holdout_rmse_c = after.rmse_c, after.holdout_rmse_c
        listed.append(one)
    residual = _left(problem, shown, left_over)
    warnings, doubts = _warned(case, shown, runs, left_over, impossible)
    heat = unknown_heat.find(problem, shown, progress)
    told = results.Diagnosis(
        logs=[results.Read(file=Path(r.name).name, sha256=r.sha256, rows=len(r.time_s)) for r in runs],
        baseline=baseline,
        effects=listed,
        rivals=rivals,
        after=after,
        unseen=headline or results.UNSET,
        unexplained=bool(left_over),
        unknown_heat=heat.told(),
        runs_differ=differ,
        unnamed=[*(one.told() for one in case.loose), *(one.told() for one in case.hidden if _counts(one))],
        resistance=second.told if second else results.UNSET,
        residual=residual,
        candidates=tried[:40],
        identifiability=identifiability_of(shown),
        warnings=warnings,
        doubts=doubts,
        seconds=round(time.monotonic() - begun, 2),
        simulations=problem.simulations,
    )
    made = model_of(problem, given, as_shown(problem, given), baseline.rmse_c, absent if given is case.final else None)
    resistance.into_model(made, second)
    doubt.into_model(made, problem, given, doubts)
    judged(told.effects, made)
    results.checked(told)
    return Diagnosis(told, made, problem, case.declared, case.final, shown, heat)


def _foretelling(
    array: Array, runs: Sequence[Run], model: Model | None, frozen: bool, progress: Callable[[str], None]
) -> _Account:
    """Search by what has a name and is the same in all runs; where that leaves something, by all there is.

    What is of one day bends as it likes: it is the better account only where a run that was left out is not foretold better
    without it. (A cause without a name is in no model: what it leaves in such a run speaks for no stand-in.) Beside either, another of
    the likeliest accounts may foretell best: a model it may be, without naming anything.
    """

    left_out: list[loose.Loose] = []
    """Thermometers that are loose for a while, none of whose readings count then: told by what is the same in all runs."""

    def prepared(whole: bool = False) -> Problem:
        logs = runs if whole else [loose.without(run, r, left_out) for r, run in enumerate(runs)]
        return prepare(model.array if model else array, logs, dict(model.parameters) if model else {})

    def begun(alike: bool, fits: Mapping[Any, Fit] | None = None) -> _Begun:
        return _begun(prepared(), model, frozen, progress, alike, fits)

    def searched(alike: bool) -> _Case:
        first = begun(alike)
        while len(left_out) < loose.MOST and (one := _loose(first)):
            left_out.append(one)
            first = begun(alike)  # what was found with such readings is found anew
        case = _searched(first, alike)
        if left_out:
            whole, many = prepared(whole=True).runs, len(left_out)
            left_out[:] = [own for one in left_out if (own := loose.seen_by(case.problem, whole, case.final, one))]
            if len(left_out) < many:
                # a model that never saw some of these readings has them right: they count
                case = _searched(begun(alike), alike)
        return case

    def account(alike: bool, fits: Mapping[Any, Fit] | None = None) -> _Account:
        case = searched(alike) if fits is None else _searched(begun(alike, fits), alike)
        case.loose = list(left_out)
        judged_by = unseen.Unseen(case.problem, case.search, case.declared)
        return case, _judged(case, judged_by), judged_by

    if frozen:
        return account(False)
    if len(runs) == 1:
        plain = account(False)
        beside = _rested(plain[0], prepared)
        return beside if beside is not None and _rather(beside, plain) else plain
    same = account(True)
    if not unexplained(same[0].problem, same[0].final):
        return same
    progress("what is of one day, or has no name")
    found = account(False, same[0].fits)
    # what bent may have been dropped since, and nothing be left in its place
    instead = set(same[0].adopted) - set(found[0].adopted) if not found[0].hidden else ()
    taken = same if instead and _off(*same) * unseen.WORSE < _off(*found) else found
    taken[2].accounts = _accounts(same[0])
    return taken


def _accounts(case: _Case) -> list[Fit]:
    """Return the likeliest accounts that were fitted, each at its minimum by least squares: what a part of the runs hardly shows stays
    there."""
    problem = case.problem
    fits = [*case.fits.values(), *case.search.fits.values()]
    alike = [fit for fit in fits if not any(unseen.of_that_day(*one) for one in fit.spec.variant)]
    likely: dict[Any, Fit] = {}
    for fit in sorted(alike, key=lambda one: log_evidence(problem, one, case.declared), reverse=True):
        likely.setdefault(case.search.key(fit.spec), fit)
    colour = problem.colour
    problem.take_for(None)
    best = list(likely.values())[:ACCOUNTS]
    out = [problem.fit(one.spec, one.as_dict(), tolerance=1e-4, near=_plain(one)) for one in best]
    problem.take_for(colour)
    return out


def _plain(fit: Fit) -> Fit | None:
    """Return a fit that was made by least squares of readings as they are, None where it was not."""
    return fit if fit.weighed is None else None


def _rested(plain: _Case, prepared: Callable[[], Problem]) -> _Account | None:
    """Return another account of a run alone whose springs do not rest where its room was logged: from there; None where it has that
    room and an alloy, nothing is left, or that room is not needed."""
    alloys = {c.effect for c in rested.alloys(plain.search.candidates)}
    if plain.hidden or rested.off_k(plain.search) is None or not unexplained(plain.problem, plain.final):
        return None
    if RUN_AMBIENT in plain.adopted and alloys & set(plain.adopted):
        return None
    problem = prepared()
    first = search.Search(
        problem, plain.search.candidates, first_fit(problem, plain.declared.spec), plain.search.progress
    )
    judged_by = unseen.Unseen(problem, first, first.base)
    searched = rested.search_rested(first, judged_by)
    if searched is None:
        return None
    found, final, without = searched
    final = _finish(problem, final)
    case = _Case(
        problem=problem,
        search=found,
        declared=first.base,
        final=final,
        without=without,
        swapped=plain.swapped,
        loose=plain.loose,
    )
    case.witnesses = {effect: witness(problem, final, effect, other, False) for effect, other in without.items()}
    return case, found, judged_by


def _rather(one: _Account, other: _Account) -> bool:
    """Return whether an account foretells the rest of a run better than another, or is likelier and foretells it as well."""
    off, beside = _off(*one), _off(*other)
    likelier = log_evidence(one[0].problem, one[0].final, other[0].final) > 0.0
    return off * unseen.WORSE < beside or (likelier and off <= beside * unseen.WORSE)


def _off(case: _Case, judge: search.Search, judged_by: unseen.Unseen) -> float:
    """Return the error, degC rms, by which an account foretells runs left out, without what no other run tells."""
    return judged_by.own(judged_by.carried(case.final, judge.reduced))


@dataclass
class _Begun:
    """A library searched once, by least squares."""

    problem: Problem
    progress: Callable[[str], None]
    base: Fit
    search: search.Search
    found: unnamed.Found
    fits: Mapping[Any, Fit]
    swapped: list[str]
    everything: list[effects.Candidate]


def _loose(begun: _Begun) -> loose.Loose | None:
    """Return the thermometer that is loose for a while by what was found, if something is left and one is."""
    if begun.swapped or not unexplained(begun.problem, begun.found[0]):
        return None
    begun.progress("a thermometer that comes loose")
    return loose.find(begun.problem, begun.found[0])


def _begun(
    problem: Problem,
    model: Model | None,
    frozen: bool,
    progress: Callable[[str], None],
    alike: bool,
    fits: Mapping[Any, Fit] | None = None,
) -> _Begun:
    """Fit what is declared, and search the library; again where contacts changed.

    `alike` by what has a name and is the same in all runs; `fits` were made by another search of these logs.
    """
    progress("fitting what is declared")
    spec = base_spec(problem, frozen)
    scene = scene_of(problem)
    known = effects.candidates(scene)
    if model:
        each = effects.of_springs(scene)
        spec = with_effects_of(spec, model, [*known, *([each] if each else [])], frozen)
    base = first_fit(problem, spec)
    own = effects.of_runs(scene)
    everything = known = [c for c in (*known, *own) if c.effect not in spec.effects]
    if alike:
        known = [c for c in known if not unseen.of_that_day(c.effect, c.variant)]
    found = search.Search(problem, known, base, progress, dict(fits or {}))
    result = found.run()
    fits = found.fits
    progress("what v / i says")
    swapped = plausibility.swapped(problem.runs)
    # beside another spring's temperature v / i would only accuse contacts
    second = None if swapped else resistance.witness(problem, result[0])
    if second and second.contacts:
        # v i is measured with the contact: its heat is not the spring's, and everything is looked for again without it
        contacts.take_heat_out(problem, second.contacts)
        base = first_fit(problem, spec)
        found = search.Search(problem, found.candidates, base, progress)
        result = found.run()
        fits = {}
    problem.learn_power(result[0].spec, result[0].values)
    return _Begun(problem, progress, base, found, result, fits, swapped, everything)


def _searched(begun: _Begun, alike: bool) -> _Case:
    """Search again where something is left."""
    problem, progress, base, swapped = begun.problem, begun.progress, begun.base, begun.swapped
    found, (final, without, contenders) = begun.search, begun.found
    hidden: list[unnamed.Hidden] = []
    if not swapped and unexplained(problem, final):
        found, (final, without, contenders) = _springs_apart(problem, found, (final, without, contenders))
    if not swapped and unexplained(problem, final):
        found, (final, without, contenders), hidden = _where_something_is_left(
            problem, found, (final, without, contenders), alike
        )
    if alike and not unexplained(problem, final):
        # what is of one day may show the same, or the little that is left
        found = search.Search(problem, begun.everything, found.base, progress, found.fits)
        final, without, contenders = found.settle(found.forward(final), grow=False)
    progress("held-out blocks")
    final = _finish(problem, final)
    return _Case(
        problem=problem,
        search=found,
        declared=base,
        final=final,
        without=without,
        contenders=contenders,
        swapped=swapped,
        hidden=hidden,
        fits=begun.fits,
    )


def _doubtful(case: _Case, judged_by: unseen.Unseen, fresh: Sequence[str]) -> list[str]:
    """Return which of the names that were not judged before are not sure enough."""
    problem, witnesses = case.problem, case.witnesses
    # where the ambient was not logged, that it drifted is no stand-in
    guessed = all(run.ambient_c is None for run in problem.runs)
    free_to_bend = (*RUNS_OWN, *(["ambient_drift"] if guessed else []))
    likely = case.final if case.hidden else lasting.likeliest(problem, case.final)
    enough = dict.fromkeys(fresh, True)
    for effect in fresh:
        flexible = case.search.is_flexible(case.final, effect) and effect not in free_to_bend
        witnesses[effect] = witness(problem, case.final, effect, case.without[effect], flexible)
        if not case.hidden:
            # each account at its likeliest: what least squares made of the one without it is no evidence
            nats = log_evidence(problem, likely, lasting.likeliest(problem, case.without[effect]))
            witnesses[effect] = msgspec.structs.replace(witnesses[effect], nats=nats)
            enough[effect] = nats - case.search.price() >= search.MIN_EVIDENCE
    # beside causes without a name that leave structure themselves, a name must explain more than it leaves
    least = MOST_OF_IT if case.hidden and unexplained(problem, case.final) else 0.0
    return [
        effect
        for effect in fresh
        if not enough[effect]
        or (
            (witnesses[effect].probability() < NAMED or witnesses[effect].share < least)
            and (case.hidden or not judged_by.tells(case.final, case.without[effect]))
        )
    ]


def _judged(case: _Case, judged_by: unseen.Unseen) -> search.Search:
    """Drop the names that are not sure enough, and search for what they stood in for; return the last search."""
    judge = case.search
    while fresh := [effect for effect in case.without if effect not in case.witnesses]:
        doubtful = _doubtful(case, judged_by, fresh)
        if not doubtful:
            break
        # judged together, beside one another: what one of them stood in for does not count against the rest
        final = case.final
        for effect in doubtful:
            final = judge.reduced(final, effect)
        # another may be what it stood in for
        others = [one for one in judge.candidates if one.effect not in doubtful]
        judge = search.Search(case.problem, others, case.search.base, case.search.progress, case.search.fits)
        final, case.without, case.contenders = judge.settle(judge.forward(final))
        case.final = _finish(case.problem, final)
    return judge


def _of_account(case: _Case, judged_by: unseen.Unseen, account: Fit) -> search.Search:
    """Name what is sure of an account that foretells runs left out better than what was found; return a search that begins there."""
    judge = _by_least_squares(case, account)
    case.witnesses, case.contenders = {}, []
    final = case.final
    for effect in _doubtful(case, judged_by, case.adopted):
        final = judge.reduced(final, effect)
    case.final = _finish(case.problem, final)
    case.without = {effect: judge.reduced(case.final, effect) for effect in case.adopted}
    return judge


def _foretold(case: _Case, judge: search.Search, judged_by: unseen.Unseen) -> results.Unseen | None:
    """Drop what foretells a run that the fit never saw worse; return how well such a run is foretold."""
    problem = case.problem
    if case.hidden:
        return _given(case, judged_by, unseen.pinned(judged_by.carried(case.final, judge.reduced)))
    if problem.colour is not None and len(problem.runs) > 1:
        bare = judged_by.carried(case.final, judge.reduced)
        if judged_by.rmse(bare) < judged_by.own(bare):
            judge = _by_least_squares(case, case.final)
    account = judged_by.instead if judged_by.accounts else judged_by.plain
    given = judged_by.given(case.final, judged_by.carried(case.final, judge.reduced))
    if account is not judged_by.plain and judged_by.given_worse(given):
        judge = _of_account(case, judged_by, account)
    why = ""
    kept, case.not_kept = judged_by.kept(case.final, judge.reduced)
    if kept is None:
        # as anybody fits it, by least squares: nothing that is known of its errors predicts better
        problem.take_for(None)
        case.search = judge = search.Search(problem, case.search.candidates, case.declared, case.search.progress)
        kept, case.contenders = judged_by.refitted(judge, judged_by.plain), []
        why = "nothing else that was tried predicts as well"
        # a lag that foretells better is in the model; a name it is where it explains what a name must
        named = kept is case.declared or judge.worth(kept, case.declared)
        case.instead = judged_by.instead if not named or judged_by.instead is not judged_by.plain else None
        kept = kept if named else case.declared
    if case.not_kept or why:
        case.final = _finish(problem, kept)
        case.without = {effect: judge.reduced(case.final, effect) for effect in case.adopted}
        for effect, without in case.without.items():
            case.witnesses.setdefault(effect, witness(problem, case.final, effect, without, False))
    if why:
        return judged_by.told(judged_by.instead, why)
    carried = judged_by.carried(case.final, judge.reduced)
    given = judged_by.given(case.final, carried)
    case.carried = None if given is case.final else _finish(problem, given)
    return _given(case, judged_by, given)


def _by_least_squares(case: _Case, found: Fit) -> search.Search:
    """Take for found what was, fitted by least squares again; return a search that begins there.

    What a model lacks is no noise: where it lasts, numbers that take it for noise follow quick changes alone, and a run is foretold
    by the slow ones, too. The names are those that the likelihood found.
    """
    problem = case.problem
    problem.take_for(None)
    known = {key: fit for key, fit in case.fits.items() if _plain(fit) and EACH not in dict(key).values()}
    case.search = search.Search(problem, case.search.candidates, case.declared, case.search.progress, known)

    def again(fit: Fit) -> Fit:
        same = known.get(case.search.key(fit.spec))
        return same or problem.fit(fit.spec, fit.as_dict(), tolerance=1e-3, near=_plain(fit))

    final, *others = [again(fit) for fit in (found, *(fit for _, fit in case.contenders))]
    case.contenders = [(effect, fit) for (effect, _), fit in zip(case.contenders, others, strict=True)]
    case.final = _finish(problem, final)
    case.without = {effect: case.search.reduced(case.final, effect) for effect in case.adopted}
    return case.search


def _given(case: _Case, judged_by: unseen.Unseen, fit: Fit) -> results.Unseen | None:
    """Return how well a run is foretold by what was found or, where that foretells worse, by what is given instead."""
    if not (judged_by.worse(fit) or judged_by.given_worse(fit)):
        return judged_by.told(fit)
    case.instead = judged_by.instead
    why = f"with what was found it would be {judged_by.foretells(fit, judged_by.problem.colour):.2f} K"
    return judged_by.told(case.instead, why)


def _with_what_has_no_name(case: _Case, steps: list[tuple[str, Fit]]) -> list[tuple[str, Fit]]:
    """Return the steps with everything in the error again: a model is for an array in which what has no name still acts."""
    case.problem.leave_out(None)
    again = {
        id(fit): with_everything(case.problem, fit, case.declared) for fit in [case.final, *(fit for _, fit in steps)]
    }
    case.final = again[id(case.final)]
    return [(effect, again[id(fit)]) for effect, fit in steps]


def _the_given(case: _Case, judged_by: unseen.Unseen) -> tuple[Fit, results.After]:
    """Return the model that is given and its errors; what follows weighs readings as white noise.

    What was found keeps its name and numbers where another model is given instead, and says nothing of the logs: its errors, where what
    lasts was taken for noise, may be many times as large.
    """
    problem = case.problem
    if case.instead is None:
        after = _after(problem, case.final)
    if problem.colour is not None:
        slopes = problem.plain_slopes(case.final)
        problem.take_for(None)
        case.final = replace(case.final, jacobian=slopes, weighed=None)
    if case.instead is None:
        return case.carried or case.final, after
    again = search.Search(problem, case.search.candidates, case.declared)
    given = _finish(problem, judged_by.refitted(again, case.instead))
    return given, _after(problem, given)


def _after(problem: Problem, fit: Fit) -> results.After:
    return results.After(
        rmse_c=statistics.rms(fit.residual),
        holdout_rmse_c=problem.holdout_rmse(fit),
        parameters=parameters_of(problem, fit),
    )


def _at_an_end(fit: Fit, effect: str) -> bool:
    """Return whether a number of an effect lies at its bound, beyond which would be no such effect; or a room, for which anything may
    make up."""
    return any(
        free.effect == effect or free.key.startswith("ambient_c@")
        for free in fit.spec.free
        if free.key in fit.at_bounds()
    )


def _listed(
    case: _Case, steps: Sequence[tuple[str, Fit]], strength: Mapping[str, float]
) -> tuple[list[results.Effect], list[results.RunsDiffer]]:
    """Return the effects of the array, the one that explains most first, and what is a run's own."""
    problem, final = case.problem, case.final
    listed, differ = [], []
    for effect, growing in steps:
        sure = case.witnesses[effect]
        if effect in RUNS_OWN:
            differ.append(runs_apart.entry(problem, final, effect, strength[effect], sure))
            continue
        probability = max(NAMED, sure.probability())  # where less, what was not seen tells of it
        if _at_an_end(final, effect) or (case.instead is not None and effect not in case.instead.spec.effects):
            probability = min(probability, PROBABLE)
        parameters, variant = parameters_of(problem, final, effect), variant_of(final, effect)
        text = effects.sentence(effect, parameters, variant)
        if effect == GAIN and or_its_spring(variant, final.spec.effects, {run.mode for run in problem.runs}):
            probability, text = min(probability, PROBABLE), f"{text} {OR_ITS_SPRING}"
        listed.append(
            results.Effect(
                name=effect,
                rmse_c=statistics.rms(growing.residual),
                holdout_rmse_c=problem.holdout_rmse(growing),
                evidence=strength[effect],
                parameters=parameters,
                probability=probability,
                certainty="certain" if probability >= CERTAIN else "probable",
                witness=sure,
                on_chip=effect in effects.ON_CHIP,
                in_words=effects.in_words(effect, variant),
                text=text,
                variant=variant or results.UNSET,
            )
        )
    return listed, differ


def _left(problem: Problem, final: Fit, left_over: bool) -> results.Residual:
    """Return what is left, what it depends on, and that in words."""
    rho = statistics.autocorrelation([r / n for r, n in zip(final.residual, problem.noise, strict=True)], 1)
    depends, note = depends_on(problem, final)
    structure_c = math.sqrt(excess(problem, final)) * problem.noise_c
    if left_over:
        note = (
            f"structure of {structure_c:.2g} K rms remains, beside noise of {problem.noise_c:.2g} K, that no effect of the library "
            f"explains. {note}"
        ).strip()
    noise = np.sqrt(np.nanmean(np.square(np.asarray(problem.noise)), axis=0))
    return results.Residual(
        autocorrelation_lag1=float(np.clip(rho[1], -1.0, 1.0)),
        structure_c=structure_c,
        rmse_per_spring_c=[finite(v) for v in doubt.per_spring(final.residual)],
        noise_per_spring_c=[finite(v) for v in noise],
        depends_on=depends,
        note=note or "white at the noise floor",
    )


def _warned(
    case: _Case, shown: Fit, runs: Sequence[Run], left_over: bool, impossible: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Return what is to be said of the logs by the model that is given, and for which of it `export` refuses that."""
    problem, base = case.problem, case.declared
    warnings = [f"{Path(run.name).name}: {text}" for run in problem.runs for text in run.notes]
    warnings += case.not_kept
    if any(free.knot is not None for free in shown.spec.free):
        logged = all(run.ambient_c is not None for run in problem.runs)
        how = "log ambient_c nearer to the springs (their own thermometers, drifting, show the same)"
        warnings.append(f"model.toml: {DRIFT_LEFT_OUT}; {how if logged else 'log ambient_c'} to have it predicted")
    if left_over and problem.budget.short:
        warnings.append(
            f"the search ended at its bound of {problem.budget.enough} simulations: there may be more to find"
        )
    if (off_k := rested.off_k(case.search)) is not None and RUN_AMBIENT not in case.final.spec.effects:
        warnings.append(
            f"before anything was driven the springs read {abs(off_k):.1f} K {'more' if off_k > 0 else 'less'} than ambient_c: "
            "what they lose heat to is not where it was logged, or a thermometer is off; how much of that lasts is not told here"
        )
    if left_over and not case.adopted:
        warnings += [
            f"{effect} ({effects.IN_WORDS[effect]}) would explain {one.share:.0%} of what is left, but not as well at all "
            f"times: {one.probability():.0%} likely, it is not named"
            for effect, one in case.witnesses.items()
            if one.share > MOST_OF_IT and effect in effects.IN_WORDS
        ]
    doubts = doubt.of_log(problem, problem.runs, case.swapped, (base,) if shown is base else (base, shown), left_over)
    return warnings + doubts + [*impossible, *doubt.not_logged(problem, shown), *plausibility.coarse(runs)], doubts


def _counts(one: unnamed.Hidden) -> bool:
    """Return whether a cause without a name is told: it can be, and a board would measure as much."""
    return one.possible and (one.cause.kind in unnamed.UNIT or abs(one.size) >= LEAST_PART)


def identifiability_of(fit: Fit) -> results.Identifiability:
    """Return which numbers of a fit the data do not fix."""
    return results.Identifiability(
        not_identifiable=sorted(set(fit.stuck)),
        at_bounds=fit.at_bounds(),
        correlated=[results.Correlation(a=a, b=b, correlation=r) for a, b, r in fit.correlations()],
    )


def _springs_apart(
    problem: Problem, first: search.Search, before: unnamed.Found
) -> tuple[search.Search, unnamed.Found]:
    """Search again beside springs of which each is its own, as far apart as they are found, instead of one that is; as it was where
    that is not likelier.

    Laws of all springs come first: they stay as long as springs would have to lie further apart without.
    """
    plain, final = (first, before), before[0]
    scene = scene_of(problem)
    each = effects.of_springs(scene)
    if each is None or each.effect in first.base.spec.effects:
        return plain
    first.progress("each spring by itself")
    bare = first.reduced(final, each.effect) if each.effect in final.spec.effects else final
    found = search.Search(problem, first.candidates, first.base, first.progress, first.fits)
    fit = found.refit(bare, [each], [1.0])
    if log_evidence(problem, fit, final) < search.TOLD_APART:
        return plain
    each = effects.of_springs(scene, runs_apart.springs_apart(fit, each))
    found = search.Search(
        problem,
        [*first.candidates, each],
        first.base,
        first.progress,
        {key: one for key, one in first.fits.items() if (each.effect, each.variant) not in key},
    )
    fit = found.refit(bare, [each], [1.0])
    result = found.settle(found.forward(found.backward(fit)[0]), grow=False)
    return (found, result) if log_evidence(problem, result[0], final) > 0.0 else plain


def _where_something_is_left(
    problem: Problem, first: search.Search, before: unnamed.Found, named: bool
) -> unnamed.Beside:
    """Search again, beside causes without a name (unless only what is named counts) and with what is left taken for noise that
    lasts: the likeliest of all."""
    plain: unnamed.Beside = (first, before, [])
    final = before[0]
    beside = (None if named else unnamed.search_beside(problem, first, final)) or plain
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


def fit_effects(
    array: Array,
    runs: Sequence[Run],
    wanted: Sequence[str],
    progress: Callable[[str], None] = lambda text: None,
    model: Model | None = None,
) -> tuple[Problem, Fit, Fit]:
    """Fit the declared model, or one that is given, with the effects named beside its own; return the problem, the fit and the declared model's fit.

    What of them no temperature shows, but v / i may, is in neither: `by_resistance` has it.
    """
    with threadpool_limits(1):
        problem = prepare(array, runs, model.parameters if model else None)
        known = effects.candidates(scene_of(problem))
        spec = base_spec(problem)
        base = first_fit(problem, with_effects_of(spec, model, known, False) if model else spec)
        found = search.Search(problem, known, base, progress)
        fit = base
        for effect in (one for one in wanted if one not in base.spec.effects):
            screen = found.screen(fit)
            options = [k for k, c in enumerate(screen.candidates) if c.effect == effect]
            if not options and effect in resistance.OF_THE_WIRE:
                continue
            if not options:
                raise _cannot_show(effect, runs)
            best = max(options, key=lambda k: screen.forecast([k])[0])
            progress(f"fitting {effect}")
            fit = found.refit(fit, [screen.candidates[best]], [screen.forecast([best])[1].get(best, 1.0)])
        problem.learn_power(fit.spec, fit.values)
        return problem, _finish(problem, fit), base


def by_resistance(problem: Problem, fit: Fit, wanted: Sequence[str]) -> resistance.Second | None:
    """Return what v / i says of effects that are wanted and that no temperature shows, as a diagnosis says it; None where none is.

    Refused where v / i does not show one of them, too.
    """
    missing = [effect for effect in wanted if effect not in fit.spec.effects]
    if not missing:
        return None
    second = resistance.witness(problem, fit)
    named = {one.name for one in second.effects} if second else set()
    if second and (why := doubt.impossible(second)):
        raise InputError(why[0], problem.runs[0].name)
    for effect in missing:
        if effect not in named:
            raise _cannot_show(effect, problem.runs)
    if "resistance_phase" not in missing:
        raise InputError(
            f"{missing[0]}: v / i tells it beside resistance_phase, and a model has both or none of them",
            problem.runs[0].name,
        )
    kept = [one for one in second.effects if one.name in missing] if second else []
    return replace(second, effects=kept) if second else None


def _cannot_show(effect: str, runs: Sequence[Run]) -> InputError:
    more = f", nor in {len(runs) - 1} more" if len(runs) > 1 else ""
    seen = "nothing in it depends on it"
    if effect in resistance.OF_THE_WIRE:
        seen = "no temperature depends on it, and v / i tells it of springs that stay in each phase for half a minute"
    if effect == "holder_mass" and runs[0].springs == 1:
        seen = "what a spring alone is mounted on is plate_conduction, which the chip has"
    return InputError(f"{effect} cannot show here{more}: {seen}", runs[0].name)
