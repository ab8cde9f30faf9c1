"""`ninespring export` and `ninespring verify`."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError, WorkError
from ..export.drive import checked_settings
from ..export.settings import left_out, together
from ..infer.predict import chip_errors, refuse_seen
from ..io import results
from ..io.board import Board, as_lines, read_settings
from ..io.logs import check_folder, read_bytes
from ..model import tables
from ..model.models import Model, model_of_layer, read_model
from ..model.stiffness import LAYERS
from ..say.page import with_verification
from .console import (
    FILE,
    JSON,
    MODEL,
    beside,
    command,
    log_of,
    logs_of,
    notes_of,
    out,
    output,
    source_of,
    working,
    write,
)

CHIP = click.option(
    "--chip",
    "chip_path",
    type=FILE,
    help="what the board has now, the lines that `$$` prints; left out: the firmware's defaults",
)
LAYER = click.option(
    "--layer", type=click.Choice(LAYERS), help="of a model with a stiffness layer: whose board it is, a board for each"
)


def _model(path: Path, layer: str | None) -> Model:
    model = read_model(path)
    if layer:
        return model_of_layer(model, layer)
    if model.array.layers > 1:
        raise InputError("a stiffness layer, and a board is of one: say --layer elongation or --layer stiffness", path)
    return model


def _chip_lines(path: Path | None) -> str:
    if not path:
        return ""
    has = read_settings(path)
    for name, value in has.items():
        one = tables.setting(name)
        if one is None:
            raise InputError(f"{has.places[name]}the chip has no setting '{name}'")
        if not one.minimum <= float(value) <= one.maximum:
            within = f"{one.minimum:g} to {one.maximum:g} {one.unit}".strip()
            raise InputError(f"{has.places[name]}{name} is {value}; it must be {within}")
    return as_lines(has)


@command("""\b
Examples:
  ninespring export --model diagnosis/model.toml -o settings.txt
  ninespring export --model diagnosis/model.toml --chip now.txt -o -
""")
@MODEL
@output("console lines to write, `$name=value`; - prints them")
@CHIP
@LAYER
@click.option(
    "--force",
    "doubted",
    is_flag=True,
    help="write even settings of a doubted log, or that drive worse than the board's own",
)
@JSON
def export(
    model_path: Path, output: Path, chip_path: Path | None, layer: str | None, doubted: bool, json_path: Path | None
) -> None:
    """Write the console lines that put a model into the chip.

    Only what the logs determined is written: the rest stays as the chip has it, and the file says which and why. Before
    writing, arrays like the model's are driven with the old and the new settings, and settings with which springs hold
    less, heat later, get hotter than transforming takes or disturb the ones that are off are refused. So is a model of a log
    that the diagnosis doubted.
    """
    model = _model(model_path, layer)
    doubts = list(model.provenance.get("doubts", []))
    with working("driving the old and the new settings") as say:
        made, worse, drives = checked_settings(model, _chip_lines(chip_path), doubted, say)
    left = left_out(model)
    head = [
        f"# from {model_path.name}, by `ninespring export`",
        *(f"# doubted, written by --force: {one}" for one in doubts),
        *(f"# worse, written by --force: {one}" for one in worse),
        *(f"# {e} is left out: {why}" for e, why in left.items()),
        *(f"# not written, {why}: {', '.join(names)}" for why, names in together(made.kept, made.written).items()),
    ]
    result = results.Export(
        model=source_of(model_path),
        settings={name: float(value) for name, value in made.written.items()},
        kept=made.kept,
        left_out=left,
        worse=worse,
        drives=drives,
    )
    write({output: "\n".join([*head, made.lines]), json_path: results.checked(result)})
    said = beside(output)
    if made.remarks:
        said.print(made.remarks)
    for line in head[1:]:
        said.print(line[2:])
    said.print(f"{len(made.written)} settings -> {output} (`ninespring upload` sends them)")


@command("""\b
Examples:
  ninespring verify --model diagnosis/model.toml run3.csv --report diagnosis/report.html
  ninespring verify --model diagnosis/model.toml --port /dev/ttyACM0 run3.csv
""")
@click.argument("log", type=FILE)
@MODEL
@CHIP
@LAYER
@click.option("--port", help="serial port of the board: what it has now is the 'before'")
@click.option("--report", "report_path", type=FILE, help="report.html of the diagnosis: put before and after into it")
@JSON
def verify(
    log: Path,
    model_path: Path,
    chip_path: Path | None,
    layer: str | None,
    port: str | None,
    report_path: Path | None,
    json_path: Path | None,
) -> None:
    """Tell the chip's error before and after, on a log that the fit never saw.

    Before: the settings that the board has (--port, --chip) or the firmware's defaults. After: with what `export` writes
    of the model over them.
    """
    check_folder(report_path)
    report = read_bytes(report_path).decode("utf-8", "replace") if report_path else ""
    if report and "</main>" not in report:
        raise InputError("is no report of `ninespring diagnose`", report_path)
    if port and chip_path:
        raise InputError("give either --port or --chip: what the board has now")
    model = _model(model_path, layer)
    run = log_of(model, log)
    refuse_seen(model, run)
    notes_of([run])
    old = _port_lines(port) if port else _chip_lines(chip_path)
    before, after = chip_errors(model, old, [run])
    result = results.Verify(logs=logs_of([run]), model=source_of(model_path), before=before, after=after)
    write({json_path: results.checked(result), report_path: with_verification(report, result)})
    out.print(
        f"the chip's model on {log.name}: error {result.before.rmse_c:.2f} K rms as it is, "
        f"{result.after.rmse_c:.2f} K with the model's settings"
    )
    if result.after.rmse_c > result.before.rmse_c:
        raise WorkError("the model's settings make the chip's error larger on this log: do not upload them")


def _port_lines(port: str) -> str:
    with Board(port, off_at_end=False) as board:
        return as_lines(board.settings())
