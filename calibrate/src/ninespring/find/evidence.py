"""What speaks for one fit against another: nats of one likelihood, structure, differences."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..infer.fit import Fit
from ..infer.likelihood import fitted
from ..infer.problem import Problem
from ..io import statistics

EQUIVALENT = 0.3
"""Two models whose predictions differ by less than this (rms, in units of the noise) are the same in practice."""
UNEXPLAINED = 0.5
"""Structure left, rms in units of the noise, above which the rest counts as unexplained: less does not matter."""
UNEXPLAINED_LOCAL = 1.0
"""The same for one spring of one run, where the two laws of a phase change may differ for a while."""


WIDTHS = (4, 12, 40)
"""Of the blocks in which structure is looked for, rows; in each spring by itself at all but the first."""


def log_evidence(problem: Problem, better: Fit, other: Fit) -> float:
    """Return by how many nats the data prefer `better`: the difference of likelihoods, each with what it leaves taken for noise that
    lasts as long as it does, and of what is believed of random effects, less half the logarithm of the readings for each number more
    (BIC)."""
    return likelihood(problem, better) - likelihood(problem, other) + relief(better, other)


def relief(better: Fit, other: Fit) -> float:
    """Return the nats for `better` that no reading tells: random effects that need not lie so far apart, less the price of its numbers."""
    k = len(better.spec.free) - len(better.stuck) - (len(other.spec.free) - len(other.stuck))
    return strain(other, better) - strain(better, other) - price(k, better.count)


def price(numbers: float, samples: float) -> float:
    """Return the nats that so many numbers must be worth, by so many independent samples: half their logarithm each (BIC)."""
    return 0.5 * numbers * math.log(max(2.0, samples))


def strain(fit: Fit, beside: Fit) -> float:
    """Return the nats by which an effect's numbers are less likely than those in the middle of what is believed of them; of an
    effect that only the fit beside it has, the value that the numbers have without."""
    pairs = [(f, float(v)) for f, v in zip(fit.spec.free, fit.values, strict=True) if f.effect is not None]
    own = {f.key for f, _ in pairs}
    pairs += [(f, f.absent) for f in beside.spec.free if f.absent is not None and f.key not in own]
    return sum(0.5 * (f.trust * (f.inner(v) - f.inner(f.start))) ** 2 for f, v in pairs)


def likelihood(problem: Problem, fit: Fit) -> float:
    """Return the logarithm of a fit's likelihood, errors that last fitted beside the white noise (infer/likelihood.py)."""
    if not math.isfinite(fit.nats):
        left = problem.scaled(problem.without_errors(fit.residual))
        fit.colour, fit.nats = fitted(problem.rows, left, problem.least)
    return fit.nats


def fit_factor(problem: Problem, fit: Fit) -> float:
    """Return samples per independent sample of a fit's residual."""
    if problem.colour is not None:
        return 1.0
    if not math.isfinite(fit.factor):
        fit.factor = problem.alike([left / noise for left, noise in zip(fit.residual, problem.noise, strict=True)])
    return fit.factor


def gain(better: Fit, other: Fit) -> float:
    """Return the structure that `better` explains and `other` does not, rms in units of the noise."""
    return math.sqrt(max(0.0, other.sse - better.sse) / better.count)


def excess(problem: Problem, fit: Fit) -> float:
    """Return what the residual holds beyond white noise, as a mean square in units of the noise (>= 0)."""
    return _pooled(problem, _structures(problem, fit))


def _structures(problem: Problem, fit: Fit) -> list[np.ndarray]:
    """Return the structure (mean square, noise units) of each run and spring at block widths of WIDTHS."""
    residual = problem.without_errors(fit.residual)
    starts = [run.starts for run in problem.runs]
    return [statistics.structure(residual, problem.noise, width, starts) for width in WIDTHS]


def _pooled(problem: Problem, structures: Sequence[np.ndarray]) -> float:
    """Return the largest of structures, each pooled over runs and springs (>= 0)."""
    readings = np.array([mask.sum(axis=0) for mask in problem.mask], dtype=float)
    out = []
    for part in structures:
        weight = np.where(np.isfinite(part), readings, 0.0)
        out.append(float(np.nansum(np.nan_to_num(part) * weight) / max(1.0, weight.sum())))
    return max(0.0, float(np.nanmax(out)))


def difference(problem: Problem, a: Fit, b: Fit) -> float:
    """Return the rms difference of what two fits predict, in units of the noise."""
    return math.sqrt(problem.plain([one - two for one, two in zip(a.residual, b.residual, strict=True)]) / a.count)


def unexplained(problem: Problem, fit: Fit) -> bool:
    """Return whether structure well above the noise is left in a fit's residual."""
    structures = _structures(problem, fit)
    if math.sqrt(_pooled(problem, structures)) > UNEXPLAINED:
        return True
    for width, local in zip(WIDTHS[1:], structures[1:], strict=True):
        blocks = np.array([mask.sum(axis=0) for mask in problem.mask]) / width
        spread = np.sqrt(2.0 / np.maximum(blocks, 1.0)) / width
        if np.any(local > np.maximum(UNEXPLAINED_LOCAL**2, 6 * spread)):
            return True
    return False
