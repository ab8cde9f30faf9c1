"""`ninespring export`."""

from __future__ import annotations

from pathlib import Path

import click

from ..console import FILE, JSON, MODEL, Command, checked, out, outcome, write
from ..logs import check_folder, sha256_of


@click.command(
    cls=Command,
    epilog="""\b
Example:
  ninespring export --model diagnosis/model.toml -o settings.txt
""",
)
@MODEL
@click.option("-o", "--output", type=FILE, required=True, help="console lines to write, `$name=value`")
@JSON
def export(model_path: Path, output: Path, json_path: Path | None) -> None:
    """Write the console lines that put a model into the chip.

    Effects of the thermometers, of the surroundings and of the supply are left out: the file says why.
    """
    from .. import native
    from ..effects import WHY_NOT_ON_CHIP
    from ..fit.predict import plant_of
    from ..models import read_model

    check_folder(output, json_path)
    model = read_model(model_path)
    text, message = native.chip_export(plant_of(model))
    left = {e: WHY_NOT_ON_CHIP[e] for e in model.effects if e in WHY_NOT_ON_CHIP}
    settings = dict(line[1:].split("=", 1) for line in text.splitlines())
    result = outcome(
        "export",
        model={"file": model_path.name, "sha256": sha256_of(model_path)},
        settings={name: float(value) for name, value in settings.items()},
        left_out=left,
    )
    head = [f"# from {model_path.name}", *(f"# {e} is left out: {why}" for e, why in left.items())]
    write({output: "\n".join([*head, text]), json_path: checked(result)})
    if message:
        out.print(message, markup=False)
    out.print(f"{len(settings)} settings -> {output} (`ninespring upload` sends them)")
