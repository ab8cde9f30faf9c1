"""How likely readings are by a model: what it leaves, as innovations of a filter that knows how its errors last.

A model's error is no white noise: heat that nobody logged stays in a spring for as long as the spring holds heat, a room that
wanders for an hour longer. Both are processes here, of each thermometer's own and of all together (their mean), with variance
and time constant fitted beside the white noise of the sensors: what is left is then a likelihood, whatever its colour. A
difference of two of them is what the data say for one model against another, and every row counts for what it is worth.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from ..io import statistics
from ..model import native

BROKEN = 1e12
"""Step, s, over a gap: nothing lasts that long."""
NONE = 1e-7
"""Variance, in units of the white noise's, of an error that is not there."""
LARGEST = 1e5
QUICK_S, SLOW_S = (3.0, 600.0), (600.0, 14400.0)
"""Time constants: of what a spring and its thermometer keep, and of what a box or a room keeps."""
BEGIN_S = (3.5, 12.0, 40.0, 130.0, 450.0), (700.0, 6000.0)
"""Time constants at which the fit begins, from the likeliest of each quick one: a likelihood of several errors has more than
one hill ..."""
BEGIN_SLOW = (0.02, 0.5, 0.98)
"""... and what of all that lasts is then slow."""
SPRINT, STEPS = 6, 60
"""Steps of the fit from each beginning, and of those that then go on, at most."""
BEHIND = 2.0
"""Nats behind the likeliest after the sprint from which a beginning does not go on: of 60 such fits one would have come to a
likelier end, by a fifth of a nat."""
FULL = 0.9
"""Part of the rows with readings that must have all of them for thermometers to be told apart from their mean."""


@dataclass(frozen=True)
class Colour:
    """How errors last: variances in units of the white noise's, time constants."""

    apart: tuple[float, float] = (NONE, NONE)
    """Of each thermometer's own, quick and slow."""
    together: tuple[float, float] = (NONE, NONE)
    """Of the mean of all of them, quick and slow."""
    time_s: tuple[float, float] = (60.0, 3600.0)
    white: float = 1.0
    """Variance of the white noise, in units of what was taken for it."""

    @property
    def share(self) -> float:
        """Variance of all that lasts, in units of the white noise's."""
        return max(sum(self.apart), sum(self.together))


def _filtered(
    step_s: np.ndarray, there: bytes, variance: Sequence[float], time_s: Sequence[float], fields: np.ndarray
) -> float:
    """Whiten fields (rows, columns) in place; return the sum of the logarithms of the deviations of one column."""
    rows, columns = fields.shape
    sizes, lasts = np.asarray(variance, dtype=float), np.asarray(time_s, dtype=float)
    states = np.empty(len(sizes) * columns)
    step, size, last, room, data = (native.doubles(one) for one in (step_s, sizes, lasts, states, fields))
    return float(native.library().whiten(rows, len(sizes), step, there, size, last, columns, room, data))


@dataclass(frozen=True)
class Rows:
    """The rows of one run as the filter walks them."""

    step_s: np.ndarray
    mask: np.ndarray
    """(rows, springs): where something was read."""
    turn: np.ndarray | None
    """Thermometers turned into their mean and what is not it, (seen, seen); None: each is its own."""
    seen: np.ndarray
    there: tuple[bytes, ...]
    """Per channel of `seen`, where it has readings; of all together where they are turned."""

    @staticmethod
    def of(time_s: np.ndarray, starts: Sequence[int], mask: np.ndarray) -> Rows:
        """Return them for a run's times, the rows at which it begins again, and where it has readings."""
        step = np.ascontiguousarray(np.diff(time_s, prepend=time_s[0]))
        step[list(starts)] = BROKEN
        seen = np.flatnonzero(mask.any(axis=0))
        some = mask[:, seen]
        all_there = np.asarray(some.all(axis=1))
        turn = None
        if len(seen) > 1 and all_there.sum() >= FULL * some.any(axis=1).sum():
            turn = np.linalg.qr(np.column_stack([np.ones(len(seen)), np.eye(len(seen))[:, 1:]]))[0].T
            some = np.repeat(all_there[:, None], len(seen), axis=1)
        there = tuple(np.ascontiguousarray(some[:, k]).astype(np.uint8).tobytes() for k in range(len(seen)))
        return Rows(step, mask, turn, seen, there)

    @property
    def count(self) -> int:
        """Readings that count."""
        return sum(one.count(1) for one in self.there)

    def sizes(self, colour: Colour, channel: int) -> tuple[float, float]:
        """Return the variances of a channel's errors that last."""
        return colour.together if self.turn is not None and channel == 0 else colour.apart

    def whitened(self, columns: np.ndarray, colour: Colour) -> tuple[np.ndarray, float]:
        """Return columns (readings, n), in units of the noise, as innovations, and the sum of the logarithms of their deviations.

        They stand where the readings stood; where thermometers are turned, what is their mean is the first one's.
        """
        rows, springs = self.mask.shape
        fields = np.zeros((rows, springs, columns.shape[1]))
        fields[self.mask] = columns
        part = fields[:, self.seen]
        if self.turn is not None:
            part = np.einsum("ab,rbc->rac", self.turn, part)
        logarithms = 0.0
        for k, there in enumerate(self.there):
            one = np.ascontiguousarray(part[:, k])
            logarithms += _filtered(self.step_s, there, self.sizes(colour, k), colour.time_s, one)
            part[:, k] = one
        fields[:, self.seen] = part
        return fields[self.mask], logarithms

    def turned(self, vector: np.ndarray) -> list[np.ndarray]:
        """Return a vector (readings,) as the filter's channels, (rows, channels of one kind): their mean, and each its own."""
        fields = np.zeros(self.mask.shape)
        fields[self.mask] = vector
        part = fields[:, self.seen]
        if self.turn is None:
            return [np.zeros((len(part), 0)), part]
        part = part @ self.turn.T
        return [np.ascontiguousarray(part[:, :1]), np.ascontiguousarray(part[:, 1:])]


@dataclass
class _Walk:
    """Fields of so many columns, one behind another: over a step from each to the next all is forgotten."""

    step_s: np.ndarray
    there: bytes
    field: np.ndarray
    """(rows, columns)."""

    def __post_init__(self) -> None:
        rows, columns = self.field.shape
        self.states, self.out = np.empty(10 * columns), np.empty(10)
        step, field, states, out = (native.doubles(one) for one in (self.step_s, self.field, self.states, self.out))
        self._before, self._after = (rows, step, self.there), (columns, states, field, out)

    def weighed(self, variance: object, time_s: object) -> np.ndarray:
        """Return squares and logarithms, and the slopes of both: (10,), as whiten.c has them."""
        native.library().weigh(*self._before, variance, time_s, *self._after)
        self.out[[1, 6, 7, 8, 9]] *= self.field.shape[1]
        return self.out


class Weighed:
    """What a model leaves, as its likelihood weighs it: the runs' fields (rows, columns), of what is not their mean and of means."""

    def __init__(self, rows: Sequence[Rows], vectors: Sequence[np.ndarray], least: float = 0.0) -> None:
        self.count = sum(one.count for one in rows)
        self.least = least
        self.together = any(one.turn is not None for one in rows)
        pieces: tuple[dict[int, list[tuple[np.ndarray, bytes, np.ndarray]]], ...] = ({}, {})
        for one, vector in zip(rows, vectors, strict=True):
            mean, own = one.turned(vector)
            each = [(0, one.there[0], own), (1, one.there[0], mean)]
            if one.turn is None:
                each = [(0, there, own[:, [k]]) for k, there in enumerate(one.there)]
            for which, there, field in each:
                pieces[which].setdefault(field.shape[1], []).append((one.step_s, there, field))
        self.walks = [
            [
                _Walk(np.concatenate(step), b"".join(there), np.concatenate(field))
                for step, there, field in (zip(*part, strict=True) for part in kind.values())
            ]
            for kind in pieces
        ]

    def of(self, which: int, variance: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return squares and logarithms of one kind of fields, and the slopes of both: (10,)."""
        size, lasts = native.doubles(variance), native.doubles(time_s)
        return sum((walk.weighed(size, lasts) for walk in self.walks[which]), np.zeros(10))

    def loss(self, squares: float, logarithms: float) -> float:
        """Return the negative logarithm of the likelihood, white noise as large as fits, but for a constant."""
        return statistics.surprise(squares, self.count, self.least) + logarithms

    def at(self, z: np.ndarray) -> tuple[float, np.ndarray, float]:
        """Return the loss at logarithms of variances (own quick, slow, mean's quick, slow) and time constants, its slopes,
        and the squares."""
        size = np.exp(z)
        own, mean = self.of(0, size[:2], size[4:]), self.of(1, size[2:4], size[4:])
        both = own + mean
        slope = np.concatenate(
            [
                0.5 / statistics.variance(both[0], self.count, self.least) * one[2:6] + one[6:]
                for one in (own, mean, both)
            ]
        )
        return self.loss(both[0], both[1]), slope[[0, 1, 4, 5, 10, 11]], float(both[0])

    def begins(self) -> list[np.ndarray]:
        """Return the likeliest of some simple errors with each quick time constant: as large as what is left."""
        sizes = []
        for walks in self.walks:
            readings = sum(one.there.count(1) * one.field.shape[1] for one in walks)
            squares = sum(float(np.vdot(one.field, one.field)) for one in walks)
            sizes.append(max(0.1, squares / max(1, readings) - 1.0))
        out = []
        for quick_s in BEGIN_S[0]:
            tried = []
            for slow_s in BEGIN_S[1]:
                time_s = np.array([quick_s, slow_s])
                split = [[np.array([(1.0 - slow) * size, slow * size]) for slow in BEGIN_SLOW] for size in sizes]
                each = [[(one, self.of(which, one, time_s)) for one in split[which]] for which in (0, 1)]
                for (own, a), (mean, b) in itertools.product(*each):
                    z = np.log([*own, *mean, quick_s, slow_s])
                    tried.append((self.loss(a[0] + b[0], a[1] + b[1]), tuple(z)))
            out.append(np.array(min(tried)[1]))
        return out


def fitted(rows: Sequence[Rows], vectors: Sequence[np.ndarray], least: float = 0.0) -> tuple[Colour, float]:
    """Return how errors last by what a model leaves, per run in units of the noise, and the logarithm of its likelihood: by white
    noise of `least` variance or more."""
    weighed = Weighed(rows, vectors, least)
    low = np.log([NONE, NONE, NONE, NONE, QUICK_S[0], SLOW_S[0]])
    high = np.log([LARGEST, LARGEST, LARGEST, LARGEST, QUICK_S[1], SLOW_S[1]])
    free = np.array([0, 1, 2, 3, 4, 5] if weighed.together else [0, 1, 4, 5])
    alone = Colour()
    nothing = np.log([*alone.apart, *alone.together, *alone.time_s])
    value, _, squares = weighed.at(nothing)
    best = value, nothing, squares

    def down(begin: np.ndarray, most: int) -> tuple[float, np.ndarray]:
        def only(z: np.ndarray) -> tuple[float, np.ndarray]:
            whole = begin.copy()
            whole[free] = z
            loss, slope, _ = weighed.at(whole)
            return loss, slope[free]

        found = minimize(
            only,
            begin[free],
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(low[free], high[free], strict=True)),
            options={"maxiter": most, "ftol": 1e-8},
        )
        whole = begin.copy()
        whole[free] = found.x
        return float(found.fun), whole

    begun = [down(begin, SPRINT) for begin in weighed.begins()]
    ahead = min(loss for loss, _ in begun)
    for loss, begin in begun:
        if loss < ahead + BEHIND:
            value, whole = down(begin, STEPS)
            if value < best[0]:
                best = value, whole, weighed.at(whole)[2]
    value, whole, squares = best
    size = [float(one) for one in np.exp(whole)]
    if not weighed.together:
        size[2:4] = [NONE, NONE]
    white = statistics.variance(squares, weighed.count, least)
    return Colour((size[0], size[1]), (size[2], size[3]), (size[4], size[5]), white), -value
