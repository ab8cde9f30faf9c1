"""A field in a few numbers: the same answers for the springs from some tens of states (rational Krylov, moment matching).

Exact at the rates that it was made for, whatever the drive; checked at one between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from ..errors import WorkError
from .field import Field

RATES_PER_S = (0.0, 0.004, 0.05)
"""Where the reduced field is exact: from standing still to 20 s."""
FACTORED_PER_S = 0.004
CHECKED_PER_S = 0.015


@dataclass
class Modes:
    """C dz/dt = -G z + B P; spring means are B.T @ z. Streams and radiation are in G."""

    conductance: np.ndarray
    capacity: np.ndarray
    spring: np.ndarray
    """(states, springs)"""
    unknowns: int
    error: float
    """Largest relative error of a spring's answer at a rate in between."""
    balance: float
    """Heat that left the array, counted where it leaves, less what went in, of 1 W in one spring."""

    def response(self, rate_per_s: float = 0.0) -> np.ndarray:
        """Return K per W, (springs, springs), where all grows as exp(rate t); rate 0 is the steady state."""
        return self.spring.T @ np.linalg.solve(self.conductance + rate_per_s * self.capacity, self.spring)

    def simulate(self, time_s: np.ndarray, power_w: np.ndarray) -> np.ndarray:
        """Return the springs' rise above the air, (rows, springs), K: equal steps, powers held in each, exact."""
        step = float(time_s[1] - time_s[0])
        rate = -np.linalg.solve(self.capacity, self.conductance)
        states, springs = self.spring.shape
        whole = np.zeros((states + springs, states + springs))
        whole[:states, :states] = rate * step
        whole[:states, states:] = np.linalg.solve(self.capacity, self.spring) * step
        both = linalg.expm(whole)[:states]
        z, out = np.zeros(states), np.empty((len(time_s), springs))
        for row in range(len(time_s)):
            out[row] = self.spring.T @ z
            z = both @ np.concatenate([z, power_w[row]])
        return out


class Solver:
    """Solves (G + rate C) x = b, several b, for any rate: one factorisation, conjugate gradients from there."""

    def __init__(
        self, conductance: sparse.csc_matrix, capacity: sparse.csc_matrix, factored_per_s: float = FACTORED_PER_S
    ) -> None:
        self.conductance, self.capacity, self.factored_per_s = conductance, capacity, factored_per_s
        self._near = splu(
            self._at(factored_per_s),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        self._preconditioner = LinearOperator(conductance.shape, self._near.solve)

    def _at(self, rate_per_s: float) -> sparse.csc_matrix:
        return sparse.csc_matrix(self.conductance + rate_per_s * self.capacity)

    def solve(self, rate_per_s: float, right: np.ndarray) -> np.ndarray:
        """Return x, (unknowns, columns)."""
        if rate_per_s == self.factored_per_s:
            return self._near.solve(right)
        matrix = self._at(rate_per_s)
        out = np.empty_like(right)
        for k in range(right.shape[1]):
            out[:, k], left = cg(matrix, right[:, k], rtol=1e-8, maxiter=200, M=self._preconditioner)
            if left:
                raise WorkError("the field's equations did not converge")
        return out


def reduce_field(field: Field) -> Modes:
    """Return a field's few states."""
    blown = math.isfinite(field.flow_w_per_k)
    inputs = np.hstack([field.spring, field.taken]) if blown else field.spring
    pieces = []
    solver = Solver(field.conductance, field.capacity)
    for rate in RATES_PER_S:
        # what the stream takes up has no memory of its own: exact at standing still is enough (and checked)
        pieces.append(solver.solve(rate, inputs if rate == 0.0 else field.spring))
    answers = np.hstack(pieces)
    basis, size, _ = np.linalg.svd(answers / np.linalg.norm(answers, axis=0), full_matrices=False)
    basis = basis[:, size > 1e-9 * size[0]]
    conductance = basis.T @ (field.conductance @ basis)
    capacity = basis.T @ (field.capacity @ basis)
    spring, taken = basis.T @ field.spring, basis.T @ field.taken
    true = field.spring.T @ solver.solve(CHECKED_PER_S, field.spring[:, :1])
    found = spring.T @ np.linalg.solve(conductance + CHECKED_PER_S * capacity, spring[:, :1])
    error = float(np.abs(found - true).max() / np.abs(true).max())

    carried, out_of_lanes = _stream(field, taken)
    conductance = conductance + spring @ field.radiated @ spring.T - taken @ carried
    z = np.linalg.solve(conductance, spring[:, 0])
    left = (
        field.outer @ (basis @ z)
        + field.freed @ (basis @ z)
        + float((field.radiated @ (spring.T @ z)).sum())
        + float(out_of_lanes @ z)
    )
    return Modes(conductance, capacity, spring, field.unknowns, error, abs(left - 1.0))


def _stream(field: Field, taken: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the stream's rise where it enters each cell, and the heat that leaves with it, of the states.

    A cell's stream leaves it warmer by what the cell's air gave it; what a spring loses is reckoned, as its correlation is,
    from the air that comes upon it.
    """
    states, n = taken.shape
    enters, leaves = np.zeros((n, states)), np.zeros(states)
    if not math.isfinite(field.flow_w_per_k):
        return enters, leaves
    for lane in field.lanes:
        rise = np.zeros(states)
        for j in lane:
            enters[j] = rise
            rise = rise + (taken[:, j] - field.taken[:, j].sum() * rise) / field.flow_w_per_k
        leaves += field.flow_w_per_k * rise
    return enters, leaves
