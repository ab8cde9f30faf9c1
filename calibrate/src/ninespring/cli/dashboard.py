"""`ninespring dashboard`."""

from __future__ import annotations

from pathlib import Path

import click

from ..dashboard.board_source import SIMULATED, BoardSource
from ..dashboard.server import HOST, address_of, door_of, listen, serve
from ..dashboard.source import Source
from ..errors import InputError
from ..io import ranges
from ..io.logs import read_log
from ..io.recording import told_to_stop
from ..io.simulated import simulator
from ..model.models import array_of
from .console import ARRAY, FILE, command, model_and_array, notes_of, number, out

USUAL = "127.0.0.1:8765"


@command("""\b
Examples:
  ninespring dashboard --simulate
  ninespring dashboard --port /dev/ttyACM0
  ninespring dashboard --replay run1.csv --model diagnosis/model.toml
""")
@click.option("--port", help="serial port of a board, e.g. /dev/ttyACM0")
@click.option("--simulate", is_flag=True, help="start a simulated board and show that")
@click.option("--thermometers", help="port of a thermocouple logger: what it measures is shown beside the estimate")
@click.option("--replay", type=FILE, help="log to play again")
@click.option("--model", "model_path", type=FILE, help="with --replay: model.toml, shown beside what was measured")
@ARRAY
@number("--speed", ranges.REPLAY_SPEED, "with --replay: times real time  [default: 1]")
@number("--hz", ranges.DASHBOARD_HZ, "rows a second from the board", 10)
@click.option("--folder", type=click.Path(True, False, path_type=Path), default=Path(), help="where recordings go")
@click.option("--listen", "address", default=USUAL, help="HOST:PORT of the page; port 0: any free one")
@click.option(
    "--host-name",
    "host_names",
    multiple=True,
    metavar="NAME",
    help="a name by which browsers call this machine, as raspberrypi.local; may be given again. Other names are refused",
)
def dashboard(
    port: str | None,
    simulate: bool,
    thermometers: str | None,
    replay: Path | None,
    model_path: Path | None,
    array_path: Path | None,
    speed: float | None,
    hz: int,
    folder: Path,
    address: str,
    host_names: tuple[str, ...],
) -> None:
    """Show an array live on a page in the browser, and drive it from there. Ctrl-C ends it and switches everything off.

    The page is for this machine alone unless --listen names another address: then whoever has the printed address, which
    holds a token, drives the array.
    """
    if sum((port is not None, simulate, replay is not None)) != 1:
        raise InputError("give one of --port, --simulate, --replay")
    if (model_path or array_path) and not replay:
        raise InputError("--model and --array go with --replay")
    if speed is not None and not replay:
        raise InputError("--speed goes with --replay")
    host, colon, number = address.rpartition(":")
    if not colon or not number.isdigit() or int(number) > 65535:
        raise InputError(f"--listen {address}: not HOST:PORT, as in {USUAL}")
    if wrong := next((one for one in host_names if not HOST.fullmatch(one) or ":" in one), None):
        raise InputError(f"--host-name {wrong}: not a name, as in raspberrypi.local")
    source: Source
    if replay:
        from ..dashboard.replay_source import ReplaySource

        model, array = model_and_array(model_path, array_path)
        run = read_log(replay, array.springs if array else None, temperatures=False)
        notes_of([run])
        array = array_of(array, [run])
        array.one_layer("the dashboard shows")
        source = ReplaySource(run, array.rows, array.cols, model, speed or 1.0)
    else:
        if simulate:
            simulator()  # what is not built does not come back, as a port does
        source = BoardSource(port or SIMULATED, hz, folder, thermometers)
    here = listen(host.strip("[]"), int(number))
    door = door_of(here, host_names)
    with told_to_stop(last=True) as stopped:
        out.print(f"{address_of(here, door, host_names)}   (Ctrl-C ends it)", soft_wrap=True)
        serve(source, here, stopped, door)
