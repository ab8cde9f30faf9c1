"""What is left after a fit: what it depends on, and how much of it an empirical model would explain."""

from __future__ import annotations

import math

import numpy as np

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import statistics
from .evidence import excess

WHITE = 0.2
"""Structure, rms in units of the noise, below which a residual is called white."""


def depends_on(problem: Problem, fit: Fit) -> tuple[list[str], str]:
    """Return what the residual depends on, strongest first, and a sentence; nothing where it is white."""
    structure = excess(problem, fit)
    width = 10
    blocks, owners, times, runs_of = [], [], [], []
    residual = problem.without_errors(fit.residual)
    for r, (run, left, noise) in enumerate(zip(problem.runs, residual, problem.noise, strict=True)):
        mean, _, begins = statistics.block_means(left / noise, width, run.starts)
        blocks.append(mean)
        times.append(run.time_s[begins])
        owners.append(begins)
        runs_of.append(r)
    if structure < WHITE**2:
        return [], ""
    out: list[tuple[float, str]] = []
    squares = np.array([statistics.mean_there(b**2, 0) for b in blocks])
    per_spring = statistics.mean_there(squares, 0) - 1.0 / width
    share = np.maximum(per_spring, 0) / max(1e-12, float(np.nansum(np.maximum(per_spring, 0))))
    spread = 1.0 / len(share)
    for k in np.argsort(-share)[:2]:
        if share[k] > max(2.0 * spread, 0.3) and len(share) > 1:
            out.append((float(share[k]), f"spring {k + 1} ({100 * share[k]:.0f} % of the structure)"))
    series: dict[str, list[np.ndarray]] = {}
    for r, run in enumerate(problem.runs):
        drive = np.add.reduceat(run.drive, owners[r], axis=0) / width
        fan = np.add.reduceat(run.fan, owners[r]) / width
        for j in range(run.springs):
            series.setdefault(f"drive of spring {j + 1}", []).append(drive[:, j])
        series.setdefault("total drive", []).append(drive.sum(axis=1))
        series.setdefault("fan", []).append(fan)
        series.setdefault("time", []).append(times[r] - times[r].mean())
    largest = max(1e-12, float(np.nanmax(statistics.mean_there(squares, 0))))
    for name, parts in series.items():
        best = (0.0, 0.0, 0, -1)
        if all(np.ptp(p) < 1e-12 for p in parts):
            continue
        for lag in (0, 1, 2, 3, 6, 12) if name != "time" else (0,):
            for k in range(problem.runs[0].springs):
                x, y = [], []
                for p, b in zip(parts, blocks, strict=True):
                    x.append(p[: len(p) - lag] - p.mean())
                    y.append(b[lag:, k])
                xs, ys = np.concatenate(x), np.concatenate(y)
                good = np.isfinite(ys)
                if good.sum() < 10 or np.std(xs[good]) < 1e-12 or np.std(ys[good]) < 1e-12:
                    continue
                rho = float(np.corrcoef(xs[good], ys[good])[0, 1])
                # a spring that shows little counts for little, however well it correlates
                weight = abs(rho) * min(1.0, math.sqrt(float(np.nanmean(ys**2)) / largest))
                if weight > best[0]:
                    best = (weight, rho, lag, k)
        if best[0] > 0.3:
            step = float(np.median(np.diff(problem.runs[0].time_s))) * width
            lag_text = f", {best[2] * step:.0f} s later" if best[2] else ""
            out.append((best[0], f"{name} (seen at spring {best[3] + 1}{lag_text}, r = {best[1]:+.2f})"))
    together = [statistics.mean_there(b, 1) for b in blocks]
    common = np.mean([np.nanmean(t**2) for t in together]) / max(1e-12, np.mean([np.nanmean(b**2) for b in blocks]))
    if common > 0.4 and problem.runs[0].springs > 2:
        out.append((float(common), f"all springs move together ({100 * common:.0f} % of it is common)"))
    worst = max(
        (
            (float(np.nanmean(b[i] ** 2)), r, float(times[r][i]))
            for r, b in enumerate(blocks)
            for i in range(len(b))
            if np.isfinite(b[i]).any()
        ),
        default=(0.0, 0, 0.0),
    )
    for r, (run, left, noise) in enumerate(zip(problem.runs, residual, problem.noise, strict=True)):
        first = run.time_s <= run.time_s[0] + 0.1 * run.duration_s
        size = np.nan_to_num(left / noise) ** 2
        begins_badly = float(size[first].sum()) / max(1e-12, float(size.sum()))
        if begins_badly > 0.25:
            out.append(
                (
                    begins_badly,
                    f"the start of run {r + 1} ({100 * begins_badly:.0f} % of what is left is in its first "
                    f"{0.1 * run.duration_s:.0f} s: its state or its first inputs are not as logged)",
                )
            )
    typical = np.mean([np.nanmean(b**2) for b in blocks])
    if worst[0] > 8 * typical:
        out.append((0.3, f"time: most at {worst[2]:.0f} s of run {worst[1] + 1}"))
    out.sort(key=lambda one: -one[0])
    names = [text for _, text in out[:6]]
    return names, ("It depends on " + "; ".join(names) + "." if names else "No single input goes with it.")
