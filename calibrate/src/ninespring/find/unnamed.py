"""Causes that have no name in the library, in kinds that need none: heat that goes where it should not, losses and drives
that change in time, thermometers that see what is not theirs.

What one of them makes of the readings is simulated by the fitted model and nearly linear in its size; where not, its heat is
simulated with that size. Beside an unknown cause of such a kind a known one shows as clearly as alone; without it every name
is a stand-in. They are taken out of the readings while the library is searched, priced for all that they were chosen from,
and are no part of the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..infer.fit import Fit
from ..infer.heat import THIN
from ..infer.problem import Problem
from ..io import results
from ..io.statistics import correlation_factor
from ..model.effects.effect import sized
from ..model.spec import RUNS_OWN
from . import evidence
from .causes import SHORTEST, Cause, bump, column_of, library, thinned, typical_power
from .evidence import fit_factor, price, unexplained
from .pursuit import Pursuit
from .search import MIN_GAIN, MIN_SHARE, Search

KINDS = 500
"""Of causes that there are to choose from, at all places and times, about so many that differ."""
MOST = 12
"""Unnamed causes, at most: where more would help, it is no cause of these kinds."""
ROUNDS = 4
"""Of finding what has no name and searching the library beside it, at most."""
GIVES_ONLY = ("mixing", "crosstalk", "bridge", "plume", "delay")
"""Kinds whose size cannot be negative: they lead on what is there, and a part of it at most."""
NAMED = "named"
"""Kind of what is in the library: looked at beside the others, never found here."""
UNIT = {"pickup": "K", "bridge": "W/K", "plume": "W/K", "heat": "W", "sensor": "K", "reading": "K", "surroundings": "K"}
"""Of a cause's size; the others are parts of what they take from."""
ROOM_K = 10.0
"""What a room can change by while somebody measures."""
LESS = (("is given heat", "loses heat"), ("shows more of", "shows less of"), ("are warmer", "are cooler"))
"""What is said where the size is negative."""
SHARE = 0.1
"""Of what is left beyond the noise, the part that an unnamed cause must explain."""
LEAST_NATS = 3.0
"""Evidence after all prices: one in twenty."""
AGAIN = 2
"""Times that heat without a name is simulated with the sizes found beside it: once where it is, once as large as it is there."""
UNDONE = 0.5
"""Of what a name shows, the part that an unnamed cause takes back for a while where it may be the same cause, come or gone:
the greater one."""
STEPS_OF_FIT = 14
"""Of one fit beside them, at most."""

Found = tuple[Fit, dict[str, Fit], list[tuple[str, Fit]]]
"""As `Search.run` returns it."""


@dataclass(frozen=True)
class Hidden:
    """An unnamed cause that is there: what a unit of it adds to the readings, (count,)."""

    cause: Cause
    text: str
    rows: tuple[int, int | None]
    column: np.ndarray
    size: float = math.nan
    error: float = math.nan
    inside: np.ndarray | None = None
    """Of each column, the size that is simulated as heat: the columns lead on from there."""

    def around(self, problem: Problem, fit: Fit) -> Hidden:
        """Return it with what it adds as another fit has it."""
        column = column_of(problem, fit, self.cause, typical_power(problem, fit), *self.rows)
        return replace(self, column=column)

    @property
    def possible(self) -> bool:
        """Whether anything can be like that: what leads on a part leads on no more than all, of a part no more than all can be
        missing, and a room is where somebody works."""
        if self.cause.kind == "surroundings":
            return abs(self.size) <= ROOM_K
        return self.cause.kind in UNIT or -1.0 <= self.size <= (1.0 if self.cause.kind in GIVES_ONLY else math.inf)

    def told(self) -> results.Unnamed:
        """Return what diagnosis.json says of it."""
        return told(self.cause.kind, self.text, self.size, self.error)


def told(kind: str, text: str, size: float, error: float, more: str = "") -> results.Unnamed:
    """Return what diagnosis.json says of a cause of some size and its error, with what is said where the size is positive, and `more`."""
    unit, shown = UNIT.get(kind, "1"), size
    for positive, negative in LESS if size < 0.0 else ():
        if positive in text:
            text, shown = text.replace(positive, negative), -size
    said = sized(shown, error, unit) if unit != "1" else sized(shown, error, "%", 100.0)
    return results.Unnamed(kind=kind, size=size, stderr=error, unit=unit, text=f"{text}: {said}{more}")


Beside = tuple[Search, Found, list[Hidden]]
"""A search beside unnamed causes, what it found, and those causes."""


def _starts(problem: Problem) -> list[np.ndarray]:
    """Return what errors of the first readings do, as columns (count, springs)."""
    out = []
    for r, response in enumerate(problem.start_response):
        if response is not None:
            column = np.zeros((problem.count, response.shape[1]))
            problem.by_run(column)[r][:] = response
            out.append(column)
    return out


def _least_squares(gram: np.ndarray, moment: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the least squares of these products, and how many numbers the data fix."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    value, vector = np.linalg.eigh(gram / np.outer(scale, scale))
    used = value > 1e-4
    return vector[:, used] @ ((vector[:, used].T @ (moment / scale)) / value[used]) / scale, int(used.sum())


def _nats(samples: float, before: float, after: float, numbers: int) -> float:
    """Return the evidence of so many independent samples for so many numbers by which squares fall from one sum to another."""
    return 0.5 * samples * math.log(before / max(1e-9, after)) - price(numbers, samples)


def _independent(problem: Problem, left: np.ndarray) -> float:
    """Return the independent samples of what is left, thinned as causes are."""
    ends = np.cumsum([len(range(0, len(mask), THIN)) * mask.shape[1] for mask in problem.mask])[:-1]
    series = [part.reshape(-1, problem.array.springs) for part in np.split(left, ends)]
    return len(left) / correlation_factor(series, problem.longest_lag() // THIN)


def _within(window: Cause, found: Sequence[Hidden]) -> bool:
    """Return whether what acts for a while is part of what comes and goes as it likes already."""
    return any(one.cause.bumps and one.text == window.often for one in found)


def laid_bare(problem: Problem, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return what a fit's numbers, first readings and what is taken out can make of the readings, as a basis (samples, n), and what is
    left beside that, (samples,): thinned, as causes are."""
    jac = fit.jacobian if fit.jacobian is not None else np.zeros((problem.count, 0))
    used = jac[:, np.linalg.norm(jac, axis=0) > 1e-6]
    taken = [used, *_starts(problem), *([] if problem.unnamed is None else [problem.unnamed])]
    basis = np.linalg.qr(thinned(problem, np.column_stack(taken)))[0]
    left = thinned(problem, np.concatenate(problem.scaled(problem.without_errors(fit.residual)))[:, None])[:, 0]
    return basis, left - basis @ (basis.T @ left)


def find(
    problem: Problem, fit: Fit, kinds: Sequence[Cause], already: Sequence[Hidden], most: int = MOST, searched: int = 0
) -> list[Hidden]:
    """Return the unnamed causes that a fit's residual calls for, beside those that are taken out already.

    The best first, while it beats its price and explains a fair share of what is left, and more than any name would where
    there are more than the library was `searched` beside: it is searched again before more is found.
    """
    basis, left = laid_bare(problem, fit)
    typical = typical_power(problem, fit)
    found = list(already)
    samples = problem.count / fit_factor(problem, fit)
    # two that come and go as they like would explain whatever all springs do together, and leave nothing to be named
    often = [] if any(one.cause.bumps for one in already) else [one for one in kinds if one.bumps]
    # and one at a spring alone would explain whatever is named of that spring
    springs = {_spring_of(fit, effect) for effect in fit.spec.effects}
    often = [one for one in often if one.place not in springs]
    among = Pursuit([one for one in kinds if not one.bumps], basis, SHORTEST, dict.fromkeys(GIVES_ONLY, 1))
    named = np.array([one.kind == NAMED for one in among.single], dtype=bool)
    tried = len(among.single) + sum(one.columns.shape[1] ** 2 / 2 for one in among.windows)
    while len(found) < most:
        choice = among.best(left, lambda one: one.kind == NAMED or _within(one, found))
        drop, best, span, vectors, spent = choice.drop, choice.cause, choice.rows, choice.vector[:, None], 1
        if len(found) > searched and among.gains(left)[named].max(initial=0.0) > drop:
            break
        rest = float(left @ left)
        nats = _nats(samples, rest, rest - drop, 1) - math.log(tried)
        independent = samples
        # the half that one window leaves may be many more like it, and one where another was found says that there are more
        many = drop < 0.5 * (rest - len(left)) or any(one.cause.text == best.text and best.edges for one in found)
        for one in often if many else ():
            moment = one.columns.T @ left
            size, numbers = _least_squares(among.gram(one), moment)
            explained = float(size @ moment)
            answer = one.columns @ size
            own = _independent(problem, left - answer + among.basis @ (among.basis.T @ answer))
            # as between two fits, what is left by the one that explains more tells how many samples are independent
            if _nats(own if explained > drop else independent, rest - drop, rest - explained, numbers - spent) > 0.0:
                nats, independent = _nats(own, rest, rest - explained, numbers) - math.log(tried), own
                drop, vectors, spent, best, span = explained, one.columns, numbers, one, (0, None)
        if nats < LEAST_NATS or drop < SHARE * max(0.0, rest - len(left)):
            break
        text = best.text
        if best.edges:
            run = problem.runs[best.run]
            when = [float(run.time_s[min(row, len(run.time_s) - 1)] - run.time_s[0]) for row in span]
            text = text.format(f"{when[0]:.0f} to {when[1]:.0f} s")
        if any(text == one.text for one in found):
            break  # what is left of one of its size is no second of it
        found.append(Hidden(best, text, span, column_of(problem, fit, best, typical, *span)))
        if best.bumps:
            often = []
        vectors = vectors - among.basis @ (among.basis.T @ vectors)
        units = np.linalg.qr(vectors[:, np.linalg.norm(vectors, axis=0) > 1e-3])[0]
        left = left - units @ (units.T @ left)
        among.take(units)
    return found


def _heat(problem: Problem, hidden: Sequence[Hidden]) -> list[np.ndarray] | None:
    """Return the heat of unnamed causes that is simulated, per run (rows, springs), W; None where none is."""
    given = [one for one in hidden if one.inside is not None]
    out = [np.zeros_like(run.drive) for run in problem.runs]
    for one in given:
        if one.cause.bumps:
            for size, (r, *about) in zip(one.inside, one.cause.bumps, strict=True):
                first, top, last = about
                out[r] += size * bump(first, top, last, len(out[r])) * one.cause.profiles[r]
            continue
        (size,), (begin, end) = one.inside, one.rows
        for heat, profile in zip(out, one.cause.profiles, strict=True):
            if profile is not None:
                heat[begin:end] += size * profile[begin:end]
    return out if given else None


def _with_sizes(problem: Problem, fit: Fit, hidden: Sequence[Hidden]) -> list[Hidden]:
    """Return unnamed causes with the sizes that they have beside a fit, heat to be simulated with them."""
    problem.leave_out(None, problem.heat)
    columns = np.column_stack([one.column for one in hidden])
    left = np.concatenate(problem.scaled(problem.without_errors(problem.evaluate(fit).residual)))
    size, out = _least_squares(columns.T @ columns, columns.T @ left)[0], []
    for one in hidden:
        own, size = np.split(size, [one.column.shape[1]])
        out.append(one if one.cause.shown else replace(one, inside=own + (0.0 if one.inside is None else one.inside)))
    return out


def simulated(problem: Problem, fit: Fit, hidden: list[Hidden]) -> tuple[Fit, list[Hidden]]:
    """Return the fit beside unnamed heat that is simulated, for what heat adds is straight only about the temperatures that
    it makes, and those causes; both as they were where that explains nothing that matters, or power was not logged."""
    before, near, given = (problem.unnamed, problem.heat), fit, hidden
    if any(run.mode != "power" for run in problem.runs) or all(one.cause.shown for one in hidden):
        return fit, hidden
    for _ in range(AGAIN):
        given = taken_out(problem, near, _with_sizes(problem, near, given))
        near = problem.fit(near.spec, near.as_dict(), tolerance=1e-3, max_steps=STEPS_OF_FIT)
    if evidence.gain(near, fit) >= MIN_GAIN:
        return near, given
    problem.unnamed, problem.heat = before
    return fit, hidden


def taken_out(problem: Problem, fit: Fit, hidden: Sequence[Hidden]) -> list[Hidden]:
    """Take unnamed causes out of the readings, their heat simulated; return them as they are around a fit."""
    problem.heat = _heat(problem, hidden)
    around = [one.around(problem, fit) for one in hidden]
    problem.leave_out(np.column_stack([one.column for one in around]) if around else None, problem.heat)
    return around


def _needed(problem: Problem, fit: Fit, hidden: Sequence[Hidden]) -> list[Hidden]:
    """Return the unnamed causes that are needed beside a fit, with their sizes; what is taken out stays as it is."""
    left_out = problem.unnamed
    judged = weighed(problem, fit, hidden)
    problem.unnamed = left_out
    return [one for one, nats in judged if nats > LEAST_NATS]


def weighed(problem: Problem, fit: Fit, hidden: Sequence[Hidden]) -> list[tuple[Hidden, float]]:
    """Return unnamed causes with their sizes beside a fit's numbers, and the nats by which each is needed there."""
    problem.leave_out(None, problem.heat)
    bare = problem.evaluate(fit)
    slopes = problem.slopes(fit)
    slopes = slopes[:, np.linalg.norm(slopes, axis=0) > 1e-6]
    columns = np.column_stack([one.column for one in hidden])
    matrix = np.column_stack([columns, slopes])
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-9)
    left = np.concatenate(problem.scaled(problem.without_errors(bare.residual)))
    for one in hidden:
        left += 0.0 if one.inside is None else one.column @ one.inside
    gram, moment = (matrix / scale).T @ (matrix / scale), (matrix / scale).T @ left
    inverse = np.linalg.pinv(gram, rcond=1e-10)
    size = inverse @ moment
    rest = left - (matrix / scale) @ size
    problem.leave_out(columns, problem.heat)
    factor = fit_factor(problem, problem.evaluate(fit))
    spread = factor * max(1.0, float(rest @ rest) / problem.count)
    out = []
    begin = 0
    for one in hidden:
        own = slice(begin, begin + one.column.shape[1])
        begin = own.stop
        numbers = begin - own.start
        # all at once of one that comes and goes is what a number of the model does, too: only what is left without it tells
        other = np.r_[: own.start, own.stop : len(size)]
        drop = float(
            moment @ size - moment[other] @ np.linalg.pinv(gram[np.ix_(other, other)], rcond=1e-10) @ moment[other]
        )
        nats = 0.5 * drop / spread - price(numbers - 1, problem.count / factor)
        errors = np.sqrt(np.maximum(np.diag(inverse[own, own]), 0.0) * spread) / scale[own]
        value = (
            float(size[own][0] / scale[own][0])
            if numbers == 1
            else float(np.sqrt(np.mean((size[own] / scale[own]) ** 2)))
        )
        out.append((replace(one, size=value, error=float(np.sqrt(np.mean(errors**2)))), nats))
    return out


def beside(problem: Problem, fit: Fit, column: np.ndarray) -> Fit:
    """Return a fit's model fitted beside what a column (count, 1) can explain; nothing is taken out when this returns."""
    problem.leave_out(column)
    out = problem.fit(fit.spec, fit.as_dict(), tolerance=1e-3, max_steps=STEPS_OF_FIT)
    problem.leave_out(None)
    return out


def _named(problem: Problem, first: Search, fit: Fit) -> list[Cause]:
    """Return what the library's own candidates would add to the readings around a fit: a name goes before what has none."""
    search = Search(problem, first.candidates, first.base)
    screen = search.screen(fit)
    kept = [k for k, owner in enumerate(screen.owner) if not screen.candidates[owner].flexible]
    columns = thinned(problem, search.directions[:, kept])
    return [Cause(NAMED, screen.candidates[screen.owner[k]].effect, (), columns[:, [j]]) for j, k in enumerate(kept)]


def _with_fewer(problem: Problem, first: Search, final: Fit, kinds: Sequence[Cause]) -> tuple[Fit, list[Hidden]] | None:
    """Return the best fit of some of the names, or none, beside the one unnamed cause that it calls for, and that: where it
    explains more than all the names, the others may stand in for it. None where it does not.
    """
    names = [effect for effect in final.spec.effects if effect not in first.base.spec.effects]
    kept = {()} | {(one,) for one in names} | {tuple(other for other in names if other != one) for one in names}
    best: tuple[Fit, list[Hidden]] | None = None
    for some in sorted(kept - {tuple(names)}):
        fit = final
        for effect in names:
            if effect not in some:
                fit = first.reduced(fit, effect)
        fit = problem.with_slopes(fit)
        if not (grown := find(problem, fit, kinds, (), most=1)):
            continue
        other = beside(problem, fit, grown[0].column)
        if other.sse < (final if best is None else best[0]).sse:
            best = replace(other, jacobian=None), grown
    return best


def search_beside(problem: Problem, first: Search, final: Fit) -> Beside | None:
    """Search the library again beside what has no name; None where nothing of these kinds is there.

    The problem leaves the unnamed causes out when this returns.
    """
    out = _search_beside(problem, first, final)
    if out is None:
        return None
    if out[2]:
        return _or_lasting(problem, *out)
    # what was taken out stood in for names: with all in the error again, they stand for themselves
    problem.leave_out(None)
    named = out[1][0]
    if set(named.spec.effects) == set(final.spec.effects):
        return None
    return first, first.settle(problem.fit(named.spec, named.as_dict())), []


def _or_lasting(problem: Problem, found: Search, result: Found, hidden: list[Hidden]) -> Beside:
    """Return what was found less the names of one spring that unnamed causes there, found for a while, would nearly explain if
    they were there all the time: whether they came or went, nothing but those names says.

    Only names that those causes undo while they are there: a small one at its spring is no reason to doubt it.
    """
    final, without = result[0], result[1]
    before = problem.unnamed
    for spring in sorted({one.cause.place for one in hidden if one.cause.edges} - {-1}):
        begun = [one for one in hidden if one.cause.edges and one.cause.place == spring]
        doubted = [
            effect
            for effect in without
            if _spring_of(final, effect) == spring and _undone(problem, final, effect, begun, spring) > UNDONE
        ]
        if not doubted:
            continue
        causes = {id(one.cause): one for one in begun}
        whole = [_all_the_time(problem, one).around(problem, final) for one in causes.values()]
        problem.leave_out(np.column_stack([before, *(one.column for one in whole)]), problem.heat)
        search = _beside(problem, found, hidden)
        kept = with_all = problem.fit(final.spec, final.as_dict(), tolerance=1e-3, max_steps=STEPS_OF_FIT)
        for effect in doubted:
            other = search.reduced(kept, effect)
            if other.sse - kept.sse < MIN_SHARE * (without[effect].sse - final.sse):
                kept = other
        if kept is not with_all:
            needed = {effect: search.reduced(kept, effect) for effect in without if effect in kept.spec.effects}
            contenders = search.rivals(kept, needed)
            return search, (kept, needed, contenders), _needed(problem, kept, [*hidden, *whole])
        problem.unnamed = before
    return found, result, hidden


def _undone(problem: Problem, fit: Fit, effect: str, begun: Sequence[Hidden], spring: int) -> float:
    """Return the part of what an effect shows at a spring that unnamed causes there take back while they are there."""
    bare = problem.predictions_without(fit, effect)
    there = [np.zeros_like(mask) for mask in problem.mask]
    for one in begun:
        there[one.cause.run][slice(*one.rows), spring] = True
    here = np.concatenate([rows[mask] for rows, mask in zip(there, problem.mask, strict=True)])
    full = problem.predictions(fit.spec, fit.values)
    shows = np.concatenate(problem.scaled([a - b for a, b in zip(full, bare, strict=True)]))[here]
    takes = sum(one.column[here, 0] * one.size for one in begun)
    return -float(shows @ takes) / max(1e-12, float(shows @ shows))


def _spring_of(fit: Fit, effect: str) -> int | None:
    """Return the spring, from 0, of which alone an effect is; None where it is of several."""
    names = {name for free in fit.spec.free if free.effect == effect for name in free.names}
    springs = {name.partition("[")[2] for name in names}
    one = springs.pop() if len(springs) == 1 else ""
    return int(one[:-1]) - 1 if one else None


def _all_the_time(problem: Problem, one: Hidden) -> Hidden:
    """Return a cause that begins and ends in a run as one that is there all of it."""
    run = problem.runs[one.cause.run]
    return replace(one, text=one.cause.text.format(f"0 to {run.duration_s:.0f} s"), rows=(0, None), inside=None)


def _beside(problem: Problem, first: Search, hidden: Sequence[Hidden]) -> Search:
    """Return a search of the library beside what is taken out by now.

    Where one of that comes and goes as it likes, a drift of an ambient that was logged does so, too, and leaves as little to
    be named.
    """
    base = problem.fit(first.base.spec, first.base.as_dict(), errors=True)
    stays = any(one.cause.bumps for one in hidden) and any(run.ambient_c is not None for run in problem.runs)
    rest = [one for one in first.candidates if not (stays and one.flexible and one.effect not in RUNS_OWN)]
    return Search(problem, rest, base, first.progress)


def _search_beside(problem: Problem, first: Search, final: Fit) -> Beside | None:
    first.progress("causes without a name")
    kinds = library(problem, final)
    hidden: list[Hidden] = []
    if (nearer := _with_fewer(problem, first, final, kinds)) is not None:
        final, hidden = nearer
        kinds = library(problem, final)
        # the same cause as it is by the numbers that it had spoilt
        hidden = [replace(one, cause=next(k for k in kinds if k.text == one.cause.text)) for one in hidden]
    out = names = None
    left_out: tuple[np.ndarray | None, list[np.ndarray] | None] = None, None
    longest = 0
    for _ in range(ROUNDS):
        if out is not None and not problem.budget.allows(longest):
            break
        begun = problem.simulations
        hidden = taken_out(problem, final, hidden)
        final = problem.with_slopes(problem.evaluate(final))
        searched = 0 if out is None else len(hidden)
        grown = find(problem, final, [*kinds, *_named(problem, first, final)], hidden, searched=searched)
        if len(grown) == searched:
            break
        problem.leave_out(np.column_stack([one.column for one in grown]), problem.heat)
        # what they add depends on the numbers, which they spoilt until now
        settled = problem.fit(final.spec, final.as_dict(), tolerance=1e-3, max_steps=STEPS_OF_FIT)
        grown = taken_out(problem, settled, grown)
        search, taken = _beside(problem, first, grown), (problem.unnamed, problem.heat)
        # what only helps together was looked for before: beside a cause without a name, what shows alone is enough
        result = search.run(downwards=False)
        final = result[0]
        # what stood in for an effect that is named by now goes again
        hidden = _needed(problem, final, [one.around(problem, final) for one in grown])
        near, given = simulated(problem, final, hidden) if hidden else (final, hidden)
        if near is not final:
            search, taken = _beside(problem, first, given), (problem.unnamed, problem.heat)
            result = search.settle(near)
            final = result[0]
            hidden = _needed(problem, final, [one.around(problem, final) for one in given])
        longest = max(longest, problem.simulations - begun)
        if out is not None and final.sse > out[1][0].sse:
            break  # beside what this round found, the names do not come back that explained more
        out, left_out = (search, result, hidden), taken
        if len(hidden) == len(grown) and not unexplained(problem, final):
            break
        # the same names twice: what more without a name would be found beside them changes them no more
        if final.spec.variant == names:
            break
        names = final.spec.variant
        final = replace(final, jacobian=None)
    problem.unnamed, problem.heat = left_out
    return out
