"""The greedy pursuit: of causes that there are to choose from, the one that explains most of what is left, for a while or all the time.

Columns of what begins at one time and ends at another, or with the run, are what a step up at each of some edges adds to the readings; a
window is one of them less a later one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .causes import Cause

LEAST_LEFT = 1e-3
"""Of the squares of what is added, the part that must be left beside what is taken out: of less, rounding is the most."""


def steps_up(edges: Sequence[int] | np.ndarray, rows: int, springs: int, at: int | slice) -> np.ndarray:
    """Return 1 from each edge on at a spring, or some: (edges, rows, springs)."""
    out = np.zeros((len(edges), rows, springs))
    for number, edge in enumerate(edges):
        out[number, edge:, at] = 1.0
    return out


def _powers(gram: np.ndarray) -> np.ndarray:
    """Return the squares of every window, (edges, edges + 1), from the products of steps up; the last edge is the end."""
    square = np.append(np.diag(gram), 0.0)
    return np.diag(gram)[:, None] + square[None, :] - 2.0 * np.pad(gram, ((0, 0), (0, 1)))


@dataclass(frozen=True)
class Choice:
    """A cause that explains most of what is left."""

    drop: float
    """By which it lets the sum of squares fall."""
    cause: Cause
    vector: np.ndarray
    """What a unit of it adds, (samples,)."""
    edges: tuple[int, int] = (0, 0)
    """Of a window, at which of its cause's edges it begins and ends."""

    @property
    def rows(self) -> tuple[int, int | None]:
        """Rows of its run from which and before which it acts."""
        begin, end = self.edges
        return (self.cause.edges[begin], self.cause.edges[end]) if self.cause.edges else (0, None)


class Pursuit:
    """Causes to choose from, each beside what is taken out by now."""

    def __init__(
        self,
        causes: Sequence[Cause],
        basis: np.ndarray,
        shortest: int,
        signs: Mapping[str, int] | None = None,
        least_left: float = LEAST_LEFT,
    ) -> None:
        """`basis` (samples, n) is taken out; a window has `shortest` edges or more; `signs`: of the kinds whose size has only one. What is
        there by less than `least_left` beside what is taken out explains nothing."""
        self.single = [one for one in causes if not one.edges]
        self.windows = [one for one in causes if one.edges]
        self.basis = basis
        self._shortest, self._signs, self._least_left = shortest, signs or {}, least_left
        empty = np.zeros((len(basis), 0), dtype=np.float32)
        self._matrix = np.column_stack([empty, *(one.columns[:, 0] for one in self.single)])
        self._sign = np.array([self._signs.get(one.kind, 0) for one in self.single])
        self._whole = (self._matrix**2).sum(axis=0)
        self._power = self._whole - ((basis.T @ self._matrix) ** 2).sum(axis=0)
        self._grams: dict[int, tuple[Cause, np.ndarray]] = {}
        self._of_all = [_powers((one.columns.T @ one.columns).astype(float)) for one in self.windows]

    def take(self, units: np.ndarray) -> None:
        """Take more out: an orthonormal basis (samples, n) beside what is taken out by now."""
        self.basis = np.column_stack([self.basis, units])
        self._power = self._power - ((units.T @ self._matrix) ** 2).sum(axis=0)
        for one, gram in self._grams.values():
            inside = units.T @ one.columns
            gram -= inside.T @ inside

    def gram(self, one: Cause) -> np.ndarray:
        """Return the products of a cause's columns with one another, what is taken out projected out."""
        if id(one) not in self._grams:
            inside = self.basis.T @ one.columns
            self._grams[id(one)] = one, (one.columns.T @ one.columns - inside.T @ inside).astype(float)
        return self._grams[id(one)][1]

    def gains(self, left: np.ndarray) -> np.ndarray:
        """Return what each of those that act all the time explains of what is left (samples,)."""
        moment = self._matrix.T @ left
        possible = (self._power > self._least_left * self._whole) & ((self._sign == 0) | (self._sign * moment > 0))
        return np.where(possible, moment**2 / np.maximum(self._power, 1e-12), 0.0)

    def best(self, left: np.ndarray, but: Callable[[Cause], bool] = lambda one: False, rests: int = 0) -> Choice | None:
        """Return the best of all but some, by what is left (samples,), None where there is none; a window leaves out `rests` edges of
        its run or more."""
        gains, out = np.where([but(one) for one in self.single], 0.0, self.gains(left)), None
        if gains.size:
            k = int(np.argmax(gains))
            out = Choice(float(gains[k]), self.single[k], self._matrix[:, k])
        for one, of_all in zip(self.windows, self._of_all, strict=True):
            if but(one):
                continue
            drop, a, b = self._window(one, of_all, left, rests)
            if drop > (out.drop if out else 0.0):
                vector = one.columns[:, a] - (0.0 if b == len(of_all) else one.columns[:, b])
                out = Choice(drop, one, vector, (a, b))
        return out

    def _window(self, one: Cause, of_all: np.ndarray, left: np.ndarray, rests: int) -> tuple[float, int, int]:
        """Return what the best window of a cause explains, and its edges, the last of which is the end of the run."""
        moment, power, count = one.columns.T @ left, _powers(self.gram(one)), len(of_all)
        moments = moment[:, None] - np.append(moment, 0.0)[None, :]
        edges = np.arange(count + 1)[None, :] - np.arange(count)[:, None]
        possible = (edges >= self._shortest) & (edges <= count - rests) & (power > 1e-6)
        possible &= power > self._least_left * of_all
        if sign := self._signs.get(one.kind):
            possible &= sign * moments > 0
        gain = np.where(possible, moments**2 / np.maximum(power, 1e-9), 0.0)
        a, b = np.unravel_index(int(np.argmax(gain)), gain.shape)
        return float(gain[a, b]), int(a), int(b)
