"""The way down to a fit's minimum: bounded least squares that simulates a slope again only where it no longer holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from ..model.spec import Free
from .fit import Fit

REUSED = 0.1
"""Movement, in the inner coordinates, up to which a slope is used again: a tenth of what matters."""
FORETOLD = 0.5
"""Part of what a step changed that slopes may have foretold wrongly and still be mended, not simulated again: they are right
for the greater part."""
FIRMER = 0.8
"""Of how firmly what is believed stood when a descent began, the part at its end from which that made no difference."""
AGAIN = 4
"""Times that a fit goes on from where it was, at most, what is believed less firm there."""
KEPT = 4
"""Points whose simulations are kept."""

Shown = tuple[list[np.ndarray], np.ndarray]
"""What the runs should show at some numbers, and what they leave as one vector (count,), in units of the noise."""


class Descent:
    """Free numbers on their way: z are their inner coordinates.

    `show` simulates all runs at numbers in their own units, `slopes` returns d(vector) / d(inner coordinate) of the
    numbers named by their places, (count, places), given what is shown there, and `alike` how many readings of a vector
    carry what one of its own would.
    """

    def __init__(
        self,
        free: Sequence[Free],
        show: Callable[[np.ndarray], Shown],
        slopes: Callable[[np.ndarray, list[np.ndarray], list[int]], np.ndarray],
        alike: Callable[[np.ndarray], float],
    ) -> None:
        self.free, self._show, self._slopes, self._alike = list(free), show, slopes, alike
        self.low = np.array([f.inner(f.low) for f in free])
        self.high = np.array([f.inner(f.high) for f in free])
        # what is believed before, as further residuals: (z - believed) / its standard deviation
        self.believed = np.array([f.inner(f.start) for f in free])
        self.trust = np.array([f.trust for f in free])
        self.firm = 1.0
        """How many times as firmly it stands against the readings, by what they left where the last descent began."""
        self.mended = False
        """Slopes were mended, not simulated: the end may lie before the minimum."""
        self._cache: dict[bytes, Shown] = {}
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def begin_near(self, near: Fit) -> None:
        """Begin with the slopes of another fit of the same readings."""
        keys = [f.key for f in self.free]
        there = {f.key: f.inner(v) for f, v in zip(near.spec.free, near.values, strict=True)}
        at = np.array([there.get(key, np.nan) for key in keys])
        for column, f in enumerate(near.spec.free):
            if f.key in keys:
                self._known[keys.index(f.key)] = (at, near.jacobian[:, column])

    def outer(self, z: np.ndarray) -> np.ndarray:
        """Return the numbers in their own units."""
        return np.array([f.outer(one) for f, one in zip(self.free, z, strict=True)])

    def shown(self, z: np.ndarray) -> Shown:
        """Return what is shown at z."""
        key = z.tobytes()
        if key not in self._cache:
            self._cache[key] = self._show(self.outer(z))
            if len(self._cache) > KEPT:
                self._cache.pop(next(iter(self._cache)))
        return self._cache[key]

    def slope(self, z: np.ndarray) -> np.ndarray:
        """Return the slopes at z: as they were, mended by the last step, or simulated again."""
        vector = self.shown(z)[1]
        if not self._mend(z, vector):
            stale = [
                c
                for c in range(len(self.free))
                if c not in self._known or np.nanmax(np.abs(z - self._known[c][0])) > REUSED
            ]
            if stale:
                fresh = self._slopes(self.outer(z), self.shown(z)[0], stale)
                self._known.update({c: (z.copy(), fresh[:, k]) for k, c in enumerate(stale)})
        self._last = (z.copy(), vector)
        return np.column_stack([self._known[c][1] for c in range(len(self.free))])

    def _mend(self, z: np.ndarray, vector: np.ndarray) -> bool:
        """Mend the slopes where what they foretold of the last step says that they still hold (Broyden 1965)."""
        if self._last is None or len(self._known) < len(self.free):
            return False
        moved, changed = z - self._last[0], vector - self._last[1]
        missed = changed - sum(self._known[c][1] * one for c, one in enumerate(moved))
        length = float(moved @ moved)
        if not (length > 0 and float(missed @ missed) < FORETOLD**2 * float(changed @ changed)):
            return False
        self.mended = True
        self._known.update({c: (z, self._known[c][1] + missed * (moved[c] / length)) for c in self._known})
        return True

    def forget(self) -> None:
        """Have all slopes simulated again."""
        self._known.clear()
        self._last = None

    def to_minimum(self, values: np.ndarray, tolerance: float, max_steps: int, settle: bool) -> OptimizeResult:
        """Return the minimum below these numbers; without `settle` it may end before it."""
        z = np.array([f.inner(v) for f, v in zip(self.free, values, strict=True)])
        margin = 1e-6 * (self.high - self.low)
        found = self._descend(np.clip(z, self.low + margin, self.high - margin), tolerance, max_steps)
        if self.mended and settle:
            # slopes that were mended may end before the minimum: fresh ones say whether they did
            self.forget()
            found = self._descend(found.x, tolerance, max_steps)
        for _ in range(AGAIN if settle else 0):
            if self._firm(found.x) > FIRMER * self.firm:
                break
            found = self._descend(found.x, tolerance, max_steps)
        return found

    def _firm(self, z: np.ndarray) -> float:
        """Return how firmly what is believed stands against the readings at z: as if their noise were as large as what is off there,
        and as lasting. Readings that a model misses by ten times their noise, for minutes, say little of its numbers."""
        if not self.trust.any():
            return 1.0
        vector = self.shown(z)[1]
        return math.sqrt(max(1.0, float(vector @ vector) / max(1, vector.size)) * self._alike(vector))

    def _descend(self, begin: np.ndarray, tolerance: float, max_steps: int) -> OptimizeResult:
        self.firm = self._firm(begin)
        some, trust = self.trust > 0, self.firm * self.trust
        return least_squares(
            lambda z: np.concatenate([self.shown(z)[1], (trust * (z - self.believed))[some]]),
            begin,
            jac=lambda z: np.vstack([self.slope(z), np.diag(trust)[some]]),
            bounds=(self.low, self.high),
            x_scale="jac",
            ftol=tolerance,
            xtol=1e-6,
            gtol=1e-10,
            max_nfev=max_steps,
        )
