"""`ninespring plot`."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError
from ..infer.predict import predict
from ..io import ranges
from ..io.logs import read_log
from ..model.models import array_of
from ..say import plotting
from .console import ARRAY, FILE, command, model_and_array, notes_of, number, out, output, working, write

PICTURES = (".png", ".svg", ".pdf", ".gif")


@command("""\b
Examples:
  ninespring plot run1.csv -o run1.png
  ninespring plot run1.csv --model diagnosis/model.toml -o run1.svg
  ninespring plot run1.csv -o run1.gif
  ninespring plot run1.csv --at 240 -o array.png
""")
@click.argument("log", type=FILE)
@click.option("--model", "model_path", type=FILE, help="model.toml: what it makes of the log, dashed")
@ARRAY
@number("--at", ranges.PICTURE_S, "s: the array at that time instead, spring by spring; bold: driven")
@output("picture: .png, .svg, .pdf; .gif: the array in motion")
def plot(log: Path, model_path: Path | None, array_path: Path | None, at: float | None, output: Path) -> None:
    """Draw a log: each spring's temperature (degC) and what it was given.

    With --at, and in a .gif, each spring of the array has its number and temperature: in bold while it is driven.
    """
    kind = output.suffix.lower()
    if kind == ".gif" and at is not None:
        raise InputError("--at is one picture: .png, .svg or .pdf", output)
    if kind not in PICTURES:
        raise InputError(f"a picture's name ends in one of {', '.join(PICTURES)}", output)
    model, array = model_and_array(model_path, array_path)
    run = read_log(log, array.springs if array else None, temperatures=False)
    notes_of([run])
    if at is not None and not run.time_s[0] <= at <= run.time_s[-1]:
        raise InputError(f"--at {at:g}: its time_s runs from {run.time_s[0]:g} to {run.time_s[-1]:g} s", log)
    with working("drawing"):
        if kind == ".gif" or at is not None:
            array = array_of(array, [run])
        if array is not None:
            run.layers = array.layers
        if kind == ".gif":
            picture = plotting.animation_of(run, array.rows, array.cols)
        elif at is not None:
            picture = plotting.drawn(plotting.map_at(run, array.rows, array.cols, at), kind)
        else:
            picture = plotting.drawn(plotting.figure(run, predict(model, run) if model else None), kind)
    write({output: picture})
    out.print(f"{len(run.time_s)} rows -> {output}", soft_wrap=True)
