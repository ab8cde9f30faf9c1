"""`ninespring bringup`: the first power-up of a board as a conversation in the terminal."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ..errors import InputError, WorkError
from ..io.board import Board
from ..io.bringup import STEPS, converse
from .console import PORT, command, out, output


@command("""\b
Examples:
  ninespring bringup --port /dev/ttyACM0
  ninespring bringup --port /dev/ttyACM0 --again channels
  ninespring-sim board --without-springs --wiring addresses=3,4     # a board to try it at
""")
@PORT
@output("page to write; beside it a .json, from which the next conversation goes on", default=Path("bringup.html"))
@click.option("--again", metavar="STEP", help="from this step on, though it was right before")
@click.option("--yes", is_flag=True, help="ask nothing: for scripts; what only a hand or an eye can tell is left out")
def bringup(port: str, output: Path, again: str | None, yes: bool) -> None:
    """Bring up a new board in a conversation: what to do, what is measured, what is wrong and where, in the order of docs/building.md.

    Steps: board, sensors, supply, channels (on resistors of 0.22 ohm), air, spring, springs. A step that was right before is left out. Ends
    with 1 at the first step in which something is wrong: mend it and type the same again. No setting is saved; what the board
    has learnt of its springs is forgotten before the first one, as resistors have stood there.
    """
    if not yes and not sys.stdin.isatty():
        raise InputError("it asks before each step, and nobody can answer here: give --yes")

    def hands(question: str) -> bool:
        return click.confirm(f"{question}?", default=True)

    def say(line: str) -> None:
        out.print(line, soft_wrap=True)

    with Board(port) as board:
        done = converse(board, output, None if yes else hands, say, again)
    for name, step in done.items():
        if not step.passed:
            raise WorkError(
                f"{STEPS[name].title}: {'; '.join(step.found)}. Told in {output}: mend it, then the same again"
            )
    left = [one for one in STEPS if one not in done]
    next_one = f"; next: {STEPS[left[0]].title.lower()}" if left else ""
    out.print(f"\n{len(done)} of {len(STEPS)} steps are right -> {output}{next_one}")
