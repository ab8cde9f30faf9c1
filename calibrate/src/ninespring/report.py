"""report.html: everything a diagnosis found, in one file that needs nothing else."""

from __future__ import annotations

import html
import io
import math
import re
from typing import Any

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from . import effects, native, search, statistics, steady
from .diagnosis import Diagnosis
from .logs import Run

INK, MEASURED, BEFORE, AFTER = "#1d2733", "#9aa7b4", "#c8553d", "#1f77a4"
PAPER = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
plt.rcParams.update(
    {"svg.fonttype": "none", "font.family": "sans-serif", "text.color": INK, "axes.edgecolor": "#c3ccd4"}
)
STYLE = """
:root{color-scheme:light}body{font:16px/1.5 system-ui,-apple-system,"Segoe UI",sans-serif;color:#1d2733;
background:#f6f7f9;margin:0}main{max-width:1120px;margin:0 auto;padding:24px 20px 60px}
h1{font-size:28px;margin:8px 0 4px}h2{font-size:20px;margin:36px 0 8px;border-bottom:1px solid #d9dfe5;padding-bottom:4px}
.lead{font-size:18px;margin:6px 0 18px}.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(170px,1fr));gap:12px}
.card{background:#fff;border:1px solid #e1e6eb;border-radius:10px;padding:12px 14px}.card b{display:block;font-size:24px}
.card span{color:#5a6875;font-size:13px}.table{overflow-x:auto}figure{background:#fff;border:1px solid #e1e6eb;border-radius:10px;padding:10px;
margin:12px 0}figure svg{width:100%;height:auto;display:block}figcaption{color:#5a6875;font-size:14px;padding:4px 6px}
table{border-collapse:collapse;width:100%;background:#fff;border:1px solid #e1e6eb;border-radius:10px;font-size:14px}
th,td{padding:6px 10px;border-bottom:1px solid #eef1f4;text-align:left;vertical-align:top}th{background:#f0f3f6}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}.warn{background:#fff6e5;border:1px solid #f0d9a8;
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


def _traces(found: Diagnosis) -> list[tuple[str, str]]:
    """Return two figures a run: temperatures, and what the models leave of them."""
    array = found.problem.array
    fits = ((found.baseline, BEFORE, "model before"), (found.final, AFTER, "model after"))
    figures = []
    for r, run in enumerate(found.problem.runs):
        pick = _thin(len(run.time_s))
        since = (run.time_s - run.time_s[0])[pick]
        # a line across a gap or a stretch left out would be invented
        breaks = np.unique([0, *(np.searchsorted(pick_rows(run, pick), run.starts))])
        pair = []
        for residual in (False, True):
            figure, axes = plt.subplots(
                array.rows,
                array.cols,
                figsize=(max(3.7 * array.cols, 7.4), 2.1 * array.rows + 0.9),
                sharex=True,
                sharey=True,
                squeeze=False,
            )
            for k in range(run.springs):
                axis = axes[k // array.cols][k % array.cols]
                measured = run.temperature_c[:, k]
                if not np.isfinite(measured).any():
                    axis.text(
                        0.5, 0.5, "not measured", ha="center", transform=axis.transAxes, color=MEASURED, fontsize=9
                    )
                if not residual:
                    axis.plot(since, measured[pick], color=MEASURED, lw=2.6, label="measured")
                else:
                    noise = float(found.problem.noise[r][k])
                    axis.axhspan(-2 * noise, 2 * noise, color="#e3e8ec", lw=0, label="noise, 2 sigma")
                for fit, colour, label in fits:
                    shown = fit.residual[r][:, k] if residual else measured - fit.residual[r][:, k]
                    line = shown[pick].copy()
                    line[breaks[1:] - 1] = np.nan
                    axis.plot(since, line, color=colour, lw=0.9, label=label)
                axis.set_title(f"spring {k + 1}", fontsize=9, loc="left", color=INK)
                axis.grid(alpha=0.25)
                axis.tick_params(labelsize=8)
            handles, labels = axes[0][0].get_legend_handles_labels()
            figure.legend(handles, labels, fontsize=9, frameon=False, ncols=3, loc="upper right")
            figure.supxlabel("time since the beginning of the run, s", fontsize=9)
            figure.supylabel("measured less model, K" if residual else "temperature, °C", fontsize=9)
            figure.tight_layout(rect=(0, 0, 1, 1.0 - 0.25 / figure.get_figheight()))
            pair.append(_svg(figure))
        figures.append((pair[0], pair[1]))
    return figures


def pick_rows(run: Run, pick: slice) -> np.ndarray:
    """Return the numbers of the rows that a slice picks."""
    return np.arange(len(run.time_s))[pick]


def _maps(found: Diagnosis) -> str:
    problem = found.problem
    shape = (problem.array.rows, problem.array.cols)
    pictures = []
    for fit, label in ((found.baseline, "before"), (found.final, "after")):
        left = np.concatenate(fit.residual)
        seen = np.isfinite(left)
        count = np.where(seen.any(axis=0), seen.sum(axis=0), np.nan)
        square, mean = np.nansum(left**2, axis=0) / count, np.nansum(left, axis=0) / count
        pictures.append((np.sqrt(square), f"rms error {label}, K", "YlOrRd", False))
        pictures.append((mean, f"mean error {label}, K", "RdBu_r", True))
    top = [max(float(np.nanmax(np.abs(pictures[k + 2 * j][0]))) for j in (0, 1)) for k in (0, 1)]
    figure, axes = plt.subplots(1, 4, figsize=(12, min(3.2, 0.6 + 2.6 * shape[0] / shape[1])))
    for axis, (values, title, colours, signed) in zip(axes, pictures, strict=True):
        high = max(top[signed], 1e-9)
        axis.imshow(values.reshape(shape), cmap=colours, vmin=-high if signed else 0.0, vmax=high)
        for k, value in enumerate(values):
            known = math.isfinite(value)
            dark = known and abs(value) > (0.55 if signed else 0.7) * high
            x, y = k % shape[1], k // shape[1]
            shown = (f"{value:+.2f}" if signed else f"{value:.2f}") if known else "not\nmeasured"
            colour = "white" if dark else INK
            axis.text(x, y, shown, ha="center", va="center", fontsize=9 if known else 7, color=colour)
            axis.text(x - 0.44, y - 0.42, str(k + 1), ha="left", va="top", fontsize=6, color=colour, alpha=0.8)
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
    axes[0].set_ylabel("correlation", fontsize=9)
    axes[0].set_title("autocorrelation of the residual (grey: white noise)", fontsize=9)
    x = np.linspace(-6, 6, 200)
    axes[1].plot(x, np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi), color=MEASURED, label="sensor noise alone")
    axes[1].set_xlabel("residual / noise", fontsize=9)
    axes[1].set_ylabel("density", fontsize=9)
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
    axis.axvline(found.result["baseline"]["noise_c"], color=INK, lw=1, ls="--", zorder=0)
    axis.axvline(found.result["baseline"]["rmse_c"], color=BEFORE, lw=1, zorder=0)
    axis.set_yticks(y, [" + ".join(c["effects"]) for c in rows], fontsize=8)
    for at, c in zip(y, rows, strict=True):
        axis.annotate(
            f"{c['rmse_c']:.3f} K, {c['evidence_over_baseline']:+.0f} nats",
            (c["rmse_c"], at),
            (5, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            bbox=PAPER,
        )
    axis.set_xlim(0, max(c["rmse_c"] for c in rows) * 1.3)
    axis.set_xlabel("rms error, K (dashed: noise; red: before)", fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return _svg(figure)


def _e(text: object) -> str:
    return html.escape(str(text))


def _table(header: list[str], rows: list[list[object]], numeric: set[int]) -> str:
    head = "".join(f'<th class="n">{_e(h)}</th>' if k in numeric else f"<th>{_e(h)}</th>" for k, h in enumerate(header))
    body = "".join(
        "<tr>"
        + "".join(f'<td class="n">{_e(c)}</td>' if k in numeric else f"<td>{_e(c)}</td>" for k, c in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f'<div class="table"><table><tr>{head}</tr>{body}</table></div>'


def _parameters(entries: dict[str, Any]) -> str:
    """Return a table of numbers with standard errors, units, and what they are."""
    table = native.parameter_table()
    rows: list[list[object]] = []
    for name, one in entries.items():
        error = "not determined" if one["stderr"] is None else f"{one['stderr']:.2g}"
        unit = "–" if one["unit"] in ("", "1") else one["unit"]
        known = table.get(re.split(r"[\[@]", name)[0])
        says = "; ".join(filter(None, (known.description if known else "", one.get("note", ""))))
        rows.append([name, f"{one['value']:.5g}", error, unit, says])
    return _table(["number", "value", "standard error", "unit", "what it is"], rows, {1, 2})


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
        ("yes" if result["unexplained"] else "none", "unexplained rest"),
    ]
    parts.append(
        '<div class="cards">'
        + "".join(f'<div class="card"><b>{_e(a)}</b><span>{_e(b)}</span></div>' for a, b in cards)
        + "</div>"
    )
    parts.append(
        "<h2>Errors before and after</h2>"
        + _table(
            ["", "in sample, K rms", "held out, K rms"],
            [
                ["before: the declared model", f"{before['rmse_c']:.3f}", f"{before['holdout_rmse_c']:.3f}"],
                ["after: with the effects adopted", f"{after['rmse_c']:.3f}", f"{after['holdout_rmse_c']:.3f}"],
                ["noise of the sensors", f"{before['noise_c']:.3f}", "–"],
            ],
            {1, 2},
        )
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
        numbers = {k: v for e in result["effects"] for k, v in e["parameters"].items()}
        parts.append("<h2>Their numbers</h2>" + _parameters(numbers))
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
    for r, (svg, left) in enumerate(_traces(found)):
        log, run = result["logs"][r], found.problem.runs[r]
        parts.append(
            f"<figure>{svg}<figcaption>Run {r + 1}: {_e(log['file'])}, {log['rows']} rows, {run.duration_s / 60:.1f} min. "
            "Grey: measured; red: the declared model; blue: with the effects adopted.</figcaption></figure>"
            f"<figure>{left}<figcaption>Run {r + 1}: what both models leave. Within the grey band, two standard deviations "
            "of the sensor's noise, there is nothing more to find.</figcaption></figure>"
        )
    parts.append(
        f"<h2>Where the error sits</h2><figure>{_maps(found)}<figcaption>Each cell is a spring, row 1 on top; its number in the corner. Mean: measured less model.</figcaption></figure>"
    )
    parts.append(
        f"<h2>What is left</h2><figure>{_autocorrelation(found)}<figcaption>{_e(result['residual']['note'])}</figcaption></figure>"
    )
    if svg := _evidence(found):
        parts.append(
            f"<h2>What was tried</h2><figure>{svg}<figcaption>Models fitted on the way, best first; blue is the one adopted.</figcaption></figure>"
        )
    parts.append("<h2>The declared model's numbers</h2>" + _parameters(after["parameters"]))
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
    return _page(parts)


def _page(parts: list[str]) -> str:
    title = "Ninespring diagnosis"
    return f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title><style>{STYLE}</style></head><body><main>{"".join(parts)}</main></body></html>\n'


def _cases(result: dict[str, Any]) -> str:
    """Draw a steady table's cases: measured, model before, model after."""
    cases = result["cases"]
    figure, axis = plt.subplots(figsize=(12, 0.34 * len(cases) + 1.2))
    y = np.arange(len(cases))[::-1]
    for key, colour, label, marker, size in (
        ("measured_c", MEASURED, "measured", "o", 11),
        ("before_c", BEFORE, "model before", "o", 6),
        ("after_c", AFTER, "model after", "D", 5),
    ):
        if key in cases[0]:
            axis.plot([c[key] for c in cases], y, marker, color=colour, ms=size, label=label)
    axis.set_yticks(y, [c["case"] for c in cases], fontsize=9)
    axis.set_xlabel("temperature, °C", fontsize=9)
    axis.grid(alpha=0.25)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(fontsize=9, frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1, 1))
    figure.tight_layout()
    return _svg(figure)


def steady_report(result: dict[str, Any]) -> str:
    """Return the report of a steady table's diagnosis as HTML."""
    before, after = result["baseline"], result["after"]
    names = ", ".join(e["name"] for e in result["effects"]) or "no effect"
    parts = [
        f"<h1>Steady table: error {before['rmse_c']:.2f} → {after['rmse_c']:.2f} K</h1>",
        f'<p class="lead">With one number each, {_e(names)} explains it best.</p>',
    ]
    if result["warnings"]:
        parts.append('<h2>About the data</h2><div class="warn">' + "<br>".join(map(_e, result["warnings"])) + "</div>")
    parts.append(
        "<h2>Errors before and after</h2>"
        + _table(
            ["", "in sample, K rms", "left one out, K rms"],
            [
                ["before: the declared model, frozen", f"{before['rmse_c']:.2f}", f"{before['holdout_rmse_c']:.2f}"],
                ["after: with the effect adopted", f"{after['rmse_c']:.2f}", f"{after['holdout_rmse_c']:.2f}"],
            ],
            {1, 2},
        )
    )
    rows: list[list[object]] = [
        [c["case"], f"{c['measured_c']:.1f}", f"{c['before_c']:.1f}", f"{c['after_c']:.1f}" if "after_c" in c else "–"]
        for c in result["cases"]
    ]
    parts.append(
        f"<h2>Cases</h2><figure>{_cases(result)}</figure>"
        + _table(["case", "measured, °C", "model before, °C", "model after, °C"], rows, {1, 2, 3})
    )
    parts += [f"<h2>Its number</h2>{_parameters(e['parameters'])}" for e in result["effects"]]
    parts.append(
        "<h2>Every effect with one number</h2>" + _table(steady.HEADER, [*steady.candidate_rows(result)], {2, 3})
    )
    if result["rivals"]:
        rows = [
            [r["instead_of"], r["name"], f"{r['rmse_c']:.2f}", r["separating_experiment"]] for r in result["rivals"]
        ]
        parts.append(
            "<h2>What these numbers cannot tell apart</h2>"
            + _table(["best", "could also be", "error, K", "the experiment that would tell"], rows, {2})
        )
    parts.append(f"<p><small>{_e(result['tool'])}. {_e(result['residual']['note'])}.</small></p>")
    return _page(parts)


def with_unit(value: dict[str, Any]) -> str:
    """Return a fitted number in words: value, standard error, unit."""
    error = "" if value["stderr"] is None else f" +- {value['stderr']:.2g}"
    unit = "" if value["unit"] in ("", "1") else f" {value['unit']}"
    return f"{value['value']:.4g}{error}{unit}"
