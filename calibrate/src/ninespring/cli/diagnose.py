"""`ninespring diagnose`."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
from rich.table import Table

from ..errors import InputError
from ..export.settings import judged
from ..find import board_alone, diagnosis, steady
from ..infer import from_resistance
from ..io import results
from ..model.models import Array
from ..say import page as report
from .console import (
    ARRAY,
    FILE,
    FOLDER,
    array_and_runs,
    command,
    make_folder,
    model_and_array,
    out,
    output,
    working,
    write,
)


@command("""\b
Examples:
  ninespring diagnose run1.csv run2.csv -o diagnosis
  ninespring diagnose --array array.toml tclab.csv -o diagnosis
  ninespring diagnose --model model.toml --frozen run3.csv -o check
  ninespring diagnose --model model.toml --frozen steady.csv -o steady
""")
@click.argument("logs", nargs=-1, required=True, type=FILE)
@ARRAY
@click.option("--model", "model_path", type=FILE, help="model.toml: declared values and effects already on")
@click.option("--frozen", is_flag=True, help="keep the model's values as they are; fit effects only")
@output("folder for diagnosis.json, report.html, model.toml", FOLDER)
@click.option("--json", "json_path", type=FILE, help="write diagnosis.json here too")
def diagnose(
    logs: tuple[Path, ...],
    array_path: Path | None,
    model_path: Path | None,
    frozen: bool,
    output: Path,
    json_path: Path | None,
) -> None:
    """Find the effect that the model lacks: writes diagnosis.json, report.html, model.toml.

    LOGS are logs of one array, or one steady table (docs/files.md). Logs of a board alone, currents and voltages without any
    temperature, are diagnosed from v / i: degrees stay open. Errors are root mean squares in K; evidence is in
    nats, the logarithm of how many times likelier the data are with the effect.
    """
    if frozen and not model_path:
        raise InputError("--frozen needs --model")
    model, array = model_and_array(model_path, array_path)
    # as it was typed, for what the report says to type next
    given = {"--array": array_path, "--model": model_path}
    asked = shlex.join([word for name, path in given.items() if path for word in (name, str(path))] + [*map(str, logs)])
    told: results.SteadyDiagnosis | results.BoardDiagnosis | results.Diagnosis
    if any(steady.is_steady(path) for path in logs):
        if len(logs) > 1:
            raise InputError("give one steady table, or logs")
        with working("fitting") as say:
            still, made = steady.diagnose_table(logs[0], model, array or Array(), frozen, say)
        told, page = still, report.steady_report(still)
    else:
        array, runs = array_and_runs(array, logs)
        if from_resistance.has_none(runs):
            if model_path:
                raise InputError("without a thermometer give logs and an array only, no --model", logs[0])
            with working("fitting v / i") as say:
                alone, made = board_alone.diagnose(array, runs, say)
            told, page = alone, report.board_report(alone, str(output), asked)
        else:
            with working("fitting") as say:
                found = diagnosis.diagnose(array, runs, model=model, frozen=frozen, progress=say)
                found.model.name = str(output / "model.toml")
                judged(found.told.effects, found.model)  # as commands that can be typed here
                say("writing the report")
                page = report.html_report(found, str(output), asked)
            told, made = found.told, found.model
    make_folder(output)
    write(report.files_of(output, told, page, made) | {json_path: results.checked(told)})
    for note in told.warnings:
        if "isolated spike" not in note:
            out.print(f"note: {note}", style="yellow")
    if isinstance(told, results.SteadyDiagnosis):
        _print_steady(told)
    elif isinstance(told, results.BoardDiagnosis):
        for line in (report.board_verdict(told), *(one.text for one in told.effects)):
            out.print(line)
    else:
        _print_diagnosis(told, report.verdict(told))
    out.print(f"-> {output / 'report.html'}", soft_wrap=True)


def _print_steady(told: results.SteadyDiagnosis) -> None:
    table = Table(*report.HEADER)
    for row in report.candidate_rows(told):
        table.add_row(*row)
    out.print(f"before: {told.baseline.rmse_c:.2f} K rms, frozen model")
    out.print(table)
    for one in told.rivals:
        out.print(f"{one.instead_of} or {one.name}: these numbers cannot tell. {one.separating_experiment}")


def _print_diagnosis(told: results.Diagnosis, verdict: str) -> None:
    out.print(verdict, style="bold")
    if told.effects:
        table = Table("effect", "error, K", "held out, K", "evidence, nats", "numbers", "chip")
        for one in told.effects:
            table.add_row(
                one.called,
                f"{one.rmse_c:.3f}",
                f"{one.holdout_rmse_c:.3f}",
                f"{one.evidence:.0f}",
                "\n".join(f"{k} {report.with_unit(v)}" for k, v in list(one.parameters.items())[:4]),
                "yes" if one.on_chip else "no",
            )
        out.print(table)
    lines = [one.text for one in told.runs_differ]
    lines += [
        f"{one.instead_of} or {one.name}: these data cannot tell. {one.separating_experiment}" for one in told.rivals
    ]
    lines += [f"{what}: {text}" for what, text in report.without_name(told)]
    if told.unexplained:
        lines.append(f"unexplained: {told.residual.note}")
    lines += [f"{one.name} is not exported: {one.why_not_on_chip}" for one in told.effects if one.why_not_on_chip]
    for line in lines:
        out.print(line)
