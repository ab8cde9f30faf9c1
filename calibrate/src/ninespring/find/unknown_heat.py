"""Heat of unknown origin: what the best model still lacks, as watts for each spring over time, and as events.

What a fit leaves is explained by the fewest pieces that explain it: heat at one spring from one time to another, the same
share of heat at all springs, or a sensor that jumps (which heat cannot make: heat needs time). Each piece's answer is
simulated by the fitted model itself; what the model's own numbers could have taken up is projected out; a piece stays
where it beats its price. Its size is a least-squares estimate with an error, and the watts over time are the sum of pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..infer.fit import Fit
from ..infer.heat import THIN, power_of, step_answers, thin
from ..infer.problem import Problem
from ..io import results
from . import windows
from .evidence import fit_factor

GRID_S = 15.0
"""Times at which a piece may begin or end: half of what an event's place in time is told to."""
SHORTEST_S = 45.0
"""A piece is at least this long: shorter ones are no heat that a spring would show."""
MOST = 12
"""Pieces of one run; where more would help, the rest is not made of events."""
SMALLEST = 0.05
"""Of a spring's usual power: less heat than this is not told, whatever its evidence."""
EDGES = 80
"""Edges of one run, at most: a longer run has a coarser grid."""


@dataclass(frozen=True)
class Piece:
    """One piece of unknown heat, or a sensor's jump, in one run."""

    run: int
    kind: str
    """heat (at one spring), common (all springs alike) or sensor (a reading that jumps)."""
    spring: int
    """0-based; -1 for common."""
    begin_s: float
    end_s: float
    size: float
    """W, or K for a sensor."""
    error: float
    nats: float

    def told(self, share: float | None) -> results.Event:
        """Return what diagnosis.json says of it; `share` is its size in parts of the spring's usual power."""
        return results.Event(
            run=self.run + 1,
            kind=self.kind,
            spring=self.spring + 1 if self.spring >= 0 else None,
            from_s=self.begin_s,
            to_s=self.end_s,
            size=self.size,
            stderr=self.error,
            unit="K" if self.kind == "sensor" else "W",
            share=share,
            evidence=self.nats,
            text=self.words(share),
        )

    def words(self, share: float | None) -> str:
        """Return it as a sentence."""
        when = f"{self.begin_s:.0f} to {self.end_s:.0f} s of run {self.run + 1}"
        if self.kind == "sensor":
            return f"thermometer {self.spring + 1} reads {abs(self.size):.1f} K {'more' if self.size > 0 else 'less'}, {when}"
        where = "each spring" if self.kind == "common" else f"spring {self.spring + 1}"
        part = f" ({100 * abs(share):.0f} % of what it is usually given)" if share else ""
        return f"{where}: {abs(self.size):.2g} W {'more' if self.size > 0 else 'less'} than known{part}, {when}"


@dataclass
class UnknownHeat:
    """What a fit leaves, as heat: watts over time and the events that they are made of."""

    times_s: list[np.ndarray]
    """Per run, times of the rows of `watts`."""
    watts: list[np.ndarray]
    """Per run (times, springs)."""
    pieces: list[Piece]
    usual_w: np.ndarray
    """Per spring: mean power while it is driven, W."""

    def share(self, piece: Piece) -> float | None:
        """Return a piece's size in parts of the usual power of its spring, None where there is none."""
        usual = float(self.usual_w[piece.spring]) if piece.spring >= 0 else float(np.nanmean(self.usual_w))
        return piece.size / usual if piece.kind != "sensor" and usual > 0 else None

    def told(self) -> results.UnknownHeat:
        """Return what diagnosis.json says of it."""
        return results.UnknownHeat(
            events=[piece.told(self.share(piece)) for piece in self.pieces],
            mean_w=[[float(v) for v in run.mean(axis=0)] for run in self.watts],
            usual_w=[float(v) if math.isfinite(v) else None for v in self.usual_w],
        )


def find(problem: Problem, fit: Fit, say: Callable[[str], None] = lambda text: None) -> UnknownHeat:
    """Find the pieces of unknown heat in what a fit leaves."""
    power = np.concatenate([power_of(problem, fit, r) for r in range(len(problem.runs))])
    driven = (power > 0).sum(axis=0)
    usual_w = np.where(driven > 0, power.sum(axis=0) / np.maximum(driven, 1), np.nan)
    typical = float(np.nanmean(usual_w)) if np.isfinite(usual_w).any() else 1.0
    factor = fit_factor(problem, fit)
    found = UnknownHeat([], [], [], usual_w)
    jacobian = fit.jacobian if fit.jacobian is not None else np.zeros((problem.count, 0))
    begin = 0
    for r, run in enumerate(problem.runs):
        say(f"unknown heat in run {r + 1}")
        mask = problem.mask[r]
        count = int(mask.sum())
        slopes = jacobian[begin : begin + count]
        begin += count
        pieces = _pieces_of(problem, fit, r, slopes, factor, typical)
        watts = np.zeros((len(run.time_s), run.springs))
        since = run.time_s - run.time_s[0]
        for piece in pieces:
            here = (since >= piece.begin_s) & (since < piece.end_s)
            if piece.kind == "heat":
                watts[here, piece.spring] += piece.size
            elif piece.kind == "common":
                watts[here] += piece.size
        found.times_s.append(run.time_s)
        found.watts.append(watts)
        found.pieces += pieces
    return found


def _pieces_of(problem: Problem, fit: Fit, r: int, slopes: np.ndarray, factor: float, typical_w: float) -> list[Piece]:
    """Return the pieces of one run: chosen one by one, the best first, all sizes fitted again with each."""
    run, mask, noise = problem.runs[r], problem.mask[r], problem.noise[r]
    springs, rows = run.springs, len(run.time_s)
    step = float(np.median(np.diff(run.time_s)))
    grid = max(1, round(GRID_S / step), -(-rows // EDGES))
    edges = np.arange(0, rows, grid)
    if len(edges) < 4:
        return []
    answers = step_answers(problem, fit, r, edges, typical_w)
    kinds = [("heat", k) for k in range(springs)] + [("sensor", k) for k in range(springs)]
    if springs > 1:
        kinds.append(("common", -1))

    def thinned(fields: np.ndarray) -> np.ndarray:
        """Return fields (edges, rows, springs) as columns (samples, edges), in units of the noise."""
        return thin(np.moveaxis(np.where(mask, fields / noise, 0.0), 0, 2))

    def columns_of(kind: str, k: int) -> np.ndarray:
        """Return what a unit step that begins at each edge adds to the readings, (samples, edges)."""
        if kind != "sensor":
            return thinned(answers.pop((kind, k)))
        return thinned(windows.steps_up(edges, rows, springs, k))

    used = slopes[:, np.linalg.norm(slopes, axis=0) > 1e-6] if slopes.size else slopes
    spread_out = np.zeros((*mask.shape, used.shape[1]))
    spread_out[mask] = used
    basis = np.linalg.qr(thin(spread_out))[0] if used.shape[1] else np.zeros((-(-rows // THIN) * springs, 0))
    left = thinned(problem.without_errors(fit.residual)[r][None])[:, 0].astype(float)
    left = left - basis @ (basis.T @ left)
    steps = {one: columns_of(*one) for one in kinds}
    grams = {one: windows.products(block, basis) for one, block in steps.items()}
    chosen: list[tuple[str, int, int, int]] = []
    columns: list[np.ndarray] = []
    shortest = max(1, round(SHORTEST_S / (grid * step)))
    tried = len(kinds) * len(edges) ** 2 / 2
    rest, sizes, gains = left, np.zeros(0), []
    while len(chosen) < MOST:
        found = ((windows.best(steps[one].T @ rest, grams[one], shortest), one) for one in kinds)
        (gain, a, b), (kind, k) = max(found, key=lambda one: one[0][0])
        # what it gains, in nats, correlated samples counted for what they are, less the price of its choice
        nats = 0.5 * gain / factor - math.log(tried)
        if nats < 0.5 * math.log(max(2.0, len(left) / factor)):
            break
        vector = steps[kind, k][:, a] - (steps[kind, k][:, b] if b < len(edges) else 0.0)
        vector = vector - basis @ (basis.T @ vector)
        chosen.append((kind, k, a, b))
        columns.append(vector)
        gains.append(nats)
        matrix = np.column_stack(columns)
        sizes = np.linalg.lstsq(matrix, left, rcond=None)[0]
        rest = left - matrix @ sizes
    if not chosen:
        return []
    matrix = np.column_stack(columns)
    spread = max(1.0, float(rest @ rest) / max(1, len(rest)) * factor)
    errors = np.sqrt(np.diag(np.linalg.pinv(matrix.T @ matrix)) * spread)
    out = []
    end = float(run.time_s[-1] - run.time_s[0])
    for (kind, k, a, b), size, error, nats in zip(chosen, sizes, errors, gains, strict=True):
        begin_s = float(run.time_s[edges[a]] - run.time_s[0])
        end_s = float(run.time_s[edges[b]] - run.time_s[0]) if b < len(edges) else end
        small = abs(size) < (SMALLEST * typical_w if kind != "sensor" else 3.0 * float(noise[k]))
        if small or abs(size) < 3.0 * error:
            continue
        out.append(Piece(r, kind, k, begin_s, end_s, float(size), float(error), float(nats)))
    return out
