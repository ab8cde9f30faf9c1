"""What is left after a fit: what it depends on, and how much of it an empirical model would explain."""

from __future__ import annotations

import numpy as np

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import statistics
from .evidence import excess

WHITE = 0.2
"""Structure, rms in units of the noise, below which a residual is called white."""


WIDTH = 10
"""Rows of a block in which it is looked for."""
LAGS = (0, 1, 2, 3, 6, 12)
"""Blocks by which what is left may come after its input."""
TOLD = 0.3
"""Correlation, or share, from which it is told."""


def depends_on(problem: Problem, fit: Fit) -> tuple[list[str], str]:
    """Return what the residual depends on, strongest first, and a sentence; nothing where it is white."""
    if excess(problem, fit) < WHITE**2:
        return [], ""
    runs, scaled = problem.runs, []
    for left, noise in zip(problem.without_errors(fit.residual), problem.noise, strict=True):
        scaled.append(left / noise)
    parts = [statistics.block_means(one, WIDTH, run.starts) for one, run in zip(scaled, runs, strict=True)]
    blocks, begins = [mean for mean, _, _ in parts], [first for _, _, first in parts]
    squares = statistics.mean_there(np.array([statistics.mean_there(b**2, 0) for b in blocks]), 0)
    typical = max(1e-12, float(np.mean([np.nanmean(b**2) for b in blocks])))
    out = _springs(squares) + _inputs(problem, blocks, begins, squares)
    together = float(np.mean([np.nanmean(statistics.mean_there(b, 1) ** 2) for b in blocks])) / typical
    if together > 0.4 and problem.array.springs > 2:
        out.append((together, f"all springs move together ({100 * together:.0f} % of it is common)"))
    for r, (run, one) in enumerate(zip(runs, scaled, strict=True)):
        tenth, size = 0.1 * run.duration_s, np.nan_to_num(one) ** 2
        first = float(size[run.time_s <= run.time_s[0] + tenth].sum()) / max(1e-12, float(size.sum()))
        if first > 0.25:
            text = (
                f"the start of run {r + 1} ({100 * first:.0f} % of what is left is in its first {tenth:.0f} s: "
                "its state or its first inputs are not as logged)"
            )
            out.append((first, text))
    most = [np.nan_to_num(statistics.mean_there(b**2, 1)) for b in blocks]
    r = int(np.argmax([one.max() for one in most]))
    if most[r].max() > 8 * typical:
        at_s = runs[r].time_s[begins[r]][int(most[r].argmax())]
        out.append((TOLD, f"time: most at {at_s:.0f} s of run {r + 1}"))
    names = [text for _, text in sorted(out, key=lambda one: -one[0])[:6]]
    return names, ("It depends on " + "; ".join(names) + "." if names else "No single input goes with it.")


def _springs(squares: np.ndarray) -> list[tuple[float, str]]:
    """Return the springs that have most of the structure, by mean squares of their blocks (springs,)."""
    beyond = np.nan_to_num(np.maximum(squares - 1.0 / WIDTH, 0.0))
    share = beyond / max(1e-12, float(beyond.sum()))
    most = [k for k in np.argsort(-share)[:2] if share[k] > max(2.0 / len(share), TOLD) and len(share) > 1]
    return [(float(share[k]), f"spring {k + 1} ({100 * share[k]:.0f} % of the structure)") for k in most]


def _inputs(
    problem: Problem, blocks: list[np.ndarray], begins: list[np.ndarray], squares: np.ndarray
) -> list[tuple[float, str]]:
    """Return the inputs with which blocks (b, springs) of what is left go, each with its spring and lag."""
    series: dict[str, list[np.ndarray]] = {}
    for run, rows in zip(problem.runs, begins, strict=True):
        drive = np.add.reduceat(run.drive, rows, axis=0) / WIDTH
        given = {f"drive of spring {j + 1}": one for j, one in enumerate(drive.T)}
        given |= {"total drive": drive.sum(axis=1), "fan": np.add.reduceat(run.fan, rows) / WIDTH}
        for name, values in (given | {"time": run.time_s[rows]}).items():
            series.setdefault(name, []).append(values - values.mean())
    # a spring that shows little counts for little, however well it correlates
    weight = np.minimum(1.0, np.sqrt(squares / max(1e-12, float(np.nanmax(squares)))))
    step = float(np.median(np.diff(problem.runs[0].time_s))) * WIDTH
    out = []
    for name, found in series.items():
        best = (0.0, 0.0, 0, -1)
        for lag in LAGS if name != "time" else (0,):
            x = np.concatenate([one[: max(0, len(one) - lag)] for one in found])
            for k, y in enumerate(np.concatenate([b[lag:] for b in blocks]).T):
                good = np.isfinite(y)
                if good.sum() < 10 or np.std(x[good]) < 1e-12 or np.std(y[good]) < 1e-12:
                    continue
                rho = float(np.corrcoef(x[good], y[good])[0, 1])
                best = max(best, (abs(rho) * float(weight[k]), rho, lag, k))
        if best[0] > TOLD:
            later = f", {best[2] * step:.0f} s later" if best[2] else ""
            out.append((best[0], f"{name} (seen at spring {best[3] + 1}{later}, r = {best[1]:+.2f})"))
    return out
