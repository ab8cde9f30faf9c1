"""`ninespring calibrate`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ..errors import InputError, WorkError
from ..export.drive import patterns
from ..io import ranges
from ..io.board import SIMULATED, Board
from ..io.logs import write_atomically
from ..model.models import Array, pattern_of, read_array
from ..model.simulate import array_parameters
from .calibration.chain import Calibration
from .calibration.progress import FILE, Progress
from .calibration.report import page
from .console import ARRAY, FOLDER, JSON, command, make_folder, number, out, output, two_ports, write

FROM = {"duration": 900.0, "drive_for": 300.0, "current": 2.0, "supply": 14.0, "hottest": 105.0}
"""What is taken where nothing is said."""
UNKNOWN: tuple[str, ...] = ("--speed", "max", "--set", "plant.effects=latent_heat,resistance_phase,edge_loss")
UNKNOWN += ("--set", "plant.edge_loss_fraction=0.25")
"""The simulated board's array does what its chip has not been told: its edge loses more heat."""
REPORT, ARRAY_FILE = "report.html", "array.toml"


@command("""\b
Examples:
  ninespring calibrate --simulate
  ninespring calibrate --port /dev/ttyACM0 --thermometers /dev/ttyUSB0
  ninespring calibrate --port /dev/ttyACM0 --thermometers /dev/ttyUSB0 -o second --array array.toml --supply 10 --yes
""")
@click.option("--port", help="serial port of the board, e.g. /dev/ttyACM0")
@click.option("--thermometers", help="port of a thermocouple logger, one thermometer a spring; with --port")
@click.option(
    "--simulate", is_flag=True, help="a simulated board with thermometers, whose array nobody has told the chip"
)
@output("folder for all that is measured and found; one that was begun is gone on with", FOLDER, Path("calibration"))
@ARRAY
@number("--duration", ranges.PLAN_S, "s, each of the two measured runs  [default: 900]")
@number("--drive-for", ranges.DRIVE_S, "s, the drive before and the one after  [default: 300]")
@click.option("--pattern", help="what is driven before and after  [default: all but the middle, 111101111]")
@number("--current", ranges.PLAN_CURRENT_A, "A, one spring at full level  [default: 2.0]")
@number("--supply", ranges.PLAN_SUPPLY_A, "A, all springs together  [default: 14]")
@number("--hottest", ranges.PLAN_HOTTEST_C, "degC, of any spring, as declared  [default: 105]")
@click.option("--yes", is_flag=True, help="do not ask before heating and before writing: for scripts")
@JSON
def calibrate(
    port: str | None,
    thermometers: str | None,
    simulate: bool,
    output: Path,
    array_path: Path | None,
    yes: bool,
    json_path: Path | None,
    **wanted: float | str | None,
) -> None:
    """From a board as it is to one that knows its array: all seven commands of docs/calibrating.md in one.

    Plans and measures two runs, finds on the first what the model lacks, verifies that on the second, drives old and new
    settings in simulation, then drives the board as it is and with the new settings, and saves them if it drives no worse. It
    asks before it heats and before it writes. Ctrl-C, a pulled cable, a fault: the springs go off, what was measured is
    kept, and the same command goes on from there. Ends in report.html in the folder.
    """
    if (port is not None) == simulate:
        raise InputError("give --port, or --simulate where there is no board")
    if simulate and thermometers:
        raise InputError("--thermometers goes with --port: the simulated board has its own")
    if port and not thermometers:
        raise InputError(
            "--thermometers is missing: degrees come from one thermometer a spring. Without any: `ninespring plan "
            "--no-thermometer`, `record`, `diagnose`, as docs/calibrating.md says"
        )
    two_ports(port, thermometers)
    if not yes and not sys.stdin.isatty():
        raise InputError("it asks before it heats and before it writes, and nobody can answer here: give --yes")
    begun = (output / FILE).exists()
    kept = output / ARRAY_FILE if begun and (output / ARRAY_FILE).exists() else array_path
    array = read_array(kept) if kept else Array()
    array.one_layer("a board drives")
    array.one_board("this calibrates")
    if wanted["pattern"] is not None:
        pattern_of(str(wanted["pattern"]), array)
    if output.is_dir() and not begun and {one.name for one in output.iterdir()} - {ARRAY_FILE}:
        raise InputError("is there, and no calibration was begun in it: give another folder, -o", output)
    # another array in its place would be another calibration
    given = {"simulate": simulate, "array": array_path.read_text("utf-8") if array_path else None, **wanted}
    if not begun:
        middle = "".join("1" if one else "0" for one in patterns(array.springs)[0])
        given = FROM | {"pattern": middle} | {name: value for name, value in given.items() if value is not None}
    progress = Progress(output, given)
    make_folder(output)
    if array_path and not begun:
        (output / ARRAY_FILE).write_text(array_path.read_text("utf-8"), "utf-8")

    def tell(step: str, text: str) -> None:
        out.print(f"{step:>9}  ", style="bold", end="")
        out.print(text, soft_wrap=True)

    def ask(text: str) -> bool:
        return yes or click.confirm(text, default=False)

    try:
        declared: dict[str, float] = {"array.rows": array.rows, "array.cols": array.cols}
        declared |= {f"plant.{name}": value for name, value in array_parameters(array).items()}
        words = [word for name, value in declared.items() for word in ("--set", f"{name}={value}")]
        with Board(port or SIMULATED, simulated=(*UNKNOWN, *words)) as board:
            if simulate:
                board.ask(f"$rows={array.rows}")
                board.ask(f"$columns={array.cols}")
            Calibration(progress, array, board, thermometers or board.thermometers, ask, tell).run()
    except KeyboardInterrupt:
        raise WorkError(f"stopped; what was measured is in {output}: the same command goes on from there") from None
    finally:
        if "diagnose" in progress.done:
            write_atomically({output / REPORT: page(progress, array)})
            out.print(f"-> {output / REPORT}", soft_wrap=True)
        write({json_path: progress.text()})
