"""report.html of a calibration: what was found step by step, how the board drove before and after, what it was sent."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from ...io.logs import read_log
from ...model.models import Array
from ...say.figures import AFTER, BEFORE, INK, MEASURED, as_svg
from ...say.page import STYLE
from .chain import DIAGNOSIS, OLD_SETTINGS, SETTINGS
from .judged import believed
from .progress import Progress

COLOURS = [BEFORE, AFTER, "#8a6d3b"]


def _e(text: object) -> str:
    return html.escape(str(text))


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table whose first column is text and the others are numbers."""
    cells = lambda row, tag: "".join(  # noqa: E731
        f"<{tag}{' class=n' if k else ''}>{_e(cell)}</{tag}>" for k, cell in enumerate(row)
    )
    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    return f'<div class="table"><table><tr>{cells(head, "th")}</tr>{body}</table></div>'


def verdict(progress: Progress) -> str:
    """Return how it ended, in a sentence."""
    done = progress.done
    if progress.data["refused"]:
        return f"Nothing was saved on the board: {progress.data['refused']}."
    if "after" not in done:
        return "Not finished: the same command goes on from here."
    if not done["after"]["saved"]:
        return "The board had these settings already: nothing was written."
    before, after = done["before"], done["after"]["drives"][-1]
    return (
        f"The new settings are on the board. It was {before['error_c']:.1f} K wrong (rms) about its springs while it drove "
        f"them, and is {after['error_c']:.1f} K wrong now."
    )


def page(progress: Progress, array: Array) -> str:
    """Return the report of what is done so far, as HTML."""
    done = progress.done
    diagnosed = done["diagnose"]
    bad = " bad" if progress.data["refused"] else ""
    found = "".join(f"<li><b>{_e(name)}</b>{_e(text)}</li>" for name, text in diagnosed["findings"])
    parts = [
        "<h1>Calibration</h1>",
        f'<p class="lead">{"<span class=" + chr(34) + "warn bad" + chr(34) + ">" if bad else ""}{_e(verdict(progress))}'
        f"{'</span>' if bad else ''}</p>",
    ]
    drives = [one for one in (done.get("before"), *done.get("after", {}).get("drives", [])) if one]
    if drives:
        parts += _drives(progress, array, drives)
    parts.append(
        f'<h2>What was found</h2><ul class="said">{found}</ul><p>{_e(diagnosed["verdict"])} '
        f'<a href="{DIAGNOSIS}/report.html">The diagnosis in full</a>.</p>'
    )
    if diagnosed["experiments"]:
        told = "".join(f"<li>{_e(one)}</li>" for one in diagnosed["experiments"])
        parts.append(f"<p>These data cannot tell everything apart; what would:</p><ul>{told}</ul>")
    if "verify" in done:
        parts.append("<h2>On the second run, which the fit never saw</h2>" + _verified(done["verify"]))
    if "export" in done:
        parts += _settings(progress)
    parts.append("<h2>What was measured</h2>" + _measured(progress))
    parts.append(f"<p><small>{_e(progress.data['tool'])}; {_e(progress.data['board']['version'][0])}</small></p>")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>Ninespring calibration</title><style>{STYLE}</style></head><body><main>{''.join(parts)}</main></body></html>\n"
    )


def _drives(progress: Progress, array: Array, drives: Sequence[dict[str, Any]]) -> list[str]:
    names = ["as the board was", *(["with the new settings"] if len(drives) > 1 else [])]
    shown = [drives[0], *drives[-1:]] if len(drives) > 1 else [drives[0]]
    measures = (
        ("the chip's error, K rms", "error_c", "{:.2f}"),
        ("its worst spring's, K rms", "worst_c", "{:.1f}"),
        ("springs that are on hold, % austenite", "held", "{:.0%}"),
        ("springs that are off reach, % austenite", "undriven", "{:.0%}"),
        ("hottest, degC", "hottest_c", "{:.0f}"),
        ("from the first current until all have transformed, s", "heating_s", "{:.0f}"),
    )
    rows = [[label, *(form.format(one[key]).rstrip("%") for one in shown)] for label, key, form in measures]
    faults = [f for one in drives for f in one["faults"]]
    out = [f"<h2>The same drive before and after</h2><figure>{_picture(progress, array, shown, names)}"]
    out.append(
        "<figcaption>Grey: what the thermometers show of each spring; coloured: what the chip believed of it. "
        f"Pattern {_e(progress.option('pattern'))}.</figcaption></figure>"
    )
    out.append(_table(["", *names], rows))
    if faults:
        out.append(f'<p class="warn bad">{"<br>".join(map(_e, faults))}</p>')
    return out


def _picture(progress: Progress, array: Array, shown: Sequence[dict[str, Any]], names: Sequence[str]) -> str:
    """Draw the worst and the best known spring and one that is off, measured and believed, a panel a drive."""
    logs = [progress.folder / one["log"] for one in shown]
    runs = [read_log(log, array.springs) for log in logs]
    thought = [believed(log, run) for log, run in zip(logs, runs, strict=True)]
    error = np.sqrt(np.nanmean((thought[0] - runs[0].temperature_c) ** 2, axis=0))
    on = [k for k, one in enumerate(progress.option("pattern")) if one == "1"]
    off = [k for k in range(array.springs) if k not in on]
    picked = list(dict.fromkeys([max(on, key=lambda k: error[k]), min(on, key=lambda k: error[k]), *off[:1]]))
    figure, axes = plt.subplots(1, len(runs), figsize=(5.2 * len(runs), 3.6), sharey=True, squeeze=False)
    for axis, run, belief, name in zip(axes[0], runs, thought, names, strict=True):
        since = run.time_s - run.time_s[0]
        for k, colour in zip(picked, COLOURS, strict=False):
            axis.plot(since, run.temperature_c[:, k], color=MEASURED, lw=3.0)
            axis.plot(since, belief[:, k], color=colour, lw=1.2, label=f"spring {k + 1}{'' if k in on else ', off'}")
        axis.set_title(name, fontsize=10, loc="left", color=INK)
        axis.set_xlabel("time, s", fontsize=9)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    axes[0][0].set_ylabel("temperature, °C", fontsize=9)
    axes[0][0].legend(fontsize=8, frameon=False, loc="lower right")
    figure.tight_layout()
    return as_svg(figure)


def _verified(errors: dict[str, Any]) -> str:
    before, after = errors["before"], errors["after"]
    cell = lambda value: "–" if value is None else f"{value:.2f}"  # noqa: E731
    pairs = zip(before["rmse_per_spring_c"], after["rmse_per_spring_c"], strict=True)
    rows = [["all springs", cell(before["rmse_c"]), cell(after["rmse_c"])]]
    rows += [[f"spring {k}", cell(a), cell(b)] for k, (a, b) in enumerate(pairs, start=1)]
    return _table(["the chip's model, error in K rms", "as the board was", "with what was found"], rows)


def _settings(progress: Progress) -> list[str]:
    export, had = progress.done["export"], progress.data["board"]["settings"]
    sent = {name: value for name, value in export["settings"].items() if float(had.get(name, "nan")) != float(value)}
    out = ["<h2>What it means for the board</h2>"]
    if sent:
        out.append(_table(["setting", "it had", "was found"], [[f"${n}", had.get(n, "–"), v] for n, v in sent.items()]))
    kept = "".join(f"<li>{_e(', '.join(names))}: {_e(why)}</li>" for why, names in export["kept"].items())
    if kept:
        out.append(f"<p>Not written, and why:</p><ul>{kept}</ul>")
    folder: Path = progress.folder
    out.append(
        f"<p>{_e(SETTINGS)} holds what was found, {_e(OLD_SETTINGS)} what the board had before; either goes onto the board by</p>"
        f"<pre>ninespring upload --port PORT {_e(folder / OLD_SETTINGS)}</pre>"
    )
    return out


def _measured(progress: Progress) -> str:
    rows: list[list[object]] = []
    for name in ("run1", "run2"):
        for one in progress.done.get(name, {}).get("pieces", []):
            note = one["ended"] or ("" if one["used"] else "too short to count")
            rows.append([one["log"], f"{one['from_s']:.0f} to {one['to_s']:.0f}", one["rows"], note])
    return _table(["log", "of its plan, s", "rows", ""], rows)
