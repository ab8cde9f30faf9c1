"""What all commands share: consoles, options, how a result is written."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

import click
import jsonschema
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from . import __version__
from .errors import InputError
from .logs import write_atomically

WIDE = 160
"""Columns of a table that goes to a file or a pipe."""

out = Console(highlight=False, width=None if sys.stdout.isatty() else WIDE)
err = Console(stderr=True, highlight=False, width=None if sys.stderr.isatty() else WIDE)
FILE = click.Path(dir_okay=False, path_type=Path)
JSON = click.option("--json", "json_path", type=FILE, help="write the result for programs")
PORT = click.option("--port", required=True, help="serial port, e.g. /dev/ttyACM0; 115200 baud")
OUTPUTS = ("output", "json_path")
"""Parameters of commands that name files to write; every other path is an input."""
IN_A_FOLDER = ("diagnosis.json", "report.html", "model.toml")
"""What is written where the output is a folder."""


class Command(click.Command):
    """A command that never writes over what it reads, nor two results into one file."""

    def invoke(self, ctx: click.Context) -> Any:
        """Compare the command's paths before any work is done."""
        written: list[Path] = []
        read: list[Path] = []
        for name, value in ctx.params.items():
            paths = [Path(one) for one in (value if isinstance(value, tuple) else (value,)) if _names_a_file(one)]
            if name in OUTPUTS:
                written += [path / one for path in paths for one in IN_A_FOLDER] if _is_folder(ctx, name) else paths
            else:
                read += paths
        for number, path in enumerate(written):
            if str(path) == "-" or (path.exists() and not path.is_file()):
                continue  # standard output, a device
            for other in read:
                if _same(path, other):
                    raise InputError("would be written over, and it is read: give the result another name", path)
            if any(_same(path, other) for other in written[:number]):
                raise InputError("two results cannot be written into one file", path)
        return super().invoke(ctx)


def _names_a_file(value: Any) -> bool:
    return isinstance(value, Path) or (isinstance(value, str) and Path(value).is_file())


def _is_folder(ctx: click.Context, name: str) -> bool:
    kinds = {one.name: one.type for one in ctx.command.params}
    return isinstance(kinds[name], click.Path) and not kinds[name].file_okay


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return os.path.samefile(one, other)
    return one.resolve() == other.resolve()


class Group(click.Group):
    """The commands."""

    command_class = Command


@contextmanager
def working(text: str, total: float | None = None) -> Iterator[Callable[..., None]]:
    """Show that work goes on, on the terminal's error stream: say(words), say(words, done) with a total."""
    with Progress(
        SpinnerColumn(),
        *(() if total is None else (BarColumn(),)),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=err,
        transient=True,
        disable=not err.is_terminal,
    ) as progress:
        task = progress.add_task(text, total=total)
        yield lambda now, done=None: progress.update(task, description=now, completed=done)


def checked(data: Mapping[str, Any]) -> str:
    """Return a command's result as JSON text, held to its schema (results.schema.json, diagnosis.schema.json)."""
    name = "diagnosis" if str(data.get("schema", "")).startswith("ninespring.diagnosis/") else "results"
    schema = json.loads((resources.files("ninespring") / f"{name}.schema.json").read_text("utf-8"))
    jsonschema.validate(data, schema)
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def result_of(name: str, **more: Any) -> dict[str, Any]:
    """Return a command's result for programs, with what wrote it."""
    return {"schema": f"ninespring.{name}/1", "tool": f"ninespring {__version__}"} | more


def write(files: Mapping[Path | None, str]) -> None:
    """Write a command's files, all or none as far as a file system goes; a file named None is not wanted."""
    write_atomically({path: text for path, text in files.items() if path})
