"""`ninespring scenario`: a model.toml as a scenario for `ninespring-sim run`."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError
from ..export.settings import FIRMWARE_EFFECTS
from ..io import ranges
from ..model.models import Model, pattern_of, read_model
from ..model.simulate import array_parameters, board_settings
from .console import MODEL, beside, command, number, output, write

LONGEST = 190
"""Characters of a line of a scenario, nearly."""


@command("""\b
Examples:
  ninespring scenario --model model.toml --pattern 111101111 -o run.ini
  ninespring scenario --model stack.toml --pattern 111101111/000010000 --fan 100 -o run.ini
  ninespring-sim run run.ini -o run.csv
""")
@MODEL
@click.option(
    "--pattern", help="springs that are on from 1 s: 111101111; of two layers elongation/stiffness; default: none"
)
@number("--fan", ranges.FAN_PERCENT, "percent", 0)
@number("--duration", ranges.SCENARIO_S, "s", 300.0)
@output("scenario.ini to write; - prints it")
def scenario(model_path: Path, pattern: str | None, fan: int, duration: float, output: Path) -> None:
    """Write a model as a scenario that `ninespring-sim run` runs: its array, boards and numbers, and one pattern.

    Edit it as you like: docs/files.md has the words.
    """
    model = read_model(model_path)
    on = pattern_of(pattern, model.array) if pattern is not None else [False] * model.array.springs
    if len(model.array.parts) == 1 and model.array.springs > 64:
        raise InputError("more than 64 springs on a board: give [array] board_rows and board_cols", model_path)
    write({output: scenario_text(model, on, pattern or "", fan, duration)})
    beside(output).print(f"-> {output} (`ninespring-sim run` runs it)", soft_wrap=True)


def scenario_text(model: Model, on: list[bool], pattern: str, fan: int, duration_s: float) -> str:
    """Return scenario.ini: the model's plant under boards that are told its numbers."""
    array = model.array
    shifted = ("transformation_shift",) if (array.stiffness or {}).get("transformation_shift_k") else ()
    # what every NiTi spring does, whether a model was fitted where it shows or not
    effects = dict.fromkeys((*model.effects, *FIRMWARE_EFFECTS, *shifted))
    lines = ["[scenario]", f"duration_s = {duration_s:g}", "policy = precompensate", "[array]"]
    lines += [f"rows = {array.rows}", f"cols = {array.cols}"]
    lines += ["layers = 2"] if array.layers == 2 else []
    if array.board:
        lines += [f"board_rows = {array.board[0]}", f"board_cols = {array.board[1]}"]
    lines += ["[plant]", "effects = " + ",\n    ".join(effects)]
    values = array_parameters(array) | model.parameters
    lines += [f"{name} = {value:.7g}" for name, value in values.items()]
    if settings := board_settings(array):
        lines += ["[chip]", *(f"{name} = {value:.3f}" for name, value in settings.items())]
    for board, own in array.boards.items():
        lines += [f"[board.{board}]", *(f"{key} = {value:g}" for key, value in own.items())]
    lines += ["[events]", f"at 0 = fan {fan}"]
    if len(pattern) > LONGEST:
        lines += [f"at 1 = on {k + 1}" for k, one in enumerate(on) if one]
    elif pattern:
        lines.append(f"at 1 = pattern {pattern}")
    return "\n".join([f"; from {Path(model.name).name}, by `ninespring scenario`", *lines, ""])
