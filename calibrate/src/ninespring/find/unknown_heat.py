"""Heat of unknown origin: what the best model still lacks, as watts for each spring over time, and as events.

What a fit leaves is explained by the fewest pieces that explain it: heat at one spring from one time to another, the same
share of heat at all springs, or a sensor that jumps (which heat cannot make: heat needs time). Each piece's answer is
simulated by the fitted model itself; what the model's own numbers could have taken up is projected out; a piece stays
where it beats its price. Its size is a least-squares estimate with an error, and the watts over time are the sum of pieces.
A sensor is told only where it is seen to jump, from one reading to the next: a transformation that is a little off comes and goes in seconds,
and the piece that explains it best is a sensor's, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from ..infer.fit import Fit
from ..infer.heat import THIN, power_of, step_answers, thin
from ..infer.problem import Problem
from ..io import results
from .causes import Cause, Stepwise, only
from .evidence import fit_factor, price
from .pursuit import Choice, Pursuit, steps_up

SHORTEST_S = 45.0
"""A piece is at least this long: shorter ones are no heat that a spring would show."""
MOST = 12
"""Pieces of one run; where more would help, the rest is not made of events."""
SMALLEST = 0.05
"""Of a spring's usual power: less heat than this is not told, whatever its evidence."""
EACH_SIDE = 2
"""Readings on each side by which a jump is seen: one may be the mean of before and after."""
JUMP_NATS = 3.0
"""Evidence, after the price of choosing its row, from which a step is a jump and no noise: one in twenty."""
EDGES = 80
"""Edges of one run, at most: a longer run has a coarser grid."""


@dataclass
class UnknownHeat:
    """What a fit leaves, as heat: watts over time and the events that they are made of."""

    times_s: list[np.ndarray]
    """Per run, times of the rows of `watts`."""
    watts: list[np.ndarray]
    """Per run (times, springs)."""
    events: list[results.Event]
    usual_w: np.ndarray
    """Per spring: mean power while it is driven, W."""

    def told(self) -> results.UnknownHeat:
        """Return what diagnosis.json says of it."""
        return results.UnknownHeat(
            events=self.events,
            mean_w=[[float(v) for v in run.mean(axis=0)] for run in self.watts],
            usual_w=[float(v) if math.isfinite(v) else None for v in self.usual_w],
        )


def event(
    r: int,
    kind: results.Unknown,
    k: int,
    span_s: tuple[float, float],
    size: float,
    error: float,
    nats: float,
    usual_w: np.ndarray,
) -> results.Event:
    """Return one piece: heat (W, at spring k from 0), common (at all springs alike, k = -1) or sensor (a reading that jumps, K)."""
    usual = float(usual_w[k]) if k >= 0 else float(np.nanmean(usual_w))
    share = size / usual if kind != "sensor" and usual > 0 else None
    when = f"{span_s[0]:.0f} to {span_s[1]:.0f} s of run {r + 1}"
    where = "each spring" if kind == "common" else f"spring {k + 1}"
    part = f" ({100 * abs(share):.0f} % of what it is usually given)" if share else ""
    text = f"{where}: {abs(size):.2g} W {'more' if size > 0 else 'less'} than known{part}, {when}"
    if kind == "sensor":
        text = f"thermometer {k + 1} reads {abs(size):.1f} K {'more' if size > 0 else 'less'}, {when}"
    return results.Event(
        run=r + 1,
        kind=kind,
        spring=k + 1 if k >= 0 else None,
        from_s=span_s[0],
        to_s=span_s[1],
        size=size,
        stderr=error,
        unit="K" if kind == "sensor" else "W",
        share=share,
        evidence=nats,
        text=text,
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
    for r, (run, slopes) in enumerate(zip(problem.runs, problem.by_run(jacobian), strict=True)):
        say(f"unknown heat in run {r + 1}")
        events = _events_of(problem, fit, r, slopes, factor, typical, usual_w)
        watts = np.zeros((len(run.time_s), run.springs))
        since = run.time_s - run.time_s[0]
        for one in events:
            here = (since >= one.from_s) & (since < one.to_s)
            if one.kind != "sensor":
                watts[here, slice(None) if one.spring is None else one.spring - 1] += one.size
        found.times_s.append(run.time_s)
        found.watts.append(watts)
        found.events += events
    return found


def _events_of(
    problem: Problem, fit: Fit, r: int, slopes: np.ndarray, factor: float, typical_w: float, usual_w: np.ndarray
) -> list[results.Event]:
    """Return the pieces of one run: chosen one by one, the best first, all sizes fitted again with each."""
    run, mask, noise = problem.runs[r], problem.mask[r], problem.noise[r]
    if (into := Stepwise.of(problem, r, EDGES)) is None:
        return []
    rows, springs = run.temperature_c.shape
    edges = into.edges
    grid = int(edges[1])
    step = float(np.median(np.diff(run.time_s)))
    answers = step_answers(problem, fit, r, edges, typical_w)

    def piece(kind: results.Unknown, k: int, block: np.ndarray) -> Cause:
        """Return what a unit step at a spring, -1: at all, adds to the readings (edges, rows, springs) from each edge on."""
        profile = np.ones(block.shape[1:]) if k < 0 else only(k, np.ones(rows), springs)
        return Cause(kind, "", (profile,), into.thinned(block), into.ends)

    pieces = [piece("heat", k, answers.pop(("heat", k))) for k in range(springs)]
    pieces += [piece("sensor", k, steps_up(edges, rows, springs, k)) for k in range(springs)]
    if springs > 1:
        pieces.append(piece("common", -1, answers.pop(("common", -1))))
    used = slopes[:, np.linalg.norm(slopes, axis=0) > 1e-6] if slopes.size else slopes
    spread_out = np.zeros((*mask.shape, used.shape[1]))
    spread_out[mask] = used
    basis = np.linalg.qr(thin(spread_out))[0] if used.shape[1] else np.zeros((-(-rows // THIN) * springs, 0))
    left = into.thinned(problem.without_errors(fit.residual)[r][None])[:, 0].astype(float)
    left = left - basis @ (basis.T @ left)
    shortest = max(1, round(SHORTEST_S / (grid * step)))
    among = Pursuit(pieces, basis, shortest, least_left=0.0)
    chosen: list[Choice] = []
    columns: list[np.ndarray] = []
    tried = len(pieces) * len(edges) ** 2 / 2
    rest, sizes, gains = left, np.zeros(0), []
    while len(chosen) < MOST:
        if (best := among.best(rest)) is None:
            break
        # what it gains, in nats, correlated samples counted for what they are, less the price of its choice
        nats = 0.5 * best.drop / factor - math.log(tried)
        if nats < price(1, len(left) / factor):
            break
        chosen.append(best)
        columns.append(best.vector - basis @ (basis.T @ best.vector))
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
    since = [float(run.time_s[row] - run.time_s[0]) for row in (*edges, -1)]
    shown = problem.without_errors(fit.residual)[r]
    told = [(cast(results.Unknown, one.cause.kind), one.cause.place, *one.edges) for one in chosen]
    sensors = [(k, a, b, float(size)) for (kind, k, a, b), size in zip(told, sizes, strict=True) if kind == "sensor"]
    for (kind, k, a, b), size, error, nats in zip(told, sizes, errors, gains, strict=True):
        span_s = (since[a], since[b])
        small = abs(size) < (SMALLEST * typical_w if kind != "sensor" else 3.0 * float(noise[k]))
        if small or abs(size) < 3.0 * error:
            continue
        if kind == "sensor":
            ends = [(e, _expected(sensors, k, e, len(edges))) for e in (a, b) if 0 < e < len(edges)]
            # what is off from the first row to the last has jumped nowhere
            if not ends or not all(_jumps(shown[:, k], e * grid, grid, step_k, size, noise[k]) for e, step_k in ends):
                continue
        out.append(event(r, kind, k, span_s, float(size), float(error), float(nats), usual_w))
    return out


def _expected(sensors: list[tuple[int, int, int, float]], k: int, edge: int, last: int) -> float:
    """Return by how much all pieces (spring, from edge, to edge, K) let thermometer k step about an edge, K."""
    up = sum(size for one, a, _, size in sensors if one == k and abs(a - edge) <= 1)
    return up - sum(size for one, _, b, size in sensors if one == k and b < last and abs(b - edge) <= 1)


def _jumps(left: np.ndarray, row: int, near: int, step_k: float, size_k: float, noise_k: float) -> bool:
    """Return whether what is left of a thermometer (rows,) steps by about `step_k` from one reading to the next, within so many rows
    of an edge, and stays there: to half of the piece's size.

    What a spring does has a slope on both sides of it: a step is what the readings there do not foretell, as far as they can. Where
    pieces about the edge undo each other there is nothing to see.
    """
    if abs(step_k) < 0.5 * abs(size_k):
        return True
    read = np.flatnonzero(np.isfinite(left))
    left, at, up = left[read], int(np.searchsorted(read, row)), math.copysign(1.0, step_k)
    w = EACH_SIDE
    rows = np.arange(max(2 * w, at - near), min(len(left) - 2 * w, at + near) + 1)
    if not rows.size:
        return False
    level = up * np.convolve(left, np.full(w, 1.0 / w), "valid")  # level[j]: of left[j : j + w]
    steps = level[rows] - level[rows - w]
    m, seen_k = int(rows[np.argmax(steps)]), float(steps.max())
    # so many times its own noise a step is by chance at one of these rows, one time in twenty
    sure = math.sqrt(2.0 * (JUMP_NATS + math.log(rows.size))) * noise_k
    if seen_k < sure * math.sqrt(2.0 / w):
        return False
    slope_k = 0.5 * (level[m - w] - level[m - 2 * w] + level[m + w] - level[m])
    stays_k = up * float(np.median(left[m : m + near + 1]) - np.median(left[max(0, m - near) : m]))
    about = max(0.5 * abs(size_k), sure * math.sqrt(2.0 / w))
    alike = abs(seen_k - abs(step_k)) <= about and abs(stays_k - abs(step_k)) <= about
    return bool(alike and slope_k <= 0.5 * seen_k + sure * math.sqrt(1.0 / w))
