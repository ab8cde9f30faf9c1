"""report.html: everything a diagnosis found, in one file that needs nothing else."""

from __future__ import annotations

import html
import io
import math
from typing import Any

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from . import effects, search, statistics
from .diagnosis import Diagnosis

INK, MEASURED, BEFORE, AFTER = "#1d2733", "#9aa7b4", "#c8553d", "#1f77a4"
STYLE = """
:root{color-scheme:light}body{font:16px/1.5 system-ui,-apple-system,"Segoe UI",sans-serif;color:#1d2733;
background:#f6f7f9;margin:0}main{max-width:1120px;margin:0 auto;padding:24px 20px 60px}
h1{font-size:28px;margin:8px 0 4px}h2{font-size:20px;margin:36px 0 8px;border-bottom:1px solid #d9dfe5;padding-bottom:4px}
.lead{font-size:18px;margin:6px 0 18px}.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(170px,1fr));gap:12px}
.card{background:#fff;border:1px solid #e1e6eb;border-radius:10px;padding:12px 14px}.card b{display:block;font-size:24px}
.card span{color:#5a6875;font-size:13px}figure{background:#fff;border:1px solid #e1e6eb;border-radius:10px;padding:10px;
margin:12px 0}figure svg{width:100%;height:auto;display:block}figcaption{color:#5a6875;font-size:14px;padding:4px 6px}
table{border-collapse:collapse;width:100%;background:#fff;border:1px solid #e1e6eb;border-radius:10px;font-size:14px}
th,td{padding:6px 10px;border-bottom:1px solid #eef1f4;text-align:left;vertical-align:top}th{background:#f0f3f6}
td.n{text-align:right;font-variant-numeric:tabular-nums}.warn{background:#fff6e5;border:1px solid #f0d9a8;
border-radius:10px;padding:10px 14px}.bad{background:#fdeeea;border-color:#e9b9ac}small{color:#5a6875}
"""


def _svg(figure: Any) -> str:
    out = io.StringIO()
    figure.savefig(out, format="svg", bbox_inches="tight")
    plt.close(figure)
    text = out.getvalue()
    return text[text.index("<svg") :]


def _thin(n: int, most: int = 500) -> slice:
    return slice(None, None, max(1, n // most))


def _traces(found: Diagnosis) -> list[str]:
    problem = found.problem
    cols, rows = problem.array.cols, problem.array.rows
    figures = []
    for r, run in enumerate(problem.runs):
        pick = _thin(len(run.time_s))
        figure, axes = plt.subplots(
            rows, cols, figsize=(3.7 * max(cols, 2), 2.3 * rows + 0.6), sharex=True, sharey=True, squeeze=False
        )
        for k in range(run.springs):
            axis = axes[k // cols][k % cols]
            measured = run.temperature_c[:, k]
            axis.plot(run.time_s[pick], measured[pick], color=MEASURED, lw=2.4, label="measured")
            for fit, colour, label in ((found.baseline, BEFORE, "model before"), (found.final, AFTER, "model after")):
                axis.plot(run.time_s[pick], (measured - fit.residual[r][:, k])[pick], color=colour, lw=0.9, label=label)
            axis.set_title(f"spring {k + 1}", fontsize=9, loc="left", color=INK)
            axis.grid(alpha=0.25)
            axis.tick_params(labelsize=8)
        axes[0][0].legend(fontsize=7, frameon=False)
        figure.supxlabel("time, s", fontsize=9)
        figure.supylabel("degC", fontsize=9)
        figure.tight_layout()
        figures.append(_svg(figure))
    return figures


def _maps(found: Diagnosis) -> str:
    problem = found.problem
    shape = (problem.array.rows, problem.array.cols)
    figure, axes = plt.subplots(1, 4, figsize=(12, 3.0))
    worst = 0.0
    pictures = []
    for fit, label in ((found.baseline, "before"), (found.final, "after")):
        left = np.concatenate(fit.residual)
        pictures.append((np.sqrt(np.nanmean(left**2, axis=0)), f"rms error {label}, K", "YlOrRd", False))
        pictures.append((np.nanmean(left, axis=0), f"mean error {label}, K", "RdBu_r", True))
        worst = max(worst, float(np.nanmax(np.abs(pictures[-1][0]))))
    top = float(np.nanmax(pictures[0][0]))
    for axis, (values, title, colours, signed) in zip(axes, pictures, strict=True):
        low, high = (-worst, worst) if signed else (0.0, top)
        axis.imshow(values.reshape(shape), cmap=colours, vmin=low, vmax=high if high > low else low + 1)
        for k, value in enumerate(values):
            share = abs(value) / max(high, 1e-9)
            axis.text(
                k % shape[1],
                k // shape[1],
                f"{value:+.2f}" if signed else f"{value:.2f}",
                ha="center",
                va="center",
                fontsize=9,
                color="white" if share > 0.75 else INK,
            )
        axis.set_title(title, fontsize=9)
        axis.set_xticks([])
        axis.set_yticks([])
    figure.tight_layout()
    return _svg(figure)


def _autocorrelation(found: Diagnosis) -> str:
    problem = found.problem
    lags = min(120, problem.longest_lag())
    step = float(np.median(np.diff(problem.runs[0].time_s)))
    figure, axes = plt.subplots(1, 2, figsize=(12, 3.0))
    for fit, colour, label in ((found.baseline, BEFORE, "before"), (found.final, AFTER, "after")):
        rho = statistics.autocorrelation(
            [left / noise for left, noise in zip(fit.residual, problem.noise, strict=True)], lags
        )
        axes[0].plot(np.arange(1, lags + 1) * step, rho[1:], color=colour, label=label)
        values = np.concatenate(
            [(left / noise)[np.isfinite(left)] for left, noise in zip(fit.residual, problem.noise, strict=True)]
        )
        axes[1].hist(values, bins=80, range=(-6, 6), density=True, histtype="step", color=colour, label=label)
    bound = 2 / math.sqrt(problem.count)
    axes[0].axhspan(-bound, bound, color="#dfe5ea")
    axes[0].set_xlabel("lag, s", fontsize=9)
    axes[0].set_title("autocorrelation of the residual (grey: white noise)", fontsize=9)
    x = np.linspace(-6, 6, 200)
    axes[1].plot(x, np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi), color=MEASURED, label="sensor noise alone")
    axes[1].set_xlabel("residual / noise", fontsize=9)
    axes[1].set_title("distribution of the residual", fontsize=9)
    for axis in axes:
        axis.legend(fontsize=8, frameon=False)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    figure.tight_layout()
    return _svg(figure)


def _evidence(found: Diagnosis) -> str:
    rows = [c for c in found.result["candidates"] if len(c["effects"])][:14]
    if not rows:
        return ""
    figure, axis = plt.subplots(figsize=(12, 0.34 * len(rows) + 0.9))
    y = np.arange(len(rows))[::-1]
    colours = [AFTER if c["adopted"] else MEASURED for c in rows]
    axis.barh(y, [c["rmse_c"] for c in rows], color=colours, height=0.7)
    axis.axvline(found.result["baseline"]["noise_c"], color=INK, lw=1, ls="--")
    axis.axvline(found.result["baseline"]["rmse_c"], color=BEFORE, lw=1)
    axis.set_yticks(y, [" + ".join(c["effects"]) for c in rows], fontsize=8)
    for at, c in zip(y, rows, strict=True):
        axis.text(
            c["rmse_c"], at, f"  {c['rmse_c']:.3f} K, {c['evidence_over_baseline']:.0f} nats", va="center", fontsize=8
        )
    axis.set_xlim(0, max(c["rmse_c"] for c in rows) * 1.3)
    axis.set_xlabel("rms error, K (dashed: noise, red: before)", fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return _svg(figure)


def _e(text: object) -> str:
    return html.escape(str(text))


def _table(header: list[str], rows: list[list[object]], numeric: set[int]) -> str:
    head = "".join(f"<th>{_e(h)}</th>" for h in header)
    body = "".join(
        "<tr>"
        + "".join(f'<td class="n">{_e(c)}</td>' if k in numeric else f"<td>{_e(c)}</td>" for k, c in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _parameters(entries: dict[str, Any]) -> list[list[object]]:
    rows = []
    for name, one in entries.items():
        error = "not determined" if one["stderr"] is None else f"{one['stderr']:.2g}"
        rows.append([name, f"{one['value']:.5g}", error, one["unit"], one.get("note", "")])
    return rows


def verdict(result: dict[str, Any]) -> str:
    """Return the outcome in one sentence."""
    before, after = result["baseline"], result["after"]
    names = [e["name"] + (f" ({e['variant']})" if e.get("variant") else "") for e in result["effects"]]
    held = f"held-out error {before['holdout_rmse_c']:.2f} → {after['holdout_rmse_c']:.2f} K at a noise of {before['noise_c']:.2f} K"
    if names and not result["unexplained"]:
        return f"Missing: {' and '.join(names)}; {held}."
    if names:
        return f"Missing: {' and '.join(names)}, and something that no effect of the library explains; {held}."
    if result["unexplained"]:
        return f"Something is missing that no effect of the library explains; {held}."
    return f"Nothing is missing: the declared model explains the data to the noise; {held}."


def html_report(found: Diagnosis) -> str:
    """Return the report as HTML."""
    result = found.result
    before, after = result["baseline"], result["after"]
    parts = ["<h1>What the array does that the model did not</h1>", f'<p class="lead">{_e(verdict(result))}</p>']
    cards = [
        (f"{before['rmse_c']:.2f} K", "error before"),
        (f"{after['rmse_c']:.2f} K", "error after"),
        (f"{before['holdout_rmse_c']:.2f} K", "held-out before"),
        (f"{after['holdout_rmse_c']:.2f} K", "held-out after"),
        (f"{before['noise_c']:.2f} K", "noise of the sensors"),
        ("yes" if result["unexplained"] else "no", "unexplained structure left"),
    ]
    parts.append(
        '<div class="cards">'
        + "".join(f'<div class="card"><b>{_e(a)}</b><span>{_e(b)}</span></div>' for a, b in cards)
        + "</div>"
    )
    if result["warnings"]:
        parts.append('<h2>About the data</h2><div class="warn">' + "<br>".join(map(_e, result["warnings"])) + "</div>")
    if result["unexplained"]:
        parts.append(f'<h2>Unexplained</h2><div class="warn bad">{_e(result["residual"]["note"])}</div>')
    if result["effects"]:
        parts.append("<h2>Effects adopted</h2>")
        rows = [
            [
                e["name"] + (f" ({e['variant']})" if e.get("variant") else ""),
                e["in_words"],
                f"{e['rmse_c']:.3f}",
                f"{e['holdout_rmse_c']:.3f}",
                f"{e['evidence']:.0f}",
                "yes" if e["on_chip"] else "no: " + e["why_not_on_chip"],
            ]
            for e in result["effects"]
        ]
        parts.append(
            _table(
                ["effect", "what it is", "error with it, K", "held out, K", "evidence, nats", "goes into the chip"],
                rows,
                {2, 3, 4},
            )
        )
        rows = [row for e in result["effects"] for row in _parameters(e["parameters"])]
        parts.append("<h2>Their numbers</h2>" + _table(["number", "value", "standard error", "unit", ""], rows, {1, 2}))
    if result["rivals"]:
        parts.append("<h2>What these data cannot tell apart</h2>")
        rows = [
            [
                r["instead_of"],
                r["name"] + (f" ({r['variant']})" if r.get("variant") else ""),
                f"{r['rmse_c']:.3f}",
                f"{r['evidence']:.1f}",
                r["separating_experiment"],
            ]
            for r in result["rivals"]
        ]
        parts.append(
            _table(
                ["adopted", "could also be", "error, K", "adopted leads by, nats", "the experiment that would tell"],
                rows,
                {2, 3},
            )
        )
    parts.append("<h2>Measured against model</h2>")
    for r, svg in enumerate(_traces(found)):
        parts.append(
            f"<figure>{svg}<figcaption>Run {r + 1}: {_e(result['logs'][r]['file'])}. Grey: measured; red: the declared model; blue: with the effects adopted.</figcaption></figure>"
        )
    parts.append(
        f"<h2>Where the error sits</h2><figure>{_maps(found)}<figcaption>Each cell is a spring, row 1 on top.</figcaption></figure>"
    )
    parts.append(
        f"<h2>What is left</h2><figure>{_autocorrelation(found)}<figcaption>{_e(result['residual']['note'])}</figcaption></figure>"
    )
    if svg := _evidence(found):
        parts.append(
            f"<h2>What was tried</h2><figure>{svg}<figcaption>Models fitted on the way, best first; blue is the one adopted.</figcaption></figure>"
        )
    parts.append(
        "<h2>Errors</h2>"
        + _table(
            ["", "in sample, K", "held out, K"],
            [
                ["before", f"{before['rmse_c']:.3f}", f"{before['holdout_rmse_c']:.3f}"],
                ["after", f"{after['rmse_c']:.3f}", f"{after['holdout_rmse_c']:.3f}"],
                ["noise", f"{before['noise_c']:.3f}", ""],
            ],
            {1, 2},
        )
    )
    parts.append(
        "<h2>The declared model's numbers</h2>"
        + _table(["number", "value", "standard error", "unit", ""], _parameters(after["parameters"]), {1, 2})
    )
    identify = result["identifiability"]
    lines = [f"{n}: the data cannot fix it" for n in identify["not_identifiable"]]
    lines += [f"{n}: at its bound" for n in identify["at_bounds"]]
    lines += [
        f"{c['a']} and {c['b']}: errors correlated at {c['correlation']:+.3f}; only a combination is determined"
        for c in identify["correlated"]
    ]
    if lines:
        parts.append('<h2>Not determined by these data</h2><div class="warn">' + "<br>".join(map(_e, lines)) + "</div>")
    parts.append(
        f"<p><small>{_e(result['tool'])}; {result['simulations']} simulations in {result['seconds']} s. An effect is adopted only if it explains more than {search.MIN_GAIN:.2f} of the noise, by {search.MIN_EVIDENCE:.0f} nats. Effects known: {', '.join(effects.IN_WORDS)}.</small></p>"
    )
    title = "Ninespring diagnosis"
    return f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title><style>{STYLE}</style></head><body><main>{"".join(parts)}</main></body></html>\n'
