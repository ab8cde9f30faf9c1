"""A run alone whose springs rest elsewhere than where its room was logged, searched from there.

In a single pulse a room, a late thermometer and an alloy of its own show together: noise that lasts takes the place of any one of them, and
one after the other they end beside what they are. Here they are fitted at once, the alloy begun at several places, with errors as they last beside all of
them, and what foretells the rest of the run is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ..infer.fit import Fit
from ..model.effects import Candidate, alloy
from ..model.effects.runs_differ import RESTED_K
from ..model.spec import RUN_AMBIENT
from .evidence import likelihood, relief
from .search import MIN_EVIDENCE, STEPS, Search
from .unseen import LAG, WORSE, Unseen


def off_k(found: Search) -> float | None:
    """Return by how much a run alone rests above its logged room, K; None where it does not by more than a room moves."""
    rooms = [c.free[0] for c in found.candidates if c.effect == RUN_AMBIENT]
    rests = [free.start for free in rooms if free.absent is not None and abs(free.start) > RESTED_K]
    return rests[0] if rests else None


def alloys(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return those that tell where a transformation is."""
    return [c for c in candidates if any(free.key == alloy.SHIFT for free in c.free)]


def _narrow(one: Candidate, get: Callable[[str], float]) -> Candidate:
    """Return a candidate whose alloy may be in several places with a narrow loop at each of them."""
    loops = {place[alloy.SHIFT]: alloy.closed(place, get) for place in one.probes}
    return replace(one, probes=tuple(loops.values()))


def _begun(first: Search, base: Fit) -> list[Fit]:
    """Return a base with room and lag, and an alloy beside both begun at each of the places that promise most: with narrow loops, as
    the search from the logged room has begun with others."""
    problem = first.problem
    company = [c for c in first.candidates if c.effect in (RUN_AMBIENT, LAG)]
    loops = {c.effect: _narrow(c, problem.base_value) for c in alloys(first.candidates)}
    found = Search(problem, [*company, *loops.values()], base, first.progress)
    beside = found.refit(base, company, [1.0] * len(company))
    screen = found.screen(beside)
    spec, starts = beside.spec, [beside.as_dict()]
    for k, one in enumerate(screen.candidates):
        spec, size = one.added_to(spec), screen.forecast([k])[1].get(k, 1.0)
        starts = [start | one.start_at(size, place) for start in starts for place in found.places(beside, one)]
    return [problem.fit(spec, start, tolerance=1e-3, max_steps=STEPS, near=beside) for start in starts]


def search_rested(first: Search, judged_by: Unseen) -> tuple[Search, Fit, dict[str, Fit]] | None:
    """Return a search beside errors as all at once leave them, what is needed of that, and it without each name; None where the room
    is not needed."""
    problem = first.problem
    first.progress("a room where the springs rest")
    rich = min(_begun(first, first.base), key=lambda one: one.chi2)
    likelihood(problem, rich)
    problem.take_for(rich.colour)
    base = problem.fit(first.base.spec, first.base.as_dict(), errors=True)
    found = Search(problem, first.candidates, base, first.progress)
    fits = [problem.fit(rich.spec, rich.as_dict(), tolerance=1e-3), *_begun(first, base)]
    # each by a judge of its own: one keeps what it has of a spec, and most of these fits have the same
    fit = min(fits, key=lambda one: Unseen(problem, first, first.base).own(one))
    found.fits[found.key(fit.spec)] = fit
    while RUN_AMBIENT in fit.spec.effects:
        names = [e for e in fit.spec.effects if e not in base.spec.effects]
        without = {effect: found.reduced(fit, effect) for effect in names}
        needless = [effect for effect, other in without.items() if not _needed(found, judged_by, fit, other)]
        if not needless:
            return found, fit, without
        fit = without[min(needless, key=lambda effect: judged_by.own(without[effect]))]
    return None


def _needed(found: Search, judged_by: Unseen, fit: Fit, other: Fit) -> bool:
    """Return whether what a fit has and the other has not is in the rest of the run, or in the readings by errors that are the same
    with it and without: what is free to be called noise instead costs nothing."""
    colour = found.problem.colour
    if colour is None or judged_by.own(fit) > WORSE * judged_by.own(other):
        return False
    nats = 0.5 * (other.chi2 - fit.chi2) / colour.white + relief(fit, other)
    return nats - found.price() >= MIN_EVIDENCE or judged_by.tells(fit, other)
