"""What speaks for one fit against another: nats with autocorrelation accounted for, structure, differences."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from ..fit import statistics
from ..fit.problem import Problem
from ..fit.spec import Fit

EQUIVALENT = 0.3
"""Two models whose predictions differ by less than this (rms, in units of the noise) are the same in practice."""
UNEXPLAINED = 0.5
"""Structure left, rms in units of the noise, above which the rest counts as unexplained: less does not matter."""
UNEXPLAINED_LOCAL = 1.0
"""The same for one spring of one run, where the two laws of a phase change may differ for a while."""


WIDTHS = (4, 12, 40)
"""Of the blocks in which structure is looked for, rows; in each spring by itself at all but the first."""
LAGS = 6
"""Of the autoregression that stands for a residual's colour."""


def log_evidence(problem: Problem, better: Fit, other: Fit) -> float:
    """Return by how many nats the data prefer `better`: half the difference of BIC, autocorrelation accounted for.

    Two accounts, the clearer one counts. Slow structure: residuals at their effective sample size. Everything faster:
    generalised least squares. What `better` leaves tells the noise's colour, as an autoregression; both residuals are
    whitened by it. A thermometer that wanders then says little of what is slow, and no less of what is quick.
    """
    factor = fit_factor(problem, better)
    n = better.count / factor
    k = len(better.spec.free) - len(better.stuck) - (len(other.spec.free) - len(other.stuck))
    slow = 0.5 * n * math.log(max(other.chi2, 1e-12) / max(better.chi2, 1e-12)) - 0.5 * k * math.log(max(n, 2.0))
    if better.chi2 > other.chi2:
        return slow
    colour = coefficients(problem, better)
    left, would_be_left = innovations(problem, better, colour), innovations(problem, other, colour)
    spread = max(1e-12, left / better.count)
    whitened = 0.5 * (would_be_left - left) / spread - 0.5 * k * math.log(better.count)
    return max(slow, whitened)


def _in_noise(problem: Problem, fit: Fit) -> list[np.ndarray]:
    return [np.nan_to_num(left / noise) for left, noise in zip(fit.residual, problem.noise, strict=True)]


def coefficients(problem: Problem, fit: Fit) -> np.ndarray:
    """Return the autoregression of a fit's residual, (LAGS,): least squares over all runs and springs."""
    if fit.colour is None:
        normal, moment = np.eye(LAGS), np.zeros(LAGS)
        for one in _in_noise(problem, fit):
            before = np.stack([one[LAGS - k : len(one) - k].ravel() for k in range(1, LAGS + 1)])
            normal += before @ before.T
            moment += before @ one[LAGS:].ravel()
        fit.colour = np.linalg.solve(normal, moment)
    return fit.colour


def innovations(problem: Problem, fit: Fit, colour: np.ndarray) -> float:
    """Return the sum of squares of a fit's residual, in units of the noise, whitened by an autoregression."""
    filtered = [lfilter(np.concatenate(([1.0], -colour)), [1.0], one, axis=0) for one in _in_noise(problem, fit)]
    return sum(float((one[LAGS:] ** 2).sum()) for one in filtered)


def fit_factor(problem: Problem, fit: Fit) -> float:
    """Return samples per independent sample of a fit's residual."""
    if not math.isfinite(fit.factor):
        fit.factor = statistics.correlation_factor(
            [left / noise for left, noise in zip(fit.residual, problem.noise, strict=True)],
            problem.longest_lag(),
        )
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
    total = 0.0
    for one, two, noise, mask in zip(a.residual, b.residual, problem.noise, problem.mask, strict=True):
        total += float((((one - two) / noise)[mask] ** 2).sum())
    return math.sqrt(total / a.count)


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
