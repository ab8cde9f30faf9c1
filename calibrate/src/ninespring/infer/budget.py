"""What one diagnosis may simulate. Simulations are counted, no time: a slow machine finds what a quick one finds."""

from __future__ import annotations

import threading

ENOUGH = 11_000
"""Simulations of a run, after which nothing further is begun: some twenty-two seconds of one core for two 15 min logs of nine
springs."""
PARTS = 4
"""A search may take one part in so many of what is left when it begins: the rest is for what follows from what it finds."""


class Budget:
    """Counts the simulations of one problem, which all its searches share; knows whether anything was left undone."""

    def __init__(self) -> None:
        self.enough, self.taken, self.short = ENOUGH, 0, False
        self._lock = threading.Lock()

    def take(self, simulations: int = 1) -> None:
        """Count simulations, from whichever thread."""
        with self._lock:
            self.taken += simulations

    def share(self) -> int:
        """Return the count up to which a search that begins now may begin further steps."""
        return self.taken + max(0, self.enough - self.taken) // PARTS

    def allows(self, more: int = 0) -> bool:
        """Return whether so many more may be begun; where not, something is left undone."""
        within = self.taken + more <= self.enough
        self.short |= not within
        return within
