"""`ninespring couplings`."""

from __future__ import annotations

from pathlib import Path

import click
from rich.table import Table

from ..console import FILE, JSON, Command, beside, checked, result_of, working, write
from ..errors import InputError, WorkError
from ..logs import check_folder
from ..models import model_text, read_array

MESHES = ("coarse", "normal", "fine")


def need(*modules: str) -> None:
    """Refuse where what `ninespring[explore]` installs is not there."""
    import importlib

    for name in modules:
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise WorkError(
                f"{name} is missing ({error}): script/setup installs it in the tree, elsewhere pip install 'ninespring[explore]'"
            ) from None
        except OSError as error:
            raise WorkError(f"{name} does not load ({error}): docs/exploring.md names the system's libraries") from None


@click.command(
    cls=Command,
    epilog="""\b
Examples:
  ninespring couplings array.toml -o model.toml
  ninespring couplings array.toml --mesh fine --json couplings.json -o model.toml
""",
)
@click.argument("array_path", metavar="ARRAY.TOML", type=FILE)
@click.option("--mesh", type=click.Choice(MESHES), default="normal", show_default=True, help="size of the elements")
@click.option("-o", "--output", type=FILE, required=True, help="model.toml to write; - prints it")
@JSON
def couplings(array_path: Path, mesh: str, output: Path, json_path: Path | None) -> None:
    """Reckon loss and couplings of an array from its geometry: a field solution, reduced to the model's numbers.

    What cools it stands in [cooling] of array.toml. Nothing measured goes in: docs/exploring.md says how far that carries.
    """
    check_folder(output)
    array = read_array(array_path)
    from .geometry import geometry_of

    try:
        geometry_of(array)
    except InputError as error:
        raise InputError(error.message, array_path) from None
    need("skfem", "gmsh")
    from .couplings import couplings as find

    with working("meshing") as say:
        found = find(array, mesh, say)
    table = found.model.parameters
    units = {name: one["unit"] for name, one in _parameters(found).items()}
    shown = Table("number", "value", "reduction", "mesh", "unit")
    for name, value in table.items():
        if name in found.lumped.reduction:
            shown.add_row(
                name,
                f"{value:.4g}",
                f"{found.lumped.reduction[name]:.1g}",
                f"{found.mesh_error.get(name, 0.0):.1g}",
                units[name],
            )
    talk = beside(output)
    talk.print(shown)
    spring, part = found.geometry.spring, found.geometry
    lines = [
        f"a coil of {spring.coil_mm:g} mm, {spring.spacing_mm:.3g} mm from turn to turn, conducts into the air like a "
        f"cylinder of {2 * spring.radius_mm:.3g} mm",
        f"between springs two apart, from the field: {1e3 * found.pairs.second:.3f} mW/K"
        + (f", blown {1e3 * found.pairs_blown.second:.3f}" if found.pairs_blown else ""),
        f"network against field, random drive, 15 min: {100 * found.drive_error:.1f} % of the rise, rms",
        f"field: {part.rows} x {part.cols} springs, {found.still.unknowns} unknowns; heat in less heat out "
        f"{100 * max(found.still.balance, found.blown.balance if found.blown else 0.0):.1g} %",
    ]
    for line in lines:
        talk.print(line, soft_wrap=True, markup=False)
    result = result_of(
        "couplings",
        mesh=mesh,
        unknowns=found.still.unknowns,
        cylinder_diameter_mm=2 * spring.radius_mm,
        drive_error=found.drive_error,
        balance_error=found.still.balance,
        second_w_per_k=found.pairs.second,
        second_fan_w_per_k=found.pairs_blown.second if found.pairs_blown else None,
        parameters=_parameters(found),
    )
    write({output: model_text(found.model), json_path: checked(result)})
    if str(output) != "-":
        talk.print(f"-> {output}", soft_wrap=True, markup=False)


def _parameters(found: object) -> dict[str, dict[str, object]]:
    from ..native import parameter_table

    return {
        name: {
            "value": value,
            "unit": parameter_table()[name].unit,
            "reduction_error": found.lumped.reduction.get(name),
            "mesh_error": found.mesh_error.get(name),
        }
        for name, value in found.model.parameters.items()
    }
