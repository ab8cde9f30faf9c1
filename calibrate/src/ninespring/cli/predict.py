"""`ninespring predict` and `ninespring replay`."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from rich.table import Table

from .. import __version__
from ..find import plausibility
from ..infer import predict as prediction
from ..io import results
from ..io.logs import log_text
from ..io.statistics import rms_there
from ..model import effects
from ..model.models import read_model
from .console import FILE, JSON, MODEL, beside, command, log_of, logs_of, notes_of, output, source_of, working, write


@command("""\b
Examples:
  ninespring predict --model diagnosis/model.toml run3.csv -o predicted.csv
  ninespring predict --chip --model diagnosis/model.toml run3.csv -o predicted.csv
""")
@click.argument("log", type=FILE)
@MODEL
@output("log to write: time_s (s), t1_c..tn_c (degC)")
@click.option("--chip", is_flag=True, help="by the on-chip fixed-point model instead of the plant")
@JSON
def predict(log: Path, model_path: Path, output: Path, chip: bool, json_path: Path | None) -> None:
    """Predict the temperatures of a log, and tell the error where it has some.

    The array is the model's; the log needs no temperatures, and starts at the first ones where it has them.
    """
    model = read_model(model_path)
    run = log_of(model, log, temperatures=False)
    run.notes += plausibility.swapped([run]) + plausibility.undriven_but_hottest(run)
    run = prediction.in_its_room(model, run)
    notes_of([run])
    with working("simulating"):
        shown = prediction.predict(model, run, chip)
    columns = {f"t{k + 1}_c": shown[:, k] for k in range(run.springs)}
    left = shown - run.temperature_c
    rmse, each = rms_there(left), [rms_there(one) for one in left.T]
    note = model.provenance.get("note")
    keys = {"tool": f"ninespring {__version__} predict", "model": model_path.name}
    result = results.Predict(
        logs=logs_of([run]),
        model=source_of(model_path),
        by="chip" if chip else "plant",
        rows=len(run.time_s),
        rmse_c=rmse,
        rmse_per_spring_c=each,
        note=note or results.UNSET,
    )
    write({output: log_text(run.time_s, columns, keys), json_path: results.checked(result)})
    beside(output).print(
        f"{len(run.time_s)} rows" + ("" if rmse is None else f", error {rmse:.3f} K rms") + f" -> {output}"
    )
    if note:
        beside(output).print(f"note: {note}")


@command("""\b
Examples:
  ninespring replay --model diagnosis/model.toml run3.csv -o replay.csv
""")
@click.argument("log", type=FILE)
@MODEL
@output("log to write, with m1_c, x1, ... of the chip's model")
@JSON
def replay(log: Path, model_path: Path, output: Path, json_path: Path | None) -> None:
    """Drive the on-chip fixed-point model with a measured log, and tell its error spring by spring.

    m1_c is what the chip believes, x1 its austenite; y1_c is what the model's sensors would make of m1_c.
    """
    model = read_model(model_path)
    run = prediction.in_its_room(model, log_of(model, log, temperatures=False))
    notes_of([run])
    lines, left_out = prediction.chip_lines(model)
    believed, austenite = prediction.chip_trace(model, lines, run)
    shown = prediction.predict_by_chip(model, lines, run)
    through_sensors = any(effect in effects.MEASUREMENT for effect in model.effects)
    columns: dict[str, np.ndarray] = {}
    for k in range(run.springs):
        given = {"i{}_a": run.current_a, "v{}_v": run.voltage_v, "t{}_c": run.temperature_c}
        given |= {"u{}": run.drive} if run.mode == "command" else {}
        given |= {"m{}_c": believed, "x{}": austenite} | ({"y{}_c": shown} if through_sensors else {})
        columns |= {name.format(k + 1): values[:, k] for name, values in given.items() if values is not None}
    columns["fan"] = run.fan
    if run.ambient_c is not None:
        columns["ambient_c"] = run.ambient_c
    left, seen_left = believed - run.temperature_c, shown - run.temperature_c
    springs = [
        results.Replayed(
            spring=k + 1,
            samples=int(np.isfinite(one).sum()),
            rmse_c=rms_there(one),
            mean_error_c=float(np.nanmean(one)) if np.isfinite(one).any() else None,
            largest_error_c=float(np.nanmax(np.abs(one))) if np.isfinite(one).any() else None,
            shown_rmse_c=rms_there(seen_left[:, k]),
        )
        for k, one in enumerate(left.T)
    ]
    result = results.Replay(
        logs=logs_of([run]),
        model=source_of(model_path),
        rows=len(run.time_s),
        duration_s=run.duration_s,
        rmse_c=rms_there(left),
        shown_rmse_c=rms_there(seen_left),
        left_out=left_out,
        springs=springs,
    )
    keys = {"tool": f"ninespring {__version__} replay", "model": model_path.name}
    write({output: log_text(run.time_s, columns, keys), json_path: results.checked(result)})
    table = Table(
        "spring", "samples", "rms, K", "mean, K", "largest, K", *(["seen by the sensors, rms, K"] * through_sensors)
    )
    for one in springs:
        numbers = [one.rmse_c, one.mean_error_c, one.largest_error_c, one.shown_rmse_c]
        cells = ["-" if value is None else f"{value:.3f}" for value in numbers[: 3 + through_sensors]]
        table.add_row(str(one.spring), str(one.samples), *cells)
    said = beside(output)
    said.print(table)
    rms = result.rmse_c
    said.print("the log holds no temperature to compare with" if rms is None else f"all: {rms:.3f} K rms")
    if left_out:
        said.print(left_out)
