"""Recording a tape: all that a board is given, tick by tick, for `ninespring-sim rerun` (docs/files.md)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from ..errors import RefusedError, WorkError
from .board import CLOCK, Board
from .recording import SILENT_S, LogFile, Recording, Step, switched_off_after, write_end, write_head

TICK_S = 0.02
COUNTED = 1 << 16
"""Ticks are numbered modulo this."""


def record_tape(
    board: Board,
    log: LogFile,
    duration_s: float,
    steps: Sequence[Step] = (),
    say: Callable[[int, float], None] = lambda ticks, seconds: None,
    keys: Mapping[str, str] | None = None,
    remark: Callable[[str], None] = lambda words: None,
) -> Recording:
    """Record so many seconds by the board's clock.

    The board begins anew: what it knows of its springs it forgets, but for what it has learnt of them. Steps without a time
    are sent when the tape has begun. Whatever ends it, the springs are off afterwards.
    """
    got, steps = Recording(), list(steps)
    last, lost, lost_s, time_s, no_ticks = None, 0, 0.0, 0.0, 0
    with switched_off_after(board, got):
        board.guard(write_head(board, log, keys or {}))
        try:
            board.ask("telemetry inputs", 10.0)
        except RefusedError as error:
            raise WorkError(f"{error}; a tape begins with all springs off and no fault") from None
        while time_s < duration_s:
            line = board.next_line(time.monotonic() + board.patience * SILENT_S)
            if line is None:
                raise WorkError(f"{board.port}: nothing came for {board.patience * SILENT_S:g} s")
            came = CLOCK.match(line)
            no_ticks = 0 if came and came["tick"] else no_ticks + bool(line)
            if no_ticks > SILENT_S / TICK_S:
                raise WorkError(f"{board.port}: {no_ticks} lines in a row that are no ticks of the tape")
            if came and came["tick"]:
                tick = int(came["tick"], 16)
                if last is not None and tick != (last + 1) % COUNTED:
                    lost_s = lost_s if lost else TICK_S * log.rows
                    lost += (tick - last - 1) % COUNTED
                last = tick
                log.write_row(line)
            elif line.startswith("<"):
                log.write(line)
            time_s = TICK_S * log.rows
            say(log.rows, time_s)
            while log.rows and steps and (steps[0].at_s or 0.0) <= time_s < duration_s:
                step = steps.pop(0)
                for words in step.send(board):
                    remark(f"'{step.line}': {words}")
        if lost:
            got.ended = (
                f"{lost} ticks were lost on the way here, the first after {lost_s:.1f} s: the tape tells nothing of what "
                "came after that"
            )
    write_end(log, got)
    return got
