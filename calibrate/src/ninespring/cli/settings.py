"""`ninespring settings`: a board's settings as a file, what differs, and what it had."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError
from ..io import history as kept
from ..io.board import Board, read_settings
from ..model import tables
from .console import FILE, PORT, command, out, output, write


@click.group()
def settings() -> None:
    """A board's settings: as a file, what differs between two, what it had before each upload."""


def _of_port(port: str) -> tuple[str, dict[str, str]]:
    with Board(port, off_at_end=False) as board:
        return board.version[0], board.settings()


@command(
    """\b
Example:
  ninespring settings read --port /dev/ttyACM0 -o board.txt
""",
    of=settings,
)
@PORT
@output("file to write; - prints it", default=Path("-"))
def read(port: str, output: Path) -> None:
    """Write a board's settings as console lines, one a line and in the board's order: two such files diff, `upload` takes one.

    Behind each stands what is built in, where it is another.
    """
    version, has = _of_port(port)
    lines = []
    for name, value in has.items():
        row = tables.setting(name)  # None: this version does not know it
        usual = f"{row.default:.{row.decimals}f}" if row else ""
        same = bool(usual) and float(usual) == float(value)
        lines.append(f"${name}={value}" + (f"  # built in: {usual}" if usual and not same else ""))
    write({output: "\n".join([f"# from {port}: {version}", *lines]) + "\n"})
    if str(output) != "-":
        out.print(f"{len(lines)} settings -> {output}", soft_wrap=True)


@command(
    """\b
Examples:
  ninespring settings diff before.txt after.txt
  ninespring settings diff board.txt --port /dev/ttyACM0
""",
    of=settings,
)
@click.argument("files", nargs=-1, type=FILE, required=True)
@click.option("--port", help="serial port of a board: what it has now is the second")
def diff(files: tuple[Path, ...], port: str | None) -> None:
    """Say which settings differ between two files, or a file and a board; what only one of them has is not compared but counted.

    Exit code 1 where some differ.
    """
    if len(files) + (port is not None) != 2:
        raise InputError("give two files, or one file and --port")
    first = read_settings(files[0])
    second = _of_port(port)[1] if port else read_settings(files[1])
    apart = {name for name in first.keys() & second.keys() if float(first[name]) != float(second[name])}
    for name in first:
        if name in apart:
            out.print(f"${name}: {first[name]} -> {second[name]}")
    for here, there, where in ((first, second, files[0]), (second, first, port or files[-1])):
        if count := len(here.keys() - there.keys()):
            out.print(f"{count} only in {where}")
    out.print(f"{len(apart)} of {len(first.keys() & second.keys())} differ")
    if apart:
        raise click.exceptions.Exit(1)


@command(
    """\b
Example:
  ninespring settings history --port /dev/ttyACM0
""",
    of=settings,
)
@PORT
def history(port: str) -> None:
    """Say what a board had before each upload from this computer, and in which file that is kept.

    `ninespring upload --undo` takes the last one back. A board is known again by its USB serial number, else by its port.
    """
    found = kept.entries(port)
    for one in found:
        out.print(f"{one.when}  {one.by}: {len(one.sent)} sent, {len(one.words())} changed")
        for line in one.words():
            out.print(f"    {line}")
        out.print(f"    what it had: {one.path}", soft_wrap=True)
    if not found:
        out.print(f"no upload to the board at {port} is kept on this computer")
