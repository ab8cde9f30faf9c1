"""report.html: everything a diagnosis found, in one file that needs nothing else."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from typing import Any

from ..find import board_alone, search, steady
from ..find.diagnosis import Diagnosis
from ..io.logs import CUT_SHORT
from ..model import effects, native
from . import figures

STYLE = """
:root{color-scheme:light dark;--ink:#1d2733;--soft:#5a6875;--page:#f6f7f9;--card:#fff;--line:#e1e6eb;--head:#f0f3f6;
--warn:#fff6e5;--bad:#fdeeea}
@media (prefers-color-scheme:dark){:root{--ink:#e6ebf0;--soft:#a7b4c0;--page:#14191f;--card:#1d242c;--line:#333e49;--head:#252e38;
--warn:#3a3017;--bad:#43241d}}
body{font:16px/1.5 system-ui,-apple-system,"Segoe UI",sans-serif;color:var(--ink);background:var(--page);margin:0}
main{max-width:1120px;margin:0 auto;padding:24px 20px 60px}
h1{font-size:26px;margin:8px 0 4px}h2{font-size:20px;margin:36px 0 8px;border-bottom:1px solid var(--line);padding-bottom:4px}
.lead{font-size:17px;margin:6px 0 18px}.first{display:grid;grid-template-columns:minmax(0,3fr) minmax(0,2fr);gap:18px;align-items:start}
.said{list-style:none;margin:0;padding:0}.said li{background:var(--card);border:1px solid var(--line);border-radius:10px;
padding:10px 14px;margin:0 0 8px;font-size:18px}.said b{font-weight:600;font-size:13px;color:var(--soft);display:block}
pre{background:var(--head);border-radius:10px;padding:10px 14px;overflow-x:auto;font-size:14px}
.table{overflow-x:auto}figure{background:#fff;color:#1d2733;border:1px solid var(--line);border-radius:10px;padding:10px;margin:0 0 12px}
figure svg{width:100%;height:auto;display:block}figcaption{color:#5a6875;font-size:14px;padding:4px 6px}
table{border-collapse:collapse;width:100%;background:var(--card);border:1px solid var(--line);border-radius:10px;font-size:14px}
th,td{padding:6px 10px;border-bottom:1px solid var(--line);text-align:left;vertical-align:top}th{background:var(--head)}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}.warn{background:var(--warn);border:1px solid var(--line);
border-radius:10px;padding:10px 14px}.bad{background:var(--bad)}small{color:var(--soft)}
@media (max-width:700px){.first{grid-template-columns:minmax(0,1fr)}main{padding:14px 12px 40px}h1{font-size:22px}.said li{font-size:16px}}
"""


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
    apart = result.get("runs_differ")
    held = f"held-out error {before['holdout_rmse_c']:.2f} → {after['holdout_rmse_c']:.2f} K at a noise of {before['noise_c']:.2f} K"
    if "unseen" in result:
        held = f"{result['unseen']['text']}; {held}"
    if names and not result["unexplained"]:
        return f"Missing: {' and '.join(names)}; {held}."
    if names:
        return f"Missing: {' and '.join(names)}, and something that no effect of the library explains; {held}."
    if result["unexplained"]:
        return f"Something is missing that no effect of the library explains; {held}."
    if apart:
        return f"Nothing is missing in the array's model, but the runs differ; {held}."
    return f"Nothing is missing: the declared model explains the data to the noise; {held}."


def findings(result: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what was found in words and sizes, each with how sure it is: effects, unknown heat, what is left."""
    out = [("a mistake in the log?", text) for text in result.get("doubts", [])]
    for one in result["effects"]:
        sure = f"{one['certainty']}, {100 * one['probability']:.0f} %" if "probability" in one else ""
        out.append((f"{one['name']}: {sure}" if sure else one["name"], one.get("text", one["in_words"])))
    for one in result.get("runs_differ", []):
        out.append((f"runs differ: {one['certainty']}, {100 * one['probability']:.0f} %", one["text"]))
    out += without_name(result)
    if result["unexplained"]:
        left = result["residual"].get("structure_c")
        size = f"{left:.2f} K rms of structure is left" if left is not None else "Structure is left"
        out.append(("unexplained", f"{size} beyond the noise of {result['baseline']['noise_c']:.2f} K."))
    if not out:
        out.append(("nothing is missing", "The declared model explains the logs to the noise of the sensors."))
    return out


def without_name(result: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what acts without a name in the library, in words and sizes, as `findings` does."""
    out = []
    for one in result.get("unnamed", []):
        out.append(("a cause without a name", one["text"][0].upper() + one["text"][1:] + "."))
    for event in result.get("unknown_heat", {}).get("events", []):
        kind = "a thermometer that jumped" if event["kind"] == "sensor" else "heat of unknown origin"
        sure = f" (+-{event['stderr']:.2g} {event['unit']})"
        out.append((kind + sure, event["text"][0].upper() + event["text"][1:] + "."))
    return out


def next_steps(result: dict[str, Any], folder: str) -> list[str]:
    """Return what to do next, as commands; `folder` is where the diagnosis is written."""
    if result.get("doubts"):
        logs = " ".join(log["file"] for log in result.get("logs", []))
        return [
            *(f"# {text}" for text in result["doubts"]),
            f"ninespring diagnose {logs} -o {folder}     # when that is mended; export refuses this model",
        ]
    out = [f"# {one['separating_experiment']}" for one in result["rivals"][:2]]
    if out:
        run = next((one["experiment"]["duration_s"] for one in result["rivals"] if "experiment" in one), 900.0) + 10.0
        out += [
            f"ninespring plan --for {folder}/diagnosis.json -o steps.txt     # the first of them",
            f"ninespring record --port PORT --thermometers PORT --run steps.txt --duration {run:g} -o run3.csv",
            f"ninespring diagnose {' '.join(log['file'] for log in result.get('logs', []))} run3.csv -o {folder}",
        ]
    return [
        *out,
        f"ninespring verify --model {folder}/model.toml another.csv      # a log that this fit never saw",
        f"ninespring export --model {folder}/model.toml -o settings.txt",
        "ninespring upload --port PORT settings.txt",
    ]


def cut_short(warnings: Sequence[str]) -> list[str]:
    """Return, to be said before anything else, which runs a fault of the board cut short."""
    lines = [one for one in warnings if CUT_SHORT in one]
    return [f'<div class="warn bad">{"<br>".join(map(_e, lines))}</div>'] if lines else []


def html_report(found: Diagnosis, folder: str = "diagnosis") -> str:
    """Return the report as HTML; `folder` is where the diagnosis is written."""
    result = found.result
    before, after = result["baseline"], result["after"]
    parts = [
        "<h1>What the array does that the model did not</h1>",
        *cut_short(result["warnings"]),
        f'<p class="lead">{_e(verdict(result))}</p>',
    ]
    said = [(one, text) for one, text in findings(result)]
    lines = "".join(f"<li><b>{_e(one)}</b>{_e(text)}</li>" for one, text in said)
    parts.append(
        f'<div class="first"><div><ul class="said">{lines}</ul></div><div>'
        f"<figure>{figures.array_map(found)}<figcaption>What the best model leaves at each spring, in multiples of its "
        f"sensor's noise.</figcaption></figure><figure>{figures.error_bars(result)}</figure></div></div>"
        f"<h2>What to do next</h2><pre>{_e(chr(10).join(next_steps(result, folder)))}</pre>"
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
    for r, (svg, left) in enumerate(figures.traces(found)):
        log, run = result["logs"][r], found.problem.runs[r]
        parts.append(
            f"<figure>{left}<figcaption>Run {r + 1}: what both models leave. Within the grey band, two standard deviations "
            "of the sensor's noise, there is nothing more to find. Shaded below: the spring's own drive, and blue the fan."
            "</figcaption></figure>"
            f"<figure>{svg}<figcaption>Run {r + 1}: {_e(log['file'])}, {log['rows']} rows, {run.duration_s / 60:.1f} min. "
            "Grey: measured; red: the declared model; blue: with the effects adopted.</figcaption></figure>"
        )
    parts.append(
        f"<h2>Where the error sits</h2><figure>{figures.maps(found)}<figcaption>Each cell is a spring, row 1 on top; its number in the corner. Mean: measured less model.</figcaption></figure>"
    )
    if svg := figures.unknown_heat(found):
        parts.append(
            f"<h2>Heat of unknown origin</h2><figure>{svg}<figcaption>Where, when and how much: heat that the model lacks, W, "
            "at each spring over time.</figcaption></figure>"
        )
    parts.append(
        f"<h2>What is left</h2><figure>{figures.autocorrelation(found)}<figcaption>{_e(result['residual']['note'])}</figcaption></figure>"
    )
    if svg := figures.evidence(found):
        parts.append(
            f"<h2>What was tried</h2><figure>{svg}<figcaption>Models fitted on the way, best first; blue is the one adopted.</figcaption></figure>"
        )
    parts.append("<h2>The declared model's numbers</h2>" + _parameters(after["parameters"]))
    identify = result["identifiability"]
    lines = [f"{n}: the data cannot fix it" for n in identify["not_identifiable"]]
    lines += [f"{n}: at its bound" for n in identify["at_bounds"]]
    tied = sorted({name for c in identify["correlated"] for name in (c["a"], c["b"])})
    if tied:
        lines.append(f"determined in combination only: {', '.join(tied)}")
    if lines:
        parts.append('<h2>Not determined by these data</h2><div class="warn">' + "<br>".join(map(_e, lines)) + "</div>")
    parts.append(
        f"<p><small>{_e(result['tool'])}; {result['simulations']} simulations in {result['seconds']} s. An effect is adopted only if it explains more than {search.MIN_GAIN:.2f} of the noise, by {search.MIN_EVIDENCE:.0f} nats. Effects known: {', '.join(effects.IN_WORDS)}.</small></p>"
    )
    return _page(parts)


def _page(parts: list[str]) -> str:
    title = "Ninespring diagnosis"
    return f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title><style>{STYLE}</style></head><body><main>{"".join(parts)}</main></body></html>\n'


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
        f"<h2>Cases</h2><figure>{figures.cases(result)}</figure>"
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


def board_report(result: dict[str, Any], folder: str = "diagnosis") -> str:
    """Return the report of a diagnosis without thermometers as HTML."""
    said = "".join(
        f"<li><b>{_e(one['certainty'])}, {100 * one['probability']:.0f} %</b>{_e(one['text'])}</li>"
        for one in result["effects"]
    )
    parts = [
        "<h1>A board without thermometers</h1>",
        *cut_short(result["warnings"]),
        f'<p class="lead">{_e(board_alone.verdict(result))}</p>',
    ]
    if said:
        parts.append(f'<ul class="said">{said}</ul>')
    parts.append(f"<h2>What to do next</h2><pre>{_e(chr(10).join(next_steps(result, folder)))}</pre>")
    parts.append('<h2>About the data</h2><div class="warn">' + "<br>".join(map(_e, result["warnings"])) + "</div>")
    parts.append("<h2>The array's numbers</h2>" + _parameters(result["after"]["parameters"]))
    parts += [f"<h2>{_e(one['name'])}</h2>{_parameters(one['parameters'])}" for one in result["effects"]]
    parts.append(f"<p><small>{_e(result['tool'])}. {_e(result['residual']['note'])}.</small></p>")
    return _page(parts)


def with_unit(value: dict[str, Any]) -> str:
    """Return a fitted number in words: value, standard error, unit."""
    error = "" if value["stderr"] is None else f" +- {value['stderr']:.2g}"
    unit = "" if value["unit"] in ("", "1") else f" {value['unit']}"
    return f"{value['value']:.4g}{error}{unit}"
