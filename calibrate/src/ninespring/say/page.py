"""The reports of a diagnosis, each one file that needs nothing else, and the sentences that they begin with."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from ..find import search
from ..find.diagnosis import Diagnosis
from ..find.loose import LEFT_OUT
from ..io import results
from ..io.logs import CUT_SHORT
from ..model import effects, native
from ..model.models import Model, model_text
from . import figures

HEADER = ("effect", "its one number", "error, K", "left one out, K", "what speaks against it")
"""Of `candidate_rows`."""
BEGIN, END = "<!-- verified -->", "<!-- /verified -->"


def render(template: str, **said: Any) -> str:
    """Return a page or a part of one (templates/); text is escaped, what is Markup stands as it is."""
    pages = jinja2.Environment(
        loader=jinja2.PackageLoader("ninespring.say"),
        autoescape=lambda name: not str(name).endswith(".css"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.filters["number_rows"] = number_rows
    return pages.get_template(template).render(said)


def number_rows(parameters: results.Parameters) -> list[tuple[str, ...]]:
    """Return numbers with standard errors, units, and what they are, as rows of text."""
    table = native.parameter_table()
    rows: list[tuple[str, ...]] = []
    for name, one in parameters.items():
        error = "not determined" if one.stderr is None else f"{one.stderr:.2g}"
        known = table.get(re.split(r"[\[@]", name)[0])
        says = "; ".join(filter(None, (known.description if known else "", one.note or "")))
        rows.append((name, f"{one.value:.5g}", error, "–" if one.unit in ("", "1") else one.unit, says))
    return rows


def verdict(told: results.Diagnosis) -> str:
    """Return the outcome in one sentence."""
    before, after = told.baseline, told.after
    names = " and ".join(one.called for one in told.effects)
    held = f"held-out error {before.holdout_rmse_c:.2f} → {after.holdout_rmse_c:.2f} K at a noise of {before.noise_c:.2f} K"
    if told.unseen:
        held = f"{told.unseen.text}; {held}"
    if names and not told.unexplained:
        return f"Missing: {names}; {held}."
    if names:
        return f"Missing: {names}, and something that no effect of the library explains; {held}."
    if told.unexplained:
        return f"Something is missing that no effect of the library explains; {held}."
    if told.runs_differ:
        return f"Nothing is missing in the array's model, but the runs differ; {held}."
    return f"Nothing is missing: the declared model explains the data to the noise; {held}."


def board_verdict(told: results.BoardDiagnosis) -> str:
    """Return the outcome in one sentence, where nothing measured a temperature."""
    before, after = told.baseline, told.after
    names = " and ".join(one.name for one in told.effects)
    error = (
        f"voltages are met to {1e3 * after.rmse_v:.1f} mV ({1e3 * before.rmse_v:.1f} as declared, "
        f"{1e3 * before.noise_v:.1f} is what a board's readings are good for)"
    )
    more = " Something else is missing that no effect of the library explains." if told.unexplained else ""
    return (
        f"No thermometer: {error}. {f'Missing: {names}.' if names else 'No effect is missing that v / i shows.'}{more}"
    )


def findings(told: results.Diagnosis) -> list[tuple[str, str]]:
    """Return what was found in words and sizes, each with how sure it is: effects, unknown heat, what is left."""
    out = [("a mistake in the log?", text) for text in told.doubts]
    out += [(f"{one.name}: {one.certainty}, {100 * one.probability:.0f} %", one.text) for one in told.effects]
    out += [(f"runs differ: {one.certainty}, {100 * one.probability:.0f} %", one.text) for one in told.runs_differ]
    out += without_name(told)
    if told.unexplained:
        left = f"{told.residual.structure_c:.2f} K rms of structure is left"
        out.append(("unexplained", f"{left} beyond the noise of {told.baseline.noise_c:.2f} K."))
    if not out:
        out.append(("nothing is missing", "The declared model explains the logs to the noise of the sensors."))
    return out


def without_name(told: results.Diagnosis) -> list[tuple[str, str]]:
    """Return what acts without a name in the library, in words and sizes, as `findings` does."""
    out = [
        ("a thermometer, left out" if one.text.endswith(LEFT_OUT) else "a cause without a name", _sentence(one.text))
        for one in told.unnamed
    ]
    for event in told.unknown_heat.events:
        kind = "a thermometer that jumped" if event.kind == "sensor" else "heat of unknown origin"
        out.append((f"{kind} (+-{event.stderr:.2g} {event.unit})", _sentence(event.text)))
    return out


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + "."


def next_steps(told: results.Told, folder: str, asked: str = "") -> list[str]:
    """Return what to do next, as commands; `folder` is where the diagnosis is written, `asked` of what it is, as it was typed."""
    logs = asked or " ".join(log.file for log in told.logs)
    if doubts := getattr(told, "doubts", []):
        return [
            *(f"# {text}" for text in doubts),
            f"ninespring diagnose {logs} -o {folder}     # when that is mended; export refuses this model",
        ]
    out = [f"# {one.separating_experiment}" for one in told.rivals[:2]]
    if out:
        run = next((one.experiment.duration_s for one in told.rivals if one.experiment), 900.0) + 10.0
        out += [
            f"ninespring plan --for {folder}/diagnosis.json -o steps.txt     # the first of them",
            f"ninespring record --port PORT --thermometers PORT --run steps.txt --duration {run:g} -o run3.csv",
            f"ninespring diagnose {logs} run3.csv -o {folder}",
        ]
    return [
        *out,
        f"ninespring verify --model {folder}/model.toml another.csv      # a log that this fit never saw",
        f"ninespring export --model {folder}/model.toml -o settings.txt",
        "ninespring upload --port PORT settings.txt",
    ]


def cut_short(warnings: Sequence[str]) -> list[str]:
    """Return, to be said before anything else, which runs a fault of the board cut short."""
    return [one for one in warnings if CUT_SHORT in one]


def _undetermined(told: results.Diagnosis) -> list[str]:
    lines = [f"{n}: the data cannot fix it" for n in told.identifiability.not_identifiable]
    lines += [f"{n}: at its bound" for n in told.identifiability.at_bounds]
    tied = sorted({name for one in told.identifiability.correlated for name in (one.a, one.b)})
    return lines + ([f"determined in combination only: {', '.join(tied)}"] if tied else [])


def files_of(folder: Path, told: results.Told, page: str, model: Model) -> dict[Path, str]:
    """Return what a diagnosis writes into a folder: result, report, model."""
    texts = results.checked(told), page, model_text(model)
    return {folder / name: text for name, text in zip(results.FILES, texts, strict=True)}


def html_report(found: Diagnosis, folder: str = "diagnosis", asked: str = "") -> str:
    """Return the report as HTML; `folder` is where the diagnosis is written, `asked` of what it is, as it was typed."""
    told = found.told
    return render(
        "diagnosis.html",
        title="Ninespring diagnosis",
        told=told,
        verdict=verdict(told),
        findings=findings(told),
        cut_short=cut_short(told.warnings),
        next_steps=next_steps(told, folder, asked),
        found=found,
        figures=figures,
        numbers={name: one for effect in told.effects for name, one in effect.parameters.items()},
        undetermined=_undetermined(told),
        least_gain=search.MIN_GAIN,
        least_evidence=search.MIN_EVIDENCE,
        known=list(effects.IN_WORDS),
    )


def steady_report(told: results.SteadyDiagnosis) -> str:
    """Return the report of a steady table's diagnosis as HTML."""
    return render(
        "steady.html", title="Ninespring diagnosis", told=told, header=HEADER, candidates=candidate_rows(told)
    )


def board_report(told: results.BoardDiagnosis, folder: str = "diagnosis", asked: str = "") -> str:
    """Return the report of a diagnosis without thermometers as HTML; `folder` and `asked` as of `html_report`."""
    return render(
        "board.html",
        title="Ninespring diagnosis",
        told=told,
        verdict=board_verdict(told),
        findings=[(f"{one.certainty}, {100 * one.probability:.0f} %", one.text) for one in told.effects],
        cut_short=cut_short(told.warnings),
        next_steps=next_steps(told, folder, asked),
    )


def candidate_rows(told: results.SteadyDiagnosis) -> list[tuple[str, ...]]:
    """Return the effects that were tried on a steady table as rows of text, under HEADER."""
    rows: list[tuple[str, ...]] = []
    for one in told.candidates:
        unit = "" if one.unit in (None, "1") else f" {one.unit}"
        value = "" if one.value is None else f"{one.parameter} = {one.value:.4g}{unit}"
        if one.at_bound:
            value += " (at its bound)"
        rows.append((one.name, value, f"{one.rmse_c:.2f}", f"{one.holdout_rmse_c:.2f}", one.note))
    return rows


def with_unit(one: results.Number) -> str:
    """Return a fitted number in words: value, standard error, unit."""
    error = "" if one.stderr is None else f" +- {one.stderr:.2g}"
    return f"{one.value:.4g}{error}{'' if one.unit in ('', '1') else f' {one.unit}'}"


def error_rows(before: results.ChipError, after: results.ChipError) -> list[tuple[str, str, str]]:
    """Return the chip's error before and after, of all springs and of each, as rows of text."""
    pairs = zip(before.rmse_per_spring_c, after.rmse_per_spring_c, strict=True)
    rows = [("all springs", before.rmse_c, after.rmse_c), *((f"spring {k}", *one) for k, one in enumerate(pairs, 1))]
    cell = lambda value: "–" if value is None else f"{value:.2f}"  # noqa: E731
    return [(name, cell(a), cell(b)) for name, a, b in rows]


def with_verification(page: str, verified: results.Verify) -> str:
    """Return a report with the chip's error before and after in it; what an earlier verification said is replaced."""
    log = verified.logs[0]
    bad = [f"{log.file}: {note}" for note in cut_short(log.notes)]
    rows = error_rows(verified.before, verified.after)
    section = BEGIN + render("verified.html", log=log, cut_short=bad, rows=rows) + END
    bare = re.sub(f"{BEGIN}.*?{END}", "", page, flags=re.S)
    at = bare.find("<h2")
    at = at if at >= 0 else bare.find("</main>")
    return bare[:at] + section + bare[at:]
