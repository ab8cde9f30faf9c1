"""`ninespring schema`."""

from __future__ import annotations

import click

from ..io import results
from .console import command


@command("""\b
Example:
  ninespring schema diagnosis > diagnosis.schema.json
""")
@click.argument("of", type=click.Choice(list(results.SCHEMAS)))
def schema(of: str) -> None:
    """Print the JSON Schema of diagnosis.json, or of the other results that --json writes: fields, units, ranges."""
    click.echo(results.schema(of), nl=False)
