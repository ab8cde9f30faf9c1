"""The commands that talk to a board: record, upload, monitor."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

import click
from rich.live import Live

from ..errors import InputError, WorkError
from ..io import history, ranges, results
from ..io.board import Board, read_settings
from ..io.logs import read_text
from ..io.recording import LogFile, about, script_lines, told_to_stop
from ..io.recording import record as record_board
from ..io.tape import record_tape
from ..io.thermometers import measuring
from ..say.monitoring import Screen
from .console import FILE, FORCE, JSON, PORT, beside, command, err, number, out, output, two_ports, working, write


@command("""\b
Example:
  ninespring record --port /dev/ttyACM0 --hz 1 --duration 900 --run steps.txt -o board1.csv
\b
steps.txt (console words; `at S =` waits until so many seconds after the first row):
  ambient 21.5
  at 5 = pattern 101000101
  at 300 = fan 100
  at 600 = off all
""")
@PORT
@output("log to write; - is standard output")
@number("--hz", ranges.RECORD_HZ, "rows a second", 1)
@number("--duration", ranges.RECORD_S, "s by the board's clock; Ctrl-C ends it earlier", 900.0)
@click.option("--run", "script", type=FILE, help="console lines to send, one a line, each at its time")
@click.option(
    "--tape",
    is_flag=True,
    help="not a log, but all that the board is given, tick by tick: `ninespring-sim rerun` believes the same by it",
)
@click.option("--thermometers", help="port of a thermocouple logger: its temperatures (degC) become t1_c, t2_c, ...")
@FORCE
@JSON
def record(
    port: str,
    output: Path,
    hz: int,
    duration: float,
    script: Path | None,
    tape: bool,
    thermometers: str | None,
    force: bool,
    json_path: Path | None,
) -> None:
    """Log a board's telemetry: currents (A), voltages (V), the model's temperatures (degC).

    What has come is kept and the springs are switched off, whatever ends the recording: Ctrl-C, a closed terminal, a
    cable, a full disk, a reset of the board. While it runs, rows go to OUTPUT.part; at the end that becomes OUTPUT.
    The log begins with the board's version, faults and settings as comments. A fault of the board is said as it comes and at the
    end, and stands in the log where it came; the command then exits with 1. What the board remarks on a line of --run (a
    setting that is not active yet, springs that are still warm) is said and logged likewise, and is no failure.
    With --tape what the board knows of its springs begins anew, as after power-on; what it has learnt of them stays.
    """
    if tape and (thermometers or hz != 1):
        raise InputError("a tape has each tick and no thermometers: leave out --hz and --thermometers")
    two_ports(port, thermometers)
    steps = script_lines(read_text(script), str(script), duration) if script else []
    if script and not steps:
        raise InputError("no step in it", script)
    with told_to_stop(last=True) as stopped:
        with (
            working(f"recording from {port}", duration) as say,
            Board(port, stopped=stopped, off_at_end=False) as board,
            measuring(thermometers) as logger,
            closing(LogFile(output, force)) as log,
        ):
            alarm = lambda fault: err.print(f"fault {fault}", style="bold red")  # noqa: E731
            tell = lambda rows, seconds: say(f"{rows} rows", seconds)  # noqa: E731
            if tape:
                got = record_tape(board, log, duration, steps, tell, about(port), err.print)
            else:
                got = record_board(board, log, hz, duration, steps, tell, about(port), logger, alarm, err.print)
        if not log.rows:
            raise WorkError(got.ended or "stopped before the first row came")
        result = results.Record(rows=log.rows, dropped_lines=got.dropped, ended=got.ended, faults=[*got.faults])
        write({json_path: results.checked(result)})
        lines = f", {got.dropped} corrupt lines dropped" if got.dropped else ""
        if got.offset_s is not None:
            lines += f"; the thermometers' clock was {got.offset_s:+.2f} s from the board's"
        beside(output).print(f"{log.rows} rows -> {output}{lines}")
    if got.ended:
        raise WorkError(f"{got.ended}; what came is in {output}")


@command("""\b
Examples:
  ninespring upload --port /dev/ttyACM0 settings.txt
  ninespring upload --port /dev/ttyACM0 --wait settings.txt
  ninespring upload --port /dev/ttyACM0 --undo
""")
@click.argument("settings", type=FILE, required=False)
@PORT
@click.option("--undo", is_flag=True, help="give the board back what it had before the last upload from this computer")
@click.option("--wait", is_flag=True, help="first wait until the board believes its springs cold")
@JSON
def upload(settings: Path | None, port: str, undo: bool, wait: bool, json_path: Path | None) -> None:
    """Send exported settings to a board, read them back, save them.

    Nothing is saved unless the board took every line and shows every value in `$$`. What the board has learnt of its
    springs it has learnt beside its old numbers, and forgets. All springs must be off, and should be cold: --wait waits. What it
    had before is kept on this computer: `ninespring settings history` shows it, --undo gives it back.
    """
    if (settings is None) != undo:
        raise InputError("give either a file of settings or --undo")
    given = read_settings(settings) if settings else None
    with working("sending", len(given) if given else None) as say, Board(port, off_at_end=False) as board:
        if wait:
            board.cool(say)
        warm = board.warm()
        if settings and given:
            history.send(board, given, f"upload {settings.name}", say)
            result = results.Upload(settings=len(given), saved=True)
            said = [f"{len(given)} settings sent and read back"]
        else:
            last = history.undo(board)
            result = results.Upload(settings=len(last.sent), saved=True, undone=last.by)
            said = [*last.words(back=True), f"`{last.by}` of {last.when} is taken back"]
    write({json_path: results.checked(result)})
    out.print("\n".join(said) + ", saved")
    if warm:
        err.print(
            f"warm, as the board believes: {', '.join(f'spring {k} ({t:.0f} degC)' for k, t in warm.items())}: a drive may end in "
            "fault 9 until they have cooled, some four minutes after they were on (--wait waits for that before it sends)",
            soft_wrap=True,
        )


@command("""\b
Example:
  ninespring monitor --port /dev/ttyACM0
""")
@PORT
@number("--hz", ranges.RECORD_HZ, "updates a second", 2)
@number("--duration", ranges.RECORD_S, "s; left out: until Ctrl-C")
def monitor(port: str, hz: int, duration: float | None) -> None:
    """Show a board's array as it is: per spring the model's temperature (degC) and its trend, current (A), limits."""
    with Board(port, off_at_end=False) as board:
        until = time.monotonic() + (duration or ranges.RECORD_S.high)
        try:
            screen = Screen(board.settings(), board.telemetry(hz))
            with Live(console=out, refresh_per_second=8) as live:
                while (line := board.next_line(min(until, time.monotonic() + 5.0))) is not None:
                    if screen.take(line):
                        live.update(screen.picture())
            if time.monotonic() < until:
                raise WorkError(f"{port}: no telemetry for 5 s")
        except KeyboardInterrupt:
            pass
        board.telemetry_off()
