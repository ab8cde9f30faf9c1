"""A run that the fit never saw, predicted: by what was found, by the declared model and by that with a lag, each fitted to the rest.

Of several runs each is left out in turn (MOST of them); of one alone its last part, a half and a third of it. What is a run's own (its room where none
was logged, its drift) is not carried over: a room is told by the run's first minute, as `predict` does. What is then off because the room is
known no better counts in what is told, not in what models are judged by.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..infer import room
from ..infer.fit import Fit
from ..infer.likelihood import Colour
from ..infer.problem import BLOCK_S, HARDLY, Problem
from ..io import results
from ..io.logs.run import Run
from ..io.statistics import rms
from ..model.effects.runs_differ import ALIKE
from ..model.simulate import settles_s, simulate_run
from ..model.spec import RUN_AMBIENT, RUN_SENSOR, RUNS_OWN, Free, Spec
from .evidence import EQUIVALENT
from .search import Search

MOST = 3
"""Runs that are left out, each in turn, at most."""
SEEN = (1.0 / 2.0, 2.0 / 3.0)
"""Parts of a run alone that are fitted, the rest of it predicted: what a last third alone says of a model is chance."""
WORSE = 1.05
"""Of an error, so much more is worse; less is chance."""
FORETOLD = 0.5
"""Part of the squared error in the unseen that is left at most with an effect that is there, whatever else is said of it."""
PART = 2.0 / 3.0
"""The same of one of many effects that are there."""
COMES_TRUE = 0.75
"""Part of what an effect changes in the unseen that must come true: all of it does of a cause, a half where the unseen is foretold no
better than without it. What only takes something else's place is between the two or below."""
PINNED = 1e-5
"""Spread, in a number's inner coordinate, that leaves it where it is."""
STEPS = 25
"""Of one fit, at most: it begins where the whole data had it."""
LAG = "sensor_lag"
WITH_LAG = " with a lag"
OF_THAT_DAY = (*RUNS_OWN, "ambient_drift")
"""Effects that no other run can tell, but in the variant that is the same in all: it has its own."""


def of_that_day(effect: str, variant: str) -> bool:
    """Return whether an effect is of a run's day alone."""
    return effect in OF_THAT_DAY and variant != ALIKE


@dataclass(frozen=True)
class Split:
    """Runs to fit, and the one to predict."""

    problem: Problem
    kept: tuple[int, ...]
    left_out: Run
    counts: np.ndarray
    """(rows, springs): where the left-out run's error counts."""
    alone: bool = False


def splits(problem: Problem) -> list[Split]:
    """Return the ways in which a problem's runs are fitted and predicted."""
    runs = problem.runs
    if len(runs) == 1:
        return [split for seen in SEEN if (split := _ahead(problem, seen)) is not None]
    out = []
    for r in range(max(0, len(runs) - MOST), len(runs)):
        kept = [k for k in range(len(runs)) if k != r]
        part = _problem(problem, [runs[k] for k in kept], kept)
        out.append(Split(part, tuple(kept), runs[r], problem.mask[r]))
    return out


def _ahead(problem: Problem, seen: float) -> Split | None:
    """Return a run alone, its first part to fit and the rest to predict; None where either has no readings."""
    run = problem.runs[0]
    late = run.time_s - run.time_s[0] > seen * run.duration_s
    shown = np.where(late[:, None], np.nan, run.temperature_c)
    if not np.isfinite(shown).any() or not (problem.mask[0] & late[:, None]).any():
        return None
    part = _problem(problem, [replace(run, temperature_c=shown)], [0])
    return Split(part, (0,), run, problem.mask[0] & late[:, None], alone=True)


def _problem(whole: Problem, runs: Sequence[Run], kept: Sequence[int]) -> Problem:
    part = Problem(whole.array, runs, whole.declared)
    part.noise = [whole.noise[k] for k in kept]
    part.budget = whole.budget
    return part


def _own(free: Free, kept: Sequence[int]) -> str:
    """Return the key that a number of all runs, or of one of these, has where only these are fitted."""
    if free.run is None:
        return free.key
    return free.key.replace(f"@{free.run + 1}", f"@{kept.index(free.run) + 1}")


def _of_these(fit: Fit, kept: Sequence[int]) -> tuple[Spec, dict[str, float]]:
    """Return a fit's model with the numbers of these runs only, and where they begin: a drift from nothing."""
    mine = [(f, float(v)) for f, v in zip(fit.spec.free, fit.values, strict=True) if f.run is None or f.run in kept]
    free = [replace(f, key=_own(f, kept), run=None if f.run is None else kept.index(f.run)) for f, _ in mine]
    return replace(fit.spec, free=tuple(free)), {_own(f, kept): v for f, v in mine if f.knot is None}


def stays(split: Split, base: Fit) -> list[str]:
    """Return the declared numbers of which a split's runs tell next to nothing beside all of them, by the declared model: in whatever is
    judged they stay as it had them by all. Else what leaves its numbers open would have been told by what is left out, and what has
    them told would not."""
    problem, kept = split.problem, list(split.kept)
    spec, start = _of_these(base, kept)
    problem.colour = None
    problem.learn_starts(spec, [start.get(f.key, f.start) for f in spec.free])
    part = problem.fit(spec, start, tolerance=1e-3, max_steps=STEPS)
    return _hardly_shown(base, part, kept)


def _hardly_shown(whole: Fit, part: Fit, kept: Sequence[int]) -> list[str]:
    """Return the declared numbers of which a part of the runs tells next to nothing beside all of them: that they are off there says
    nothing of an effect."""
    if whole.jacobian is None or part.jacobian is None:
        return []
    told = {f.key: float(np.sum(column**2)) for f, column in zip(part.spec.free, part.jacobian.T, strict=True)}
    # an effect that is still to be fitted comes last, and has none
    mine = [(f, float(np.sum(column**2))) for f, column in zip(whole.spec.free, whole.jacobian.T, strict=False)]
    return [
        _own(f, kept)
        for f, all_of_it in mine
        if f.effect is None and (f.run is None or f.run in kept) and told[_own(f, kept)] < HARDLY * all_of_it
    ]


def held(spec: Spec, at: dict[str, float]) -> Spec:
    """Return a spec whose numbers with these keys stay at these values."""
    return replace(spec, free=tuple(replace(f, start=at[f.key], prior=PINNED) if f.key in at else f for f in spec.free))


def pinned(fit: Fit) -> Fit:
    """Return a fit, made beside what has no name, whose effects stay as large as they were found: only the declared numbers,
    and those of a run alone, are free to take that up."""
    found = {f.key for f in fit.spec.free if f.effect is not None and f.run is None}
    return replace(fit, spec=held(fit.spec, {key: v for key, v in fit.as_dict().items() if key in found}))


def errors(split: Split, fit: Fit, colour: Colour | None, stay: Sequence[str] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much what is left out differs from what a model fitted to a split's runs predicts, degC, where that counts; and
    that without what a room explains that nobody logged. Numbers that `stay` are as the fit has them."""
    problem, kept = split.problem, list(split.kept)
    spec, start = _of_these(fit, kept)
    problem.colour = None
    problem.learn_starts(spec, [start.get(f.key, f.start) for f in spec.free])
    if colour is not None:
        problem.take_for(colour)
    guessed = not {RUN_AMBIENT, RUN_SENSOR}.isdisjoint(spec.effects) or split.left_out.ambient_c is None
    beside = not split.alone and guessed
    fitted = problem.fit(spec, start, tolerance=1e-3, max_steps=STEPS, errors=beside)
    # what only the left-out run shows, these do not tell: it stays, and what is known beside it alone goes with it
    if known := {key: start[key] for key in (*fitted.stuck, *stay) if key in start}:
        start = fitted.as_dict() | known
        fitted = problem.fit(held(spec, known), start, tolerance=1e-3, max_steps=STEPS, errors=beside, near=fitted)
    run, values = split.left_out, fitted.as_dict()
    if (share := room.around_share(values)) is not None:
        run = replace(run, around_share=share)
    if split.alone:
        off = (run.temperature_c - problem.simulate(spec, fitted.values, 0))[split.counts]
        return off, off
    plant = problem.plant_for(spec, fitted.values)

    def off_in(ambient: np.ndarray, share: float) -> np.ndarray:
        begun = replace(run, around_share=share)
        return (run.temperature_c - simulate_run(plant.copy(), begun, ambient))[split.counts]

    if run.ambient_c is not None:
        over_k = room.over_logged_k(values, fitted.stderr() if beside else {}) or 0.0
        seen_s = max(one.duration_s for one in problem.runs)
        ambient = run.ambient_c + room.beside_log_k(run, over_k, seen_s, settles_s(plant, run.springs))
        off = off_in(ambient, room.around_of(run, plant, float(ambient[0]), room.LOGGED_K))
        return off, off
    told, sigma, around = _room(problem, run, fitted, plant)
    ambient = np.full(len(run.time_s), told)
    off = off_in(ambient, around)
    alike = max(1.0, BLOCK_S / float(np.median(np.diff(run.time_s))))
    return off, room.without(off, off - off_in(ambient + 1.0, around), math.hypot(sigma, room.MOVES_K), alike)


def of_a_run(each: Sequence[np.ndarray]) -> float:
    """Return the error, degC rms, of a run by those of several: how large it is in each is fitted, and of their one likelihood the mean
    is that of logarithms. So no run in which all models err, as of a start that nobody saw, outweighs the others."""
    logarithms = [math.log(max(rms([one]), 1e-9)) for one in each if one.size]
    return math.exp(np.average(logarithms, weights=[one.size for one in each if one.size])) if logarithms else math.nan


def _room(problem: Problem, run: Run, fit: Fit, plant: Any) -> tuple[float, float, float]:
    """Return how warm the room of a run was, one sigma of it and how warm what was around its springs, as `predict` tells it by the runs
    that were fitted."""
    values = fit.as_dict()
    rooms = {r: values[f"ambient_c@{r + 1}"] for r in range(len(problem.runs)) if f"ambient_c@{r + 1}" in values}
    begun = [problem.begun(r, values) for r in rooms]
    return room.Rooms.of(begun, list(rooms.values()), plant, fit.errors_of_settings()).told(run, plant)


@dataclass
class Unseen:
    """How well models predict runs that they were not fitted to."""

    problem: Problem
    found: Search
    base: Fit
    accounts: Sequence[Fit] = ()
    """The likeliest that were fitted of what is the same in all runs, where all of it leaves something: whatever they are sure of, one
    may foretell runs best."""

    def __post_init__(self) -> None:
        self.splits = splits(self.problem)
        self.known: dict[Any, tuple[list[np.ndarray], list[np.ndarray]]] = {}
        self.lag = next((one for one in self.found.candidates if one.effect == LAG), None)
        self.lagged = self.base
        if self.lag is not None and LAG not in self.base.spec.effects:
            spec = self.lag.added_to(self.base.spec)
            found = self.found.fits.get(self.found.key(spec))  # from several starts: of two minima the better one
            start = found.as_dict() if found else self.base.as_dict() | self.lag.start_at(1.0)
            colour = self.problem.colour
            self.problem.take_for(None)
            self.lagged = self.problem.fit(spec, start, tolerance=1e-3, max_steps=STEPS)
            self.problem.take_for(colour)

    def errors(self, fit: Fit, colour: Colour | None = None) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the errors, degC, of each run left out, the others fitted by how errors last, and those without what their rooms
        explain; none where none can be."""
        key = fit.spec.variant, tuple(free.prior for free in fit.spec.free), colour
        if key not in self.known:
            each = [errors(one, fit, colour, stay) for one, stay in zip(self.splits, self.stay, strict=True)]
            off, judged = [off for off, _ in each], [judged for _, judged in each]
            if each and self.splits[0].alone:  # parts of one run, whose errors are of one size
                off, judged = [np.concatenate(off)], [np.concatenate(judged)]
            self.known[key] = off, judged
        return self.known[key]

    @functools.cached_property
    def stay(self) -> list[list[str]]:
        """Of each split, the numbers that stay as all runs had them."""
        return [stays(one, self.base) for one in self.splits]

    def rmse(self, fit: Fit, colour: Colour | None = None) -> float:
        """Return the error, degC rms, that a model is judged by: of a run left out, its room apart; NaN where none can be."""
        return of_a_run(self.errors(fit, colour)[1])

    def foretells(self, fit: Fit, colour: Colour | None = None) -> float:
        """Return the error, degC rms, of a run left out, its room told by its first minute."""
        return of_a_run(self.errors(fit, colour)[0])

    def own(self, fit: Fit) -> float:
        """Return the error of what was found, or a part of it, its numbers as likely as the problem's colour has them."""
        return self.rmse(fit, self.problem.colour)

    @property
    def better(self) -> Fit:
        """The better one of both that know no physics but the declared, by least squares as anybody fits them."""
        return min((self.base, self.lagged), key=self.rmse)

    @property
    def plain(self) -> Fit:
        """What is given where nothing else foretells as well: the declared model, with a lag where that is worth it in runs left
        out, each in the room that its first minute tells: so it will be used."""
        return self._rather(self.lagged, self.base)

    @property
    def instead(self) -> Fit:
        """What is given in place of what foretells worse: the plain model, or the likeliest account that foretells better, which is all
        that it is judged by."""
        best = self.plain
        for one in self.accounts:
            best = self._rather(one, best)
        return best

    def _rather(self, one: Fit, other: Fit) -> Fit:
        return one if self.foretells(one) <= self.foretells(other) / WORSE else other

    def worse(self, fit: Fit) -> bool:
        """Return whether something foretells the unseen worse than the better of both baselines."""
        return self.own(fit) > WORSE * self.rmse(self.better)

    def given_worse(self, fit: Fit) -> bool:
        """Return whether runs left out, each in the room that its first minute tells, are foretold worse than by what is given instead:
        a model is given to predict such runs."""
        return self.foretells(fit, self.problem.colour) > WORSE * self.foretells(self.instead)

    def tells(self, fit: Fit, without: Fit) -> bool:
        """Return whether most of what is off in the unseen without an effect is foretold with it: no stand-in does that. Or, in runs
        left out, a part of it, where all that was found foretells most of what the given model does not and what the effect changes
        comes true: of many that are there, none foretells most."""
        if not self.splits:
            return False
        off, bare = self.own(fit) ** 2, self.own(without) ** 2
        if off <= FORETOLD * bare:
            return True
        of_many = off <= PART * bare and off <= FORETOLD * self.rmse(self.better) ** 2
        return of_many and not self.splits[0].alone and COMES_TRUE <= self.comes_true(fit, without) < math.inf

    def comes_true(self, fit: Fit, without: Fit) -> float:
        """Return what part of that by which an effect changes what is foretold of the unseen is there: 1 of a cause, 0.5 where it
        is foretold no better than without. Infinite where it changes next to nothing."""
        off = self.errors(without, self.problem.colour)[1]
        moved = [one - other for one, other in zip(off, self.errors(fit, self.problem.colour)[1], strict=True)]
        if rms(moved) < EQUIVALENT * self.problem.noise_c:
            return math.inf
        large = [max(rms([one]), self.problem.noise_c) ** 2 for one in off]  # a run counts by its own likelihood
        there = sum(float(one @ by) / size for one, by, size in zip(off, moved, large, strict=True))
        return there / sum(float(by @ by) / size for by, size in zip(moved, large, strict=True))

    def carried(self, fit: Fit, reduced: Callable[[Fit, str], Fit]) -> Fit:
        """Return a fit without what is of that day: no other run tells that, and beside it a part of the runs tells little of
        the rest. What a run alone began with is the rest's, too: only what drifts is not, where it does not foretell the rest."""
        alone = bool(self.splits) and self.splits[0].alone
        if alone and not self.worse(fit):
            return fit
        for effect, variant in fit.spec.variant:
            rests = alone and effect in RUNS_OWN
            if of_that_day(effect, variant) and not rests and effect not in self.base.spec.effects:
                fit = reduced(fit, effect)
        return fit

    def given(self, fit: Fit, carried: Fit) -> Fit:
        """Return what a model is made of: a fit, or that without what is of that day (`carried`), where beside it the other numbers
        foretell worse: what bends has taken up what is the array's."""
        colour = self.problem.colour
        return carried if self.foretells(fit, colour) > WORSE * self.foretells(carried, colour) else fit

    def kept(self, fit: Fit, reduced: Callable[[Fit, str], Fit]) -> tuple[Fit | None, list[str]]:
        """Return what predicts no worse than the better of both, names left out one by one, None where nothing of it does; and
        what is to be said of the names. Each is judged by itself, too: others may carry it along."""
        said: list[str] = []
        while self.splits:
            bare = self.carried(fit, reduced)
            names = [e for e in bare.spec.effects if e not in self.base.spec.effects]
            if not names and (bare is not fit or not self.worse(fit)):
                break
            fewer = {effect: reduced(bare, effect) for effect in names}
            if not self.worse(bare):
                if any(of_that_day(*one) and one[0] not in self.base.spec.effects for one in fit.spec.variant):
                    break  # the unseen has that day's, too: it says too little of what comes true
                # what foretells most of what is off without it is there, however much of it comes true
                true = {
                    effect: math.inf if self.tells(bare, other) else self.comes_true(bare, other)
                    for effect, other in fewer.items()
                }
                out = min(true, key=true.__getitem__)
                if true[out] >= COMES_TRUE:
                    break
                said.append(
                    f"{out} is not named: of what it changes where {self._what} is predicted, {true[out]:.0%} comes true"
                )
            else:
                out = min(fewer, key=lambda effect: self.own(fewer[effect]), default="")
                if not out or self.own(fewer[out]) >= self.own(bare):
                    said += [self._left_out(e, bare, self.better) for e in names if e not in self.better.spec.effects]
                    return None, said
                said.append(self._left_out(out, bare, fewer[out]))
            fit = reduced(fit, out)
        return fit, said

    def refitted(self, found: Search, model: Fit) -> Fit:
        """Return one of these models fitted to everything, by least squares as anybody fits it, in a search that begins at the
        declared."""
        if model is self.base:
            return found.base
        if self.lag is not None and model is self.lagged:
            return found.refit(found.base, [self.lag], [1.0])
        return found.problem.fit(model.spec, model.as_dict(), tolerance=1e-3)

    def _left_out(self, effect: str, fit: Fit, other: Fit) -> str:
        return (
            f"{effect} is not named: {self._what} is predicted to {self.own(fit):.2f} K with it and to "
            f"{min(self.own(other), self.rmse(other)):.2f} K without, its room apart"
        )

    @property
    def _what(self) -> str:
        alone = self.splits[0].alone
        return "the last part of the run (a half and a third of it)" if alone else "a run that the fit did not see"

    def told(self, fit: Fit, why: str = "") -> results.Unseen | None:
        """Return what diagnosis.json says of the model that is given, None where nothing can be left out; `why` it is given instead."""
        mine = self.foretells(fit, None if why else self.problem.colour)
        if not math.isfinite(mine):
            return None
        declared, lagged = self.foretells(self.base), self.foretells(self.lagged)
        return results.Unseen(
            what="last part" if self.splits[0].alone else "each run left out in turn",
            rmse_c=mine,
            declared_rmse_c=declared,
            with_lag_rmse_c=lagged,
            text=f"{self._what} is predicted to {mine:.2f} K (declared model, fitted: {declared:.2f}, with a lag: {lagged:.2f})"
            + (f". The model is the declared model{self._with(fit)}, by least squares: {why}" if why else ""),
        )

    def _with(self, model: Fit) -> str:
        """Return what a model that is given instead has beside the declared one, in words."""
        if model is self.base or model is self.lagged:
            return WITH_LAG * (model is not self.base)
        names = [e for e in model.spec.effects if e not in self.base.spec.effects]
        return f" with {' and '.join(names)}, each named or not"
