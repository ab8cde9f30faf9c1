"""`ninespring diagnose`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from rich.table import Table

from ..errors import InputError
from ..export.settings import judged
from ..find import board_alone, diagnosis, steady
from ..find.residual import surrogate as empirical
from ..infer import from_resistance
from ..io.logs import check_folder
from ..model.models import model_text, read_model
from ..say import page as report
from ..say.page import with_unit, without_name
from .console import ARRAY, FILE, IN_A_FOLDER, Command, array_and_runs, checked, out, working, write


@click.command(
    cls=Command,
    epilog="""\b
Examples:
  ninespring diagnose run1.csv run2.csv -o diagnosis
  ninespring diagnose --array array.toml tclab.csv -o diagnosis
  ninespring diagnose --model model.toml --frozen run3.csv -o check
  ninespring diagnose --model model.toml --frozen steady.csv -o steady
""",
)
@click.argument("logs", nargs=-1, required=True, type=FILE)
@ARRAY
@click.option("--model", "model_path", type=FILE, help="model.toml: declared values and effects already on")
@click.option("--frozen", is_flag=True, help="keep the model's values as they are; fit effects only")
@click.option(
    "-o",
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    help="folder for diagnosis.json, report.html, model.toml",
)
@click.option("--json", "json_path", type=FILE, help="write diagnosis.json here too")
@click.option("--surrogate", is_flag=True, help="also try an empirical model of what is left (never exported)")
def diagnose(
    logs: tuple[Path, ...],
    array_path: Path | None,
    model_path: Path | None,
    frozen: bool,
    output: Path,
    json_path: Path | None,
    surrogate: bool,
) -> None:
    """Find the effect that the model lacks: writes diagnosis.json, report.html, model.toml.

    LOGS are logs of one array, or one steady table (docs/files.md). Logs of a board alone, currents and voltages without any
    temperature, are diagnosed from v / i: degrees stay open. Errors are root mean squares in K; evidence is in
    nats, the logarithm of how many times likelier the data are with the effect.
    """
    check_folder(json_path)
    if output.is_dir():
        check_folder(*(output / name for name in IN_A_FOLDER))
    if frozen and not model_path:
        raise InputError("--frozen needs --model")
    model = read_model(model_path) if model_path else None
    steady_table = any(steady.is_steady(path) for path in logs)
    if steady_table:
        if len(logs) > 1:
            raise InputError("give one steady table, or logs")
        with working("fitting") as say:
            result = steady.diagnose_table(logs[0], model, array_path, frozen, say)
        made = steady.model_after(result, model, array_path)
        judged(result["effects"], made)
        page = report.steady_report(result)
    else:
        array, runs = array_and_runs(array_path, logs, model, or_resistance=True)
        alone = from_resistance.has_none(runs)
        if alone and (model_path or surrogate):
            raise InputError("without a thermometer give logs and an array only: no --model, no --surrogate", logs[0])
    if not steady_table and alone:
        with working("fitting v / i") as say:
            result, made = board_alone.diagnose(array, runs, say)
        judged(result["effects"], made)
        page = report.board_report(result, str(output))
    elif not steady_table:
        with working("fitting") as say:
            found = diagnosis.diagnose(array, runs, model=model, frozen=frozen, progress=say)
            if surrogate:
                say("empirical surrogate")
                found.result["surrogate"] = empirical(found.problem, found.final)
            say("writing the report")
            page = report.html_report(found, str(output))
        result, made = found.result, found.model
    text = checked(result)
    files: dict[Path | None, str] = {
        output / "diagnosis.json": text,
        output / "report.html": page,
        output / "model.toml": model_text(made),
        json_path: text,
    }
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made a folder: {error.strerror}", output) from None
    write(files)
    for note in result["warnings"]:
        if "isolated spike" not in note:
            out.print(f"note: {note}", style="yellow", markup=False)
    if "cases" in result:
        steady.print_result(out, result)
    elif result["after"]["rmse_c"] is None:
        for line in (board_alone.verdict(result), *(one["text"] for one in result["effects"])):
            out.print(line, markup=False)
    else:
        _print_diagnosis(result, report.verdict(result))
    out.print(f"-> {output / 'report.html'}", soft_wrap=True)


def _print_diagnosis(result: dict[str, Any], verdict: str) -> None:
    out.print(verdict, style="bold", markup=False)
    if result["effects"]:
        table = Table("effect", "error, K", "held out, K", "evidence, nats", "numbers", "chip")
        for one in result["effects"]:
            numbers = "\n".join(f"{k} {with_unit(v)}" for k, v in list(one["parameters"].items())[:4])
            name = one["name"] + (f" ({one['variant']})" if one.get("variant") else "")
            table.add_row(
                name,
                f"{one['rmse_c']:.3f}",
                f"{one['holdout_rmse_c']:.3f}",
                f"{one['evidence']:.0f}",
                numbers,
                "yes" if one["on_chip"] else "no",
            )
        out.print(table)
    lines = [f"{one['text']} Its own in each run: not in model.toml." for one in result["runs_differ"]]
    lines += [
        f"{one['instead_of']} or {one['name']}: these data cannot tell. {one['separating_experiment']}"
        for one in result["rivals"]
    ]
    lines += [f"{what}: {text}" for what, text in without_name(result)]
    if result["unexplained"]:
        lines.append(f"unexplained: {result['residual']['note']}")
    lines += [
        f"{one['name']} is not exported: {one['why_not_on_chip']}"
        for one in result["effects"]
        if "why_not_on_chip" in one
    ]
    if "surrogate" in result:
        s = result["surrogate"]
        lines.append(
            "empirical surrogate (not physics, never exported): "
            f"held out {s['holdout_before_c']:.3f} -> {s['holdout_after_c']:.3f} K"
        )
    for line in lines:
        out.print(line, markup=False)
