"""The library searched again where something is left: with that taken for noise that lasts, as heat that nobody logged does.

Least squares of readings that go astray together for minutes believe the slow ones far too much, and what explains any of it gets
a name. Here the numbers, the forecasts and the names are those of innovations (infer/likelihood.py), whose noise is the one that the
first search left: names that only followed what lasts are dropped, and what it hid is looked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..infer.fit import Fit
from ..infer.problem import Problem
from .evidence import likelihood, price
from .search import Search
from .unnamed import Found, Hidden

TIMES = 2
"""The noise is that of what the last search left, and after so many of them no longer another."""
LASTS = 0.1
"""Variance of what lasts, in units of the white noise's, from which least squares may be beside the likeliest numbers."""


def search_lasting(problem: Problem, first: Search, final: Fit) -> tuple[Search, Found]:
    """Search on from what was found, errors that last taken for that; the problem weighs readings so when this returns."""
    found = first
    result: Found = final, {}, []
    for _ in range(TIMES):
        begin, names = result[0], result[0].spec.variant
        likelihood(problem, begin)
        problem.take_for(begin.colour)
        base = problem.fit(first.base.spec, first.base.as_dict(), errors=True)
        found = Search(problem, first.candidates, base, first.progress)
        if begin.spec.variant != base.spec.variant:
            begin = problem.fit(begin.spec, begin.as_dict(), errors=True)
            found.fits[found.key(begin.spec)] = begin
            result = found.settle(found.forward(found.backward(begin)[0]))
        else:
            result = found.run(downwards=False)
        if result[0].spec.variant == names:
            break
    return found, result


def likeliest(problem: Problem, fit: Fit) -> Fit:
    """Return a fit by least squares, or its model fitted as what that leaves lasts: the likelier one.

    Least squares may be far from it where much lasts, and another model only seems likelier then.
    """
    before = likelihood(problem, fit)
    if problem.colour is not None or fit.colour is None or fit.colour.share < LASTS:
        return fit
    problem.take_for(fit.colour)
    other = problem.fit(fit.spec, fit.as_dict(), tolerance=1e-3)
    problem.take_for(None)
    return other if likelihood(problem, other) > before else fit


def nats_beside(problem: Problem, fit: Fit, hidden: Sequence[Hidden], chosen_from: int) -> float:
    """Return the logarithm of a fit's likelihood, causes without a name beside it paid for: their numbers, and the choice."""
    numbers = sum(one.column.shape[1] for one in hidden) + len(fit.spec.free) - len(fit.stuck)
    paid = price(numbers, fit.count) + len(hidden) * math.log(max(1, chosen_from))
    return likelihood(problem, fit) - paid
