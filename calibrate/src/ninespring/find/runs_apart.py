"""How far runs lie apart in what may be a run's own: the spread of these random effects, fitted, and what is said of it."""

from __future__ import annotations

from typing import cast

import numpy as np

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..infer.result import parameters_of
from ..io import results
from ..model import effects
from ..model.spec import RUN_DRIVE
from .certainty import CERTAIN, NAMED, Witness

LEAST_APART = 0.01
"""Part by which springs lie apart at least: none are made better."""


def _own(fit: Fit, effect: str) -> tuple[list[int], np.ndarray]:
    """Return where an effect's numbers stand in a fit, and the covariance of their inner coordinates.

    Of gains it is that of each one's distance from their mean: what they have in common is the command's power, the heat
    capacity or the losses.
    """
    at = [k for k, free in enumerate(fit.spec.free) if free.effect == effect]
    if fit.covariance is None:
        return at, np.zeros((len(at), len(at)))
    covariance = fit.covariance[np.ix_(at, at)]
    if effect == RUN_DRIVE:
        apart = np.eye(len(at)) - 1.0 / len(at)
        covariance = apart @ covariance @ apart.T
    return at, covariance


def spread_of(fit: Fit, effect: str) -> float:
    """Return how far runs lie apart about the array's own number, rms, in the inner coordinate: sizes and errors both count."""
    at, covariance = _own(fit, effect)
    mine = [(fit.spec.free[k], float(fit.values[k])) for k in at]
    z = np.array([f.inner(v) - f.inner(f.start if f.absent is None else f.absent) for f, v in mine])
    return float(np.sqrt(np.mean(z**2 + np.diag(covariance))))


def springs_apart(fit: Fit, each: effects.Candidate) -> dict[str, float]:
    """Return how far springs lie apart in each of their numbers in a fit that has each its own, about their mean, in logarithms."""
    z: dict[str, list[float]] = {}
    for free in each.free:
        z.setdefault(free.key.partition("[")[0], []).append(free.inner(fit.value(free.key)))
    return {name: max(LEAST_APART, float(np.std(of_each, ddof=1))) for name, of_each in z.items()}


def entry(problem: Problem, fit: Fit, effect: str, nats: float, sure: Witness) -> results.RunsDiffer:
    """Return what diagnosis.json says of it: each run's number, and how far they lie apart."""
    parameters = parameters_of(problem, fit, effect)
    at, covariance = _own(fit, effect)
    if effect == RUN_DRIVE and fit.covariance is not None:
        for k, variance in zip(at, np.diag(covariance), strict=True):
            parameters[fit.spec.free[k].key].stderr = float(fit.values[k] * np.sqrt(max(0.0, variance)))
    probability = max(NAMED, sure.probability())  # where less, what was not seen tells of it
    return results.RunsDiffer(
        name=cast(results.OwnOfRuns, effect),
        evidence=nats,
        probability=probability,
        certainty="certain" if probability >= CERTAIN else "probable",
        witness=sure,
        spread=results.Spread(value=spread_of(fit, effect), unit="1" if effect == RUN_DRIVE else "K"),
        parameters=parameters,
        text=effects.sentence(effect, parameters),
    )
