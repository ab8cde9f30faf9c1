"""How sure a fit is of its numbers: confidence intervals, and which numbers' errors go together."""

from __future__ import annotations

import math

from scipy.special import ndtri

from .fit import Fit

TOLD = 0.1
"""Correlations below this are not told."""


def intervals(fit: Fit, share: float = 0.95) -> dict[str, tuple[float, float]]:
    """Return where each number lies in `share` of cases, in its own unit; numbers that the data cannot fix are left out.

    Symmetric in the coordinate in which it was fitted: for a number that is fitted by its logarithm, in proportion. Within its
    bounds. Autocorrelation of what is left is in the covariance already.
    """
    times = float(ndtri(0.5 + 0.5 * share))
    out: dict[str, tuple[float, float]] = {}
    for k, free in enumerate(fit.spec.free):
        if fit.covariance is None or free.key in fit.stuck:
            continue
        at, deviation = free.inner(float(fit.values[k])), math.sqrt(max(0.0, float(fit.covariance[k, k])))
        out[free.key] = (free.outer(at - times * deviation), free.outer(at + times * deviation))
    return out


def correlations(fit: Fit, least: float = TOLD) -> list[tuple[str, str, float]]:
    """Return pairs of numbers whose errors go together by more than `least`, strongest first."""
    return sorted(fit.correlations(least), key=lambda one: -abs(one[2]))
