"""A field in a few numbers: the same answers for the springs from some tens of states (rational Krylov, moment matching).

Exact at the rates that it was made for, whatever the drive; checked at one between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from .field import Field

RATES_PER_S = (0.0, 0.004, 0.05)
"""Where the reduced field is exact: from standing still to 20 s."""
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
    """Solves (G + rate C) x = b, several b, for any rate: one factorisation each."""

    def __init__(self, field: Field) -> None:
        self.order = _order(field)
        self.conductance, self.capacity = (
            one[self.order][:, self.order] for one in (field.conductance, field.capacity)
        )

    def solve(self, rate_per_s: float, right: np.ndarray) -> np.ndarray:
        """Return x, (unknowns, columns)."""
        matrix = sparse.csc_matrix(self.conductance + rate_per_s * self.capacity)
        lu = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        out = np.empty_like(right)
        out[self.order] = lu.solve(right[self.order])
        return out


def _order(field: Field) -> np.ndarray:
    """Return the order in which to eliminate: places of the plan by minimum degree, all their heights together.

    A tall field is a small plan with a full block at each place; ordered as a whole it takes minutes instead of seconds.
    """
    levels = field.levels
    pattern = field.conductance.tocoo()
    size = field.unknowns // levels
    plan = sparse.csc_matrix((np.ones(pattern.nnz), (pattern.row // levels, pattern.col // levels)), shape=(size, size))
    plan = sparse.csc_matrix(plan + sparse.diags(np.asarray(plan.sum(axis=1)).ravel()))  # never singular
    lu = splu(plan, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return (np.argsort(lu.perm_c)[:, None] * levels + np.arange(levels)).ravel()


def reduce_field(field: Field) -> Modes:
    """Return a field's few states."""
    blown = bool(field.flow_w_per_k)
    inputs = np.hstack([field.spring, field.taken]) if blown else field.spring
    pieces = []
    solver = Solver(field)
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
    if not field.flow_w_per_k:
        return enters, leaves
    for lane, flow_w_per_k in zip(field.lanes, field.flow_w_per_k, strict=True):
        rise = np.zeros(states)
        for j in lane:
            enters[j] = rise
            rise = rise + (taken[:, j] - field.taken[:, j].sum() * rise) / flow_w_per_k
        leaves += flow_w_per_k * rise
    return enters, leaves
