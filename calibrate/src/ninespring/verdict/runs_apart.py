"""How far runs lie apart in what may be a run's own: the spread of these random effects, fitted, and what is said of it."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import Any

from .. import effects
from ..fit.problem import Problem
from ..fit.spec import RUN_DRIVE, RUNS_OWN, Fit
from ..search.certainty import CERTAIN, Witness
from .result import parameters_of

ROUNDS = 3
"""Of fitting the runs' numbers and their spread in turn (expectation maximisation): more moves neither."""


def spread_of(fit: Fit, effect: str) -> float:
    """Return how far runs lie apart about the array's own number, rms, in the inner coordinate: sizes and errors both count."""
    errors = fit.stderr()
    own = [(f, value) for f, value in zip(fit.spec.free, fit.values, strict=True) if f.effect == effect]
    squares = []
    for free, value in own:
        error = errors[free.key] / (abs(value) if free.log else free.scale)
        squares.append((free.inner(value) - free.inner(free.start)) ** 2 + (error**2 if math.isfinite(error) else 0.0))
    return math.sqrt(sum(squares) / max(1, len(squares)))


def with_spread(problem: Problem, fit: Fit) -> Fit:
    """Return the fit with what is a run's own believed to lie as far apart as it does."""
    mine = [effect for effect in fit.spec.effects if effect in RUNS_OWN]
    for _ in range(ROUNDS if mine else 0):
        spread = {effect: max(1e-6, spread_of(fit, effect)) for effect in mine}
        free = tuple(replace(f, prior=spread.get(f.effect or "", f.prior)) for f in fit.spec.free)
        fit = problem.fit(replace(fit.spec, free=free), fit.as_dict(), tolerance=1e-5, errors=True)
    return fit


def entry(problem: Problem, fit: Fit, effect: str, nats: float, sure: Witness) -> dict[str, Any]:
    """Return what diagnosis.json says of it: each run's number, and how far they lie apart."""
    parameters = parameters_of(problem, fit, effect)
    return {
        "name": effect,
        "evidence": nats,
        "probability": sure.probability(),
        "certainty": "certain" if sure.probability() >= CERTAIN else "probable",
        "witness": asdict(sure),
        "spread": {"value": spread_of(fit, effect), "unit": "1" if effect == RUN_DRIVE else "K"},
        "parameters": parameters,
        "text": effects.sentence(effect, parameters),
    }
