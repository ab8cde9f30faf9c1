"""`ninespring couplings`."""

from __future__ import annotations

import importlib
from pathlib import Path

import click
from rich.table import Table

from ..errors import InputError, WorkError
from ..explore.couplings import Found
from ..explore.couplings import couplings as find
from ..explore.geometry import geometry_of
from ..io import results
from ..model.models import model_text, read_array
from ..model.native import parameter_table
from .console import FILE, JSON, beside, command, output, working, write

MESHES = ("coarse", "normal", "fine")


def need(*modules: str) -> None:
    """Refuse where what `ninespring[explore]` installs is not there."""
    for name in modules:
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise WorkError(
                f"{name} is missing ({error}): script/setup installs it in the tree, elsewhere pip install '.[explore]' in the source tree"
            ) from None
        except OSError as error:
            raise WorkError(f"{name} does not load ({error}): docs/exploring.md names the system's libraries") from None


@command("""\b
Examples:
  ninespring couplings array.toml -o model.toml
  ninespring couplings array.toml --mesh fine --json couplings.json -o model.toml
""")
@click.argument("array_path", metavar="ARRAY.TOML", type=FILE)
@click.option("--mesh", type=click.Choice(MESHES), default="normal", help="size of the elements")
@output("model.toml to write; - prints it")
@JSON
def couplings(array_path: Path, mesh: results.Elements, output: Path, json_path: Path | None) -> None:
    """Reckon loss and couplings of an array from its geometry: a field solution, reduced to the model's numbers.

    What cools it stands in [cooling] of array.toml. Nothing measured goes in: docs/exploring.md says how far that carries.
    """
    array = read_array(array_path)
    try:
        geometry_of(array)
    except InputError as error:
        raise InputError(error.message, array_path) from None
    need("skfem", "gmsh")
    with working("meshing") as say:
        found = find(array, mesh, say)
    shown = Table("number", "value", "reduction", "mesh", "unit")
    numbers: dict[str, results.Coupling] = {}
    for full, one in _parameters(found).items():
        numbers.setdefault(_found(full), one)
    for name, one in numbers.items():
        if name in found.lumped.reduction:
            errors = f"{one.reduction_error:.1g}", f"{one.mesh_error or 0.0:.1g}"
            shown.add_row(name, f"{one.value:.4g}", *errors, one.unit)
    talk = beside(output)
    talk.print(shown)
    talk.print(
        f"network against field, random drive, 15 min: {100 * found.drive_error:.1f} % of the rise, rms\n"
        f"field: {found.still.unknowns} unknowns; heat in less heat out "
        f"{100 * max(found.still.balance, found.blown.balance if found.blown else 0.0):.1g} %",
        soft_wrap=True,
    )
    result = results.Couplings(
        mesh=mesh,
        unknowns=found.still.unknowns,
        cylinder_diameter_mm=2 * found.geometry.spring.radius_mm,
        drive_error=found.drive_error,
        balance_error=found.still.balance,
        second_w_per_k=found.pairs.second,
        second_fan_w_per_k=found.pairs_blown.second if found.pairs_blown else None,
        parameters=_parameters(found),
    )
    write({output: model_text(found.model), json_path: results.checked(result)})
    if str(output) != "-":
        talk.print(f"-> {output}", soft_wrap=True)


def _found(full: str) -> str:
    """Return what the network calls a parameter of the model: those of single springs are the stiffness layer's."""
    name, _, of_one = full.partition("[")
    return f"stiffness_{name}" if of_one else name


def _parameters(found: Found) -> dict[str, results.Coupling]:
    return {
        name: results.Coupling(
            value=value,
            unit=parameter_table()[name.partition("[")[0]].unit,
            reduction_error=found.lumped.reduction.get(_found(name)),
            mesh_error=found.mesh_error.get(_found(name)),
        )
        for name, value in found.model.parameters.items()
    }
