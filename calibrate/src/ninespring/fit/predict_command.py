"""`ninespring predict`."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from ..console import FILE, JSON, MODEL, Command, beside, checked, logs_of, notes_of, result_of, working, write
from ..logs import check_folder, log_text, read_log, sha256_of


@click.command(
    cls=Command,
    epilog="""\b
Examples:
  ninespring predict --model diagnosis/model.toml run3.csv -o predicted.csv
  ninespring predict --chip --model diagnosis/model.toml run3.csv -o predicted.csv
""",
)
@click.argument("log", type=FILE)
@MODEL
@click.option("-o", "--output", type=FILE, required=True, help="log to write: time_s (s), t1_c..tn_c (degC)")
@click.option("--chip", is_flag=True, help="by the on-chip fixed-point model instead of the plant")
@JSON
def predict(log: Path, model_path: Path, output: Path, chip: bool, json_path: Path | None) -> None:
    """Predict the temperatures of a log, and tell the error where it has some.

    The array is the model's; the log needs no temperatures, and starts at the first ones where it has them.
    """
    from ..models import read_model
    from ..verdict import plausibility
    from . import predict as prediction

    check_folder(output, json_path)
    model = read_model(model_path)
    array = model.array
    run = read_log(log, array.springs, temperatures=False, why=f"{model_path.name} is of {array.rows} x {array.cols}")
    run.notes += plausibility.swapped([run]) + plausibility.undriven_but_hottest(run)
    notes_of([run])
    with working("simulating"):
        shown = prediction.predict(model, run, chip)
    columns = {f"t{k + 1}_c": shown[:, k] for k in range(run.springs)}
    square = (run.temperature_c - shown) ** 2
    seen = np.isfinite(square)
    rmse = float(np.sqrt(square[seen].mean())) if seen.any() else None
    each = [float(np.sqrt(square[seen[:, k], k].mean())) if seen[:, k].any() else None for k in range(run.springs)]
    note = model.provenance.get("note")
    result = result_of(
        "predict",
        logs=logs_of([run]),
        model={"file": model_path.name, "sha256": sha256_of(model_path)},
        by="chip" if chip else "plant",
        rows=len(run.time_s),
        rmse_c=rmse,
        rmse_per_spring_c=each,
        **({"note": note} if note else {}),
    )
    write({output: log_text(run.time_s, columns), json_path: checked(result)})
    beside(output).print(
        f"{len(run.time_s)} rows" + ("" if rmse is None else f", error {rmse:.3f} K rms") + f" -> {output}"
    )
    if note:
        beside(output).print(f"note: {note}", markup=False)
