"""What a fit found: a model's numbers, what they leave, how sure they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..model.spec import Spec
from .likelihood import Colour

NORMAL_95 = 1.959964
"""Standard deviations within which a normal number lies in 95 of 100 cases."""


@dataclass
class Fit:
    """A fitted model: values, what it leaves, how sure."""

    spec: Spec
    values: np.ndarray
    chi2: float
    """Sum of squared residuals in units of the noise, errors of the starting temperatures whitened out."""
    count: int
    residual: list[np.ndarray]
    """Per run (rows, springs), degC, NaN where nothing was measured."""
    jacobian: np.ndarray | None = None
    """d(residual / noise) / d(inner coordinate), (count, free)."""
    weighed: Colour | str | None = None
    """How readings were weighed there (`Problem.weighed`)."""
    vector: np.ndarray | None = None
    firm: float = 1.0
    """How many times as firmly what is believed of its numbers stood against the readings."""
    covariance: np.ndarray | None = None
    """Of the inner coordinates, autocorrelation taken into account."""
    stuck: list[str] = field(default_factory=list)
    """Numbers that the data cannot fix: held at their start."""
    sse: float = math.nan
    """Plain sum of squared residuals in units of the noise."""
    factor: float = math.nan
    """Samples per independent sample of the residual, where it has been computed."""
    colour: Colour | None = None
    """How what it leaves lasts, where it has been fitted ..."""
    nats: float = math.nan
    """... and the logarithm of its likelihood with that."""
    holdout: float = math.nan
    """Held-out rms error, degC, where it has been computed."""

    def value(self, key: str) -> float:
        """Return a fitted number by key."""
        return float(self.values[[f.key for f in self.spec.free].index(key)])

    def as_dict(self) -> dict[str, float]:
        """Return fitted numbers by key."""
        return {f.key: float(v) for f, v in zip(self.spec.free, self.values, strict=True)}

    def stderr(self) -> dict[str, float]:
        """Return standard errors in the numbers' own units; infinite where the data say nothing."""
        out = {}
        for k, f in enumerate(self.spec.free):
            if f.key in self.stuck or self.covariance is None:
                out[f.key] = math.inf
                continue
            inner = math.sqrt(max(0.0, float(self.covariance[k, k])))
            out[f.key] = inner * (abs(self.values[k]) if f.log else f.scale)
        return out

    def errors_of_settings(self) -> dict[str, float]:
        """Return standard errors of the plant's parameters that its numbers make; those that the data cannot fix are left out."""
        out: dict[str, float] = {}
        for free, error in zip(self.spec.free, self.stderr().values(), strict=True):
            if math.isfinite(error):
                out |= dict.fromkeys(free.names, error)
                for name, weight in free.shifts:
                    out[name] = math.hypot(out.get(name, 0.0), weight * error)
        return out

    def intervals(self) -> dict[str, tuple[float, float]]:
        """Return where each number lies in 95 of 100 cases, in its own unit; numbers that the data cannot fix are left out.

        Symmetric in the coordinate in which it was fitted, for one that is fitted by its logarithm in proportion; within its bounds.
        """
        out: dict[str, tuple[float, float]] = {}
        for k, free in enumerate(self.spec.free):
            if self.covariance is not None and free.key not in self.stuck:
                at, error = free.inner(float(self.values[k])), math.sqrt(max(0.0, float(self.covariance[k, k])))
                out[free.key] = free.outer(at - NORMAL_95 * error), free.outer(at + NORMAL_95 * error)
        return out

    def correlations(self, limit: float = 0.98) -> list[tuple[str, str, float]]:
        """Return pairs of numbers whose errors are correlated beyond `limit`, strongest first."""
        if self.covariance is None:
            return []
        deviation = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        rho = self.covariance / np.outer(deviation, deviation)
        keys = [f.key for f in self.spec.free]
        pairs = [
            (keys[a], keys[b], float(rho[a, b]))
            for a in range(len(keys))
            for b in range(a)
            if abs(rho[a, b]) > limit and keys[a] not in self.stuck and keys[b] not in self.stuck
        ]
        return sorted(pairs, key=lambda one: -abs(one[2]))

    def at_bounds(self) -> list[str]:
        """Return keys of numbers at a bound."""
        out = []
        for f, v in zip(self.spec.free, self.values, strict=True):
            z, low, high = f.inner(v), f.inner(f.low), f.inner(f.high)
            if f.ends:
                continue
            if z <= low + 1e-3 * (high - low) or z >= high - 1e-3 * (high - low):
                out.append(f.key)
        return out
