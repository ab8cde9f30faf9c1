"""`ninespring import`."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from ..errors import InputError
from ..io import importing, ranges, results
from ..io.logs import log_text
from .console import FILE, FORCE, JSON, beside, command, number, output, working, write


@command(
    """\b
Examples:
  ninespring import logger.csv --map map.toml -o run1.csv
  ninespring import data.txt --map tclab -o tclab.csv
  ninespring import frames.npy --regions regions.toml --interval 0.5 --log board1.csv -o run1.csv
  ninespring import frames/ --regions regions.toml --times times.txt -o camera.csv
\b
map.toml:                                          regions.toml (pixels):
  [file]                                             [grid]
  separator = ";"                                    rows = 3
  decimal = ","                                      cols = 3
  [columns]                                          left = 12     # centre of spring 1
  time_s = { column = "Time", unit = "min" }         top = 10
  i1_a = { column = "Heater 1", unit = "mA" }        step_x = 20
  t1_c = { column = "TC 1", unit = "degF" }          step_y = 20
  [constants]                                        width = 6
  ambient_c = 21.5                                   height = 6
""",
    name="import",
)
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--map", "mapping", help="mapping file (TOML) of columns and units, or built in: tclab")
@click.option("--regions", type=FILE, help="regions file (TOML) for thermal-camera frames: pixels of each spring")
@number("--interval", ranges.FRAME_S, "s a frame", 1.0)
@click.option("--unit", type=click.Choice(["degC", "degF", "K"]), default="degC", help="of the frames")
@click.option("--times", type=FILE, help="times of the frames, s on the log's clock, one a line")
@number("--offset", ranges.OFFSET_S, "s to add to the frames' times", 0.0)
@click.option(
    "--log",
    "log_path",
    type=FILE,
    help="log of currents to put the frames' temperatures into; without --times the first frame is at its first row",
)
@output("log to write")
@FORCE
@JSON
def import_(
    source: Path,
    mapping: str | None,
    regions: Path | None,
    interval: float,
    unit: str,
    offset: float,
    times: Path | None,
    log_path: Path | None,
    output: Path,
    force: bool,
    json_path: Path | None,
) -> None:
    """Make a log of another logger's file (--map) or of thermal-camera frames (--regions).

    SOURCE is a table with a header; or frames: a .npy of (frames, height, width), a .csv, or a folder of .csv.
    """
    if bool(mapping) == bool(regions):
        raise InputError("give either --map (a table) or --regions (camera frames)")
    if mapping and (log_path or times):
        raise InputError("--log and --times go with --regions, not with --map")
    if mapping:
        text = importing.import_table(source, mapping)
    else:
        assert regions is not None
        places = importing.read_regions(regions)
        stamps = importing.read_times(times) if times else None
        count, frames = importing.frames_of(source)
        if stamps is not None and len(stamps) != count:
            raise InputError(f"{len(stamps)} times for {count} frames", times)
        with working("reading frames", count) as say:
            tell = lambda row: say(f"frame {row} of {count}", row)  # noqa: E731
            columns = importing.reduce_frames(source, count, frames, places, tell, unit)
        if log_path:
            text = importing.merge_into_log(log_path, stamps, interval, offset, columns)
        else:
            when = (np.arange(count) * interval if stamps is None else stamps) + offset
            text = log_text(when, columns, {"imported_from": source.name})
    header, *rows = [line for line in text.splitlines() if not line.startswith("#")]
    result = results.Import(source=source.name, columns=header.split(","), rows=len(rows))
    write({output: text}, force)
    write({json_path: results.checked(result)})
    seen = sum(name.startswith("t") for name in result.columns[1:])
    beside(output).print(f"{len(rows)} rows, temperatures of {seen} springs -> {output}", soft_wrap=True)
