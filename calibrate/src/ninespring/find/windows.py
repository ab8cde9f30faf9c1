"""What begins at one time and ends at another, or with the run: which window explains most of what is left.

Columns are what a step up at each of some edges adds to the readings; a window is one of them less a later one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

LEAST_LEFT = 1e-3
"""Of the squares of what is added, the part that must be left beside what is taken out: of less, rounding is the most."""


def steps_up(edges: Sequence[int] | np.ndarray, rows: int, springs: int, at: int | slice) -> np.ndarray:
    """Return 1 from each edge on at a spring, or some: (edges, rows, springs)."""
    out = np.zeros((len(edges), rows, springs))
    for number, edge in enumerate(edges):
        out[number, edge:, at] = 1.0
    return out


def products(columns: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return the products of columns with one another, a basis projected out."""
    inside = basis.T @ columns
    return (columns.T @ columns - inside.T @ inside).astype(float)


def powers(gram: np.ndarray) -> np.ndarray:
    """Return the squares of every window, (edges, edges + 1), from the products of steps up; the last edge is the end."""
    square = np.append(np.diag(gram), 0.0)
    return np.diag(gram)[:, None] + square[None, :] - 2.0 * np.pad(gram, ((0, 0), (0, 1)))


def best(
    moment: np.ndarray, gram: np.ndarray, shortest: int, of_all: np.ndarray | float = 0.0
) -> tuple[float, int, int]:
    """Return what the best window of so many edges or more would explain, and its edges, of those not taken out nearly whole by now.

    `of_all` are their squares with nothing taken out; the last edge is the end of the run.
    """
    power, count = powers(gram), len(moment)
    gain = (moment[:, None] - np.append(moment, 0.0)[None, :]) ** 2 / np.maximum(power, 1e-9)
    long = np.arange(count + 1)[None, :] - np.arange(count)[:, None] >= shortest
    gain = np.where(long & (power > LEAST_LEFT * of_all) & (power > 1e-6), gain, 0.0)
    a, b = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(gain[a, b]), int(a), int(b)
