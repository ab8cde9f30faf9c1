"""The command line: what commands there are, and how they end. Each command is beside its idea."""

from __future__ import annotations

import datetime
import os
import signal
import sys
import time
import warnings
from pathlib import Path
from typing import NoReturn

import click
from rich.table import Table

from . import __version__
from .console import FILE, JSON, PORT, checked, err, out, outcome, working, write
from .errors import InputError, WorkError
from .export.command import export, verify
from .fit.command import fit
from .fit.predict_command import predict
from .import_command import import_
from .logs import check_folder, read_bytes
from .verdict.command import diagnose


@click.group(
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Logs, models and their units: docs/files.md. From bench to calibrated chip in one page: docs/calibrating.md. "
    "Exit code 0: done; 1: the work failed; 2: the input or the arguments are wrong, and one line says what and where.",
)
@click.version_option(__version__)
def cli() -> None:
    """Calibrate the thermal model of an array of NiTi springs, and say what the model lacks."""


for command in (fit, diagnose, predict, export, verify, import_):
    cli.add_command(command)


@cli.command(
    epilog="""\b
Example:
  ninespring record --port /dev/ttyACM0 --hz 1 --duration 900 --run steps.txt -o board1.csv
\b
steps.txt (console words; `at S` waits until so many seconds after the first row):
  ambient 21.5
  at 5 pattern 101000101
  at 300 fan 100
  at 600 off all
"""
)
@PORT
@click.option("-o", "--output", type=FILE, required=True, help="log to write")
@click.option("--hz", type=click.IntRange(1, 50), default=1, show_default=True, help="rows a second")
@click.option(
    "--duration",
    type=click.FloatRange(min=0, min_open=True),
    default=900.0,
    show_default=True,
    help="s; Ctrl-C ends it earlier",
)
@click.option("--run", "script", type=FILE, help="console lines to send, one a line, each at its time")
@JSON
def record(port: str, output: Path, hz: int, duration: float, script: Path | None, json_path: Path | None) -> None:
    """Log a board's telemetry: currents (A), voltages (V), the model's temperatures (degC).

    What has come is kept, whatever ends the recording: Ctrl-C, a cable, a reset of the board. While it runs, rows go to
    OUTPUT.part; at the end that becomes OUTPUT.
    """
    from .board import Board, script_lines
    from .board import record as record_board

    check_folder(output, json_path)
    steps = script_lines(read_bytes(script).decode("utf-8", "replace"), str(script)) if script else []
    started = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    part = output.with_name(output.name + ".part")
    with Board(port) as board, working(f"recording from {port}", duration) as say, part.open("w") as stream:
        try:
            board.greet()
            got = record_board(
                board,
                hz,
                duration,
                steps,
                write=lambda line: print(line, file=stream, flush=True),
                say=lambda rows, seconds: say(f"{rows} rows", seconds),
            )
        except BaseException:
            part.unlink()
            raise
    head = [f"# recorded: {started}", f"# port: {port}", f"# tool: ninespring {__version__}"]
    if got.dropped:
        head.append(f"# dropped_lines: {got.dropped}")
    result = outcome("record", rows=got.rows, dropped_lines=got.dropped, ended=got.ended)
    write({output: "\n".join([*head, part.read_text().rstrip("\n")]) + "\n", json_path: checked(result)})
    part.unlink()
    out.print(f"{got.rows} rows -> {output}" + (f", {got.dropped} lines dropped" if got.dropped else ""))
    if got.ended:
        raise WorkError(f"{got.ended}; what had come until then is in {output}")


@cli.command(
    epilog="""\b
Example:
  ninespring upload --port /dev/ttyACM0 settings.txt
"""
)
@click.argument("settings", type=FILE)
@PORT
@click.option("--save/--no-save", default=True, show_default=True, help="keep them in the EEPROM")
@JSON
def upload(settings: Path, port: str, save: bool, json_path: Path | None) -> None:
    """Send exported settings to a board, read them back, save them.

    Nothing is saved unless the board took every line and shows every value in `$$`.
    """
    from .board import Board, settings_lines, settings_that_differ

    check_folder(json_path)
    lines = settings_lines(read_bytes(settings).decode("utf-8", "replace"), str(settings))
    with Board(port) as board, working("sending", len(lines)) as say:
        board.greet()
        remarks: list[str] = []
        for k, line in enumerate(lines):
            say(line, k)
            try:
                remarks = board.ask(line)
            except WorkError as error:
                raise WorkError(f"{error}: nothing is saved, a reset of the board gives back what it had") from None
        if remarks:
            raise WorkError(f"the board does not take them together: {remarks[-1]}")
        say("reading back", len(lines))
        if wrong := settings_that_differ(lines, board.ask("$$", 10.0)):
            raise WorkError(f"the board shows other values than were sent, nothing is saved: {'; '.join(wrong)}")
        if save:
            board.ask("$save", 10.0)
    write({json_path: checked(outcome("upload", settings=len(lines), saved=save))})
    out.print(f"{len(lines)} settings sent and read back{', saved' if save else ''}")


@cli.command(
    epilog="""\b
Example:
  ninespring monitor --port /dev/ttyACM0
"""
)
@PORT
@click.option("--hz", type=click.IntRange(1, 50), default=2, show_default=True, help="updates a second")
@click.option("--duration", type=click.FloatRange(min=0, min_open=True), default=1e9, help="s; Ctrl-C ends it")
def monitor(port: str, hz: int, duration: float) -> None:
    """Show a board's temperatures and currents as they are."""
    from rich.live import Live

    from .board import Board

    with Board(port) as board:
        board.greet()
        names: list[str] = []
        try:
            with Live(console=out, refresh_per_second=8) as live:
                for line in board.telemetry(hz, time.monotonic() + duration):
                    cells = line.split(",")
                    if line.startswith("time_s,"):
                        names = cells
                    elif len(cells) == len(names):
                        live.update(_board_table(dict(zip(names, cells, strict=True))))
        except KeyboardInterrupt:
            pass
        board.stop()


def _board_table(row: dict[str, str]) -> Table:
    table = Table(
        "spring",
        "current A",
        "voltage V",
        "model degC",
        "duty",
        title=f"{row.get('time_s', '')} s, fan {row.get('fan', '')}, {row.get('state', '')}",
    )
    k = 1
    while f"i{k}_a" in row:
        table.add_row(str(k), row[f"i{k}_a"], row.get(f"v{k}_v", ""), row.get(f"m{k}_c", ""), row.get(f"d{k}", ""))
        k += 1
    return table


def _end(message: str, code: int) -> NoReturn:
    err.print(f"ninespring: {message}", style="red", soft_wrap=True, markup=False)
    sys.exit(code)


def main() -> None:
    """Run the command line: exit code 0 done, 1 the work failed, 2 the input or arguments are wrong."""
    # What a numerical library warns about (an empty column has no mean) says nothing to a user.
    warnings.simplefilter("ignore", RuntimeWarning)
    # Ended from outside: temporary files go, as with Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = cli(standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except InputError as error:
        _end(str(error), 2)
    except click.ClickException as error:
        _end(error.format_message(), 2)
    except (click.Abort, KeyboardInterrupt):
        _end("stopped", 1)
    except (WorkError, RuntimeError, MemoryError, OSError) as error:
        _end(str(error) or type(error).__name__, 1)
    except Exception as error:
        if os.environ.get("NINESPRING_TRACEBACK"):
            raise
        said = (str(error).splitlines() or [""])[0]
        _end(f"a defect of the tool: {type(error).__name__}: {said} (NINESPRING_TRACEBACK=1 shows where)", 1)


if __name__ == "__main__":
    main()
