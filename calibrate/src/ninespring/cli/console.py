"""What all commands share: consoles, options, how a result is written."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from ..errors import DECIMAL_COMMA, InputError
from ..io import results
from ..io.logs import Run, check_folder, read_log, sha256_of, write_atomically
from ..io.ranges import Range
from ..model.models import Array, Model, array_of, read_array, read_model

WIDE = 160
"""Columns of a table that goes to a file or a pipe."""
FEWEST_ROWS = 50
"""Logs with fewer rows than this, all together, are no measurement to fit to."""

out = Console(markup=False, highlight=False, width=None if sys.stdout.isatty() else WIDE)
err = Console(stderr=True, markup=False, highlight=False, width=None if sys.stderr.isatty() else WIDE)
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
JSON = click.option("--json", "json_path", type=FILE, help="write the result for programs")
ARRAY = click.option(
    "--array", "array_path", type=FILE, help="array.toml; left out: a square (or 1 x 2) of the paper's spring"
)
MODEL = click.option("--model", "model_path", type=FILE, required=True, help="model.toml that fit or diagnose wrote")
PORT = click.option("--port", required=True, help="serial port, e.g. /dev/ttyACM0; 115200 baud")
FORCE = click.option("--force", is_flag=True, help="write over a file that is there, whatever it is")
"""Of commands whose output was measured: without it that takes no file's place."""
Decorator = Callable[[Callable[..., None]], Callable[..., None]]
OUTPUTS = ("output", "json_path")
"""Parameters of commands that name files to write; every other path is an input."""


class Command(click.Command):
    """A command that refuses, before any work, what could not be written, and never writes over what it reads."""

    def invoke(self, ctx: click.Context) -> Any:
        """Compare the command's paths, and look at what would be written."""
        written: list[Path] = []
        read: list[Path] = []
        kinds = {one.name: one.type for one in self.params}
        for name, value in ctx.params.items():
            paths = [Path(one) for one in (value if isinstance(value, tuple) else (value,)) if _names_a_file(one)]
            if name not in OUTPUTS:
                read += paths
            elif kinds[name] is FOLDER:
                written += [path / one for path in paths if path.is_dir() for one in results.FILES]
            else:
                written += paths
        for number, path in enumerate(written):
            if str(path) == "-" or (path.exists() and not path.is_file()):
                continue  # standard output, a device
            for other in read:
                if _same(path, other):
                    raise InputError("would be written over, and it is read: give the result another name", path)
            if any(_same(path, other) for other in written[:number]):
                raise InputError("two results cannot be written into one file", path)
        for path in written:
            measured = "force" in ctx.params and path == ctx.params["output"]
            check_folder(path, measured=measured, force=measured and ctx.params["force"])
        return super().invoke(ctx)


def command(
    epilog: str, name: str | None = None, of: click.Group | None = None
) -> Callable[[Callable[..., None]], click.Command]:
    """Return what makes a function a command, of a group where it is one of several: its examples stand below its options."""
    return (of.command if of else click.command)(name, cls=Command, epilog=epilog + "\n")


def _names_a_file(value: Any) -> bool:
    return isinstance(value, Path) or (isinstance(value, str) and Path(value).is_file())


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return os.path.samefile(one, other)
    return one.resolve() == other.resolve()


class Real(click.FloatRange):
    """An option's number: finite, and in its range."""

    name = "number"

    def __init__(self, within: Range) -> None:
        super().__init__(within.low, within.high, min_open=within.above)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number; a comparison with NaN is never true, so that the range alone would let it through."""
        if re.search(r"\d,\d", str(value)):
            self.fail(f"{value} is no number: {DECIMAL_COMMA}", param, ctx)
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return number


class Whole(click.IntRange):
    """An option's whole number, in its range."""

    name = "whole number"

    def __init__(self, within: Range) -> None:
        super().__init__(int(within.low), int(within.high))


def number(name: str, within: Range, says: str, default: float | None = None) -> Decorator:
    """Return an option that takes a number of a range."""
    return click.option(name, type=Whole(within) if within.whole else Real(within), default=default, help=says)


def output(says: str, kind: click.Path = FILE, default: Path | None = None) -> Decorator:
    """Return the option that names what is written: a file, or a folder."""
    # a default of None is one that was given, to click 8.3 and later: then nothing is required
    given = {"required": True} if default is None else {"default": default}
    return click.option("-o", "--output", type=kind, help=says, **given)


@contextmanager
def working(text: str, total: float | None = None) -> Iterator[Callable[..., None]]:
    """Show that work goes on, on the terminal's error stream: say(words), say(words, done) with a total."""
    with Progress(
        SpinnerColumn(),
        *(() if total is None else (BarColumn(), TimeRemainingColumn())),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=err,
        transient=True,
        disable=not err.is_terminal,
    ) as progress:
        task = progress.add_task(text, total=total)
        yield lambda now, done=None: progress.update(task, description=now, completed=done)


def write(files: Mapping[Path | None, str | bytes], force: bool = False) -> None:
    """Write a command's files, all or none as far as a file system goes; a file named None is not wanted."""
    write_atomically({path: text for path, text in files.items() if path}, force)


def make_folder(path: Path) -> None:
    """Make a folder, with those that it lies in, unless it is there."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made a folder: {error.strerror}", path) from None


def model_and_array(model_path: Path | None, array_path: Path | None) -> tuple[Model | None, Array | None]:
    """Return a command's model, and its array: the model's, else that of array.toml; None where neither is given."""
    model = read_model(model_path) if model_path else None
    return model, model.array if model else read_array(array_path) if array_path else None


def log_of(model: Model, log: Path, temperatures: bool = True) -> Run:
    """Return a log of a model's array."""
    array = model.array
    why = f"{Path(model.name).name} is of {array.rows} x {array.cols}"
    return read_log(log, array.springs, temperatures, why)


def two_ports(port: str | None, thermometers: str | None) -> None:
    """Refuse a board and a logger of temperatures at one port."""
    if port and thermometers and os.path.realpath(thermometers) == os.path.realpath(port):
        raise InputError(f"--thermometers {thermometers}: that is the board's port, a logger has its own")


def array_and_runs(array: Array | None, logs: tuple[Path, ...]) -> tuple[Array, list[Run]]:
    """Read logs of one array, with temperatures or with voltages; refuse what does not go together or is no measurement."""
    runs = [read_log(path, array.springs if array else None, or_resistance=True) for path in logs]
    array = array_of(array, runs)
    if len({bool(np.isfinite(run.temperature_c).any()) for run in runs}) > 1:
        raise InputError("some of these logs have temperatures and others none: give one kind at a time", logs[0])
    modes = {run.mode for run in runs}
    if len(modes) > 1:
        raise InputError(f"the logs are driven by {' and '.join(sorted(modes))}: diagnose one kind at a time")
    if (rows := sum(len(run.time_s) for run in runs)) < FEWEST_ROWS:
        raise InputError(f"{rows} rows are too few to fit to: log some minutes (docs/calibrating.md)", runs[0].name)
    if not any(np.any(run.drive) for run in runs):
        raise InputError(
            "no spring is ever driven: log what the springs were given (i1_a ... or u1 ...)", runs[0].name, 1
        )
    return array, runs


def notes_of(runs: list[Run]) -> None:
    """Print what was mended of logs, and what is doubted."""
    for run in runs:
        notes(f"{Path(run.name).name}: ", run.notes)


def notes(where: str, lines: list[str]) -> None:
    """Print lines about the data, each behind `where`."""
    for note in lines:
        err.print(where + note, style="yellow")


def beside(output: Path) -> Console:
    """Return where to talk: standard output, unless the result itself goes there."""
    return err if str(output) == "-" else out


def logs_of(runs: Sequence[Run]) -> list[results.Log]:
    """Return which logs a result is from."""
    return [results.Log(file=Path(r.name).name, sha256=r.sha256, rows=len(r.time_s), notes=list(r.notes)) for r in runs]


def source_of(path: Path) -> results.Source:
    """Return which file a result is from."""
    return results.Source(file=path.name, sha256=sha256_of(path))


def print_parameters(console: Console, parameters: results.Parameters) -> None:
    """Print a table of numbers."""
    table = Table("number", "value", "standard error", "in 95 of 100 cases", "unit", "")
    for name, one in parameters.items():
        error = "-" if one.stderr is None else f"{one.stderr:.2g}"
        ends = "{:.4g} .. {:.4g}".format(*one.interval_95) if one.interval_95 else "-"
        table.add_row(name, f"{one.value:.5g}", error, ends, one.unit, one.note or "")
    console.print(table)
