"""The command line: fit, diagnose, predict, export, import, record, upload, monitor."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from . import __version__
from .errors import InputError, WorkError
from .logs import Run, log_text, read_log, write_atomically

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)
FILE = click.Path(dir_okay=False, path_type=Path)


@contextmanager
def _working(text: str) -> Iterator[Callable[[str], None]]:
    """Show that work goes on, on the terminal's error stream."""
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=err,
        transient=True,
        disable=not err.is_terminal,
    ) as progress:
        task = progress.add_task(text)
        yield lambda now: progress.update(task, description=now)


def _array_and_runs(array_path: Path | None, logs: tuple[Path, ...], model: Any = None) -> tuple[Any, list[Run]]:
    from .models import Array, read_array

    array = model.array if model else read_array(array_path) if array_path else None
    runs = [read_log(path, array.springs if array else None) for path in logs]
    counts = {run.springs for run in runs}
    if len(counts) > 1:
        raise InputError(f"the logs have {' and '.join(map(str, sorted(counts)))} springs: give logs of one array")
    if array is None:
        count = counts.pop()
        shapes = {
            1: (1, 1),
            2: (1, 2),
            4: (2, 2),
            9: (3, 3),
            16: (4, 4),
            25: (5, 5),
            36: (6, 6),
            49: (7, 7),
            64: (8, 8),
        }
        if count not in shapes:
            raise InputError(f"{count} springs: say how they are arranged (--array array.toml)", logs[0])
        array = Array(*shapes[count])
    modes = {run.mode for run in runs}
    if len(modes) > 1:
        raise InputError(f"the logs are driven by {' and '.join(sorted(modes))}: diagnose one kind at a time")
    for run in runs:
        for note in run.notes:
            err.print(f"[yellow]{Path(run.name).name}: {note}[/]")
    return array, runs


def _write_json(path: Path | None, data: Any) -> None:
    if path:
        write_atomically(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def cli() -> None:
    """Calibrate the thermal model of an array of NiTi springs, and say what the model lacks."""


@cli.command()
@click.argument("logs", nargs=-1, required=True, type=FILE)
@click.option("--array", "array_path", type=FILE, help="array.toml; 3 x 3 of the paper's spring if left out")
@click.option("--effects", default="", help="effects to switch on and fit, comma-separated")
@click.option("-o", "--output", type=FILE, required=True, help="model.toml to write")
@click.option("--json", "json_path", type=FILE, help="write the result for programs")
def fit(logs: tuple[Path, ...], array_path: Path | None, effects: str, output: Path, json_path: Path | None) -> None:
    """Fit the declared model, with the effects named, to logs."""
    from . import diagnosis, native
    from . import effects as library
    from .models import model_text
    from .statistics import rms

    wanted = [e.strip() for e in effects.split(",") if e.strip()]
    for name in wanted:
        if name not in native.effect_names():
            raise InputError(f"there is no effect '{name}': {', '.join(native.effect_names())}")
    array, runs = _array_and_runs(array_path, logs)
    with _working("fitting") as say:
        problem, chosen, base = diagnosis.fit_effects(array, runs, wanted, say)
        held = diagnosis.holdout_rmse(problem, chosen)
    model = diagnosis.model_of(problem, chosen, runs)
    model.provenance["rmse_before_c"] = rms(base.residual)
    write_atomically(output, model_text(model))
    result = {
        "rmse_c": rms(chosen.residual),
        "holdout_rmse_c": held,
        "noise_c": problem.noise_c,
        "effects": list(chosen.spec.effects),
        "parameters": {
            k: v for e in (None, *chosen.spec.effects) for k, v in diagnosis.parameters_of(problem, chosen, e).items()
        },
        "not_identifiable": chosen.stuck,
        "at_bounds": chosen.at_bounds(),
    }
    _write_json(json_path, result)
    _print_parameters(result["parameters"])
    out.print(f"error {result['rmse_c']:.3f} K, held out {held:.3f} K, noise {problem.noise_c:.3f} K -> {output}")
    for effect in wanted:
        if effect in library.WHY_NOT_ON_CHIP:
            out.print(f"{effect}: not for the chip: {library.WHY_NOT_ON_CHIP[effect]}")


def _print_parameters(parameters: dict[str, Any]) -> None:
    table = Table("number", "value", "standard error", "unit", "")
    for name, one in parameters.items():
        error = "-" if one["stderr"] is None else f"{one['stderr']:.2g}"
        table.add_row(name, f"{one['value']:.5g}", error, one["unit"], one.get("note", ""))
    out.print(table)


@cli.command()
@click.argument("logs", nargs=-1, required=True, type=FILE)
@click.option("--array", "array_path", type=FILE, help="array.toml; 3 x 3 of the paper's spring if left out")
@click.option("--model", "model_path", type=FILE, help="model.toml: declared values and effects already on")
@click.option("--frozen", is_flag=True, help="keep the model's values as they are; fit effects only")
@click.option("-o", "--output", type=click.Path(file_okay=False, path_type=Path), required=True, help="folder")
@click.option("--json", "json_path", type=FILE, help="write diagnosis.json here too")
@click.option("--surrogate", is_flag=True, help="also try an empirical model of what is left (never exported)")
def diagnose(
    logs: tuple[Path, ...],
    array_path: Path | None,
    model_path: Path | None,
    frozen: bool,
    output: Path,
    json_path: Path | None,
    surrogate: bool,
) -> None:
    """Find the effect that the model lacks: writes diagnosis.json, report.html, model.toml."""
    from . import diagnosis, report, steady
    from .models import model_text, read_model

    if frozen and not model_path:
        raise InputError("--frozen needs --model")
    model = read_model(model_path) if model_path else None
    if any(steady.is_steady(path) for path in logs):
        if len(logs) > 1:
            raise InputError("give one steady table, or logs")
        with _working("fitting") as say:
            result = steady.diagnose_table(logs[0], model, array_path, frozen, say)
        _make(output)
        _write_json(output / "diagnosis.json", result)
        write_atomically(output / "report.html", steady.html_report(result))
        write_atomically(output / "model.toml", model_text(steady.model_after(result, model, array_path)))
        _write_json(json_path, result)
        steady.print_result(out, result)
        return
    array, runs = _array_and_runs(array_path, logs, model)
    with _working("fitting") as say:
        found = diagnosis.diagnose(array, runs, model=model, frozen=frozen, progress=say)
        if surrogate:
            say("empirical surrogate")
            found.result["surrogate"] = diagnosis.surrogate(found.problem, found.final)
        say("writing the report")
        page = report.html_report(found)
    _make(output)
    _write_json(output / "diagnosis.json", found.result)
    write_atomically(output / "report.html", page)
    write_atomically(output / "model.toml", model_text(found.model))
    _write_json(json_path, found.result)
    result = found.result
    out.print(report.verdict(result))
    if result["effects"]:
        table = Table("effect", "error, K", "held out, K", "evidence, nats", "numbers", "chip")
        for one in result["effects"]:
            numbers = ", ".join(
                f"{k} {v['value']:.4g}" + ("" if v["stderr"] is None else f" +- {v['stderr']:.2g}") + f" {v['unit']}"
                for k, v in list(one["parameters"].items())[:4]
            )
            name = one["name"] + (f" ({one['variant']})" if one.get("variant") else "")
            table.add_row(
                name,
                f"{one['rmse_c']:.3f}",
                f"{one['holdout_rmse_c']:.3f}",
                f"{one['evidence']:.0f}",
                numbers,
                "yes" if one["on_chip"] else "no",
            )
        out.print(table)
    for one in result["rivals"]:
        out.print(f"{one['instead_of']} or {one['name']}: these data cannot tell. {one['separating_experiment']}")
    if result["unexplained"]:
        out.print(f"unexplained: {result['residual']['note']}")
    for one in result["effects"]:
        if "why_not_on_chip" in one:
            out.print(f"{one['name']} is not exported: {one['why_not_on_chip']}")
    for text in result["warnings"]:
        if "isolated spike" not in text:
            out.print(f"note: {text}")
    if surrogate:
        s = result["surrogate"]
        out.print(
            "empirical surrogate (not physics, never exported): "
            f"held out {s['holdout_before_c']:.3f} -> {s['holdout_after_c']:.3f} K"
        )
    out.print(f"-> {output / 'report.html'}")


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made a folder: {error.strerror}", folder) from None


@cli.command()
@click.argument("log", type=FILE)
@click.option("--model", "model_path", type=FILE, required=True)
@click.option("-o", "--output", type=FILE, required=True, help="time_s, t1_c..tn_c")
@click.option("--chip", is_flag=True, help="by the on-chip fixed-point model instead of the plant")
@click.option("--json", "json_path", type=FILE)
def predict(log: Path, model_path: Path, output: Path, chip: bool, json_path: Path | None) -> None:
    """Predict the temperatures of a log."""
    from . import diagnosis
    from .models import read_model

    model = read_model(model_path)
    run = read_log(log, model.array.springs, temperatures=False)
    with _working("simulating"):
        shown = diagnosis.predict(model, run, chip)
    columns = {f"t{k + 1}_c": shown[:, k] for k in range(run.springs)}
    write_atomically(output, log_text(run.time_s, columns))
    error = run.temperature_c - shown
    rmse = float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else None
    _write_json(json_path, {"rmse_c": rmse, "rows": len(run.time_s)})
    out.print(f"{len(run.time_s)} rows" + ("" if rmse is None else f", error {rmse:.3f} K rms") + f" -> {output}")
    if note := model.provenance.get("note"):
        out.print(f"note: {note}")


@cli.command()
@click.option("--model", "model_path", type=FILE, required=True)
@click.option("-o", "--output", type=FILE, required=True, help="console lines, `$name=value`")
def export(model_path: Path, output: Path) -> None:
    """Write the console lines that put a model into the chip."""
    from . import diagnosis
    from .effects import WHY_NOT_ON_CHIP
    from .models import read_model

    model = read_model(model_path)
    text, message = diagnosis.chip_settings(model)
    left = [f"# {e} is left out: {WHY_NOT_ON_CHIP[e]}" for e in model.effects if e in WHY_NOT_ON_CHIP]
    write_atomically(output, "\n".join([f"# from {model_path.name}", *left, text]))
    if message:
        out.print(message)
    out.print(f"{text.count(chr(10))} settings -> {output} (`ninespring upload` sends them)")


@cli.command("import")
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--map", "mapping", help="mapping file (TOML), or a built-in one: tclab, tclab-prbs")
@click.option("--regions", type=FILE, help="thermal-camera frames: regions file (TOML)")
@click.option("--interval", type=float, default=1.0, show_default=True, help="seconds between frames")
@click.option("--times", type=FILE, help="times of the frames, s, one a line")
@click.option("--statistic", type=click.Choice(["mean", "median", "max"]), default="mean", show_default=True)
@click.option("--log", "log_path", type=FILE, help="log of currents to put the frames' temperatures into")
@click.option("-o", "--output", type=FILE, required=True)
def import_(
    source: Path,
    mapping: str | None,
    regions: Path | None,
    interval: float,
    times: Path | None,
    statistic: str,
    log_path: Path | None,
    output: Path,
) -> None:
    """Make a log of another logger's file (--map) or of thermal-camera frames (--regions)."""
    from . import importing

    if bool(mapping) == bool(regions):
        raise InputError("give either --map (a table) or --regions (camera frames)")
    if mapping:
        text = importing.import_table(source, mapping)
    else:
        assert regions is not None
        stamps = None
        if times:
            try:
                stamps = np.loadtxt(times, ndmin=1)
            except ValueError as error:
                raise InputError(f"not one time a line: {error}", times) from None
        with _working("reading frames"):
            when, columns = importing.import_frames(
                source, importing.read_regions(regions), stamps, interval, statistic
            )
        text = (
            importing.merge_into_log(log_path, when, columns)
            if log_path
            else log_text(when, columns, {"imported_from": source.name})
        )
    write_atomically(output, text)
    out.print(f"{text.count(chr(10)) - 1} lines -> {output}")


@cli.command()
@click.option("--port", required=True)
@click.option("-o", "--output", type=FILE, required=True)
@click.option("--hz", type=click.IntRange(1, 50), default=1, show_default=True)
@click.option("--duration", type=float, default=900.0, show_default=True, help="s; Ctrl-C ends it earlier")
@click.option("--run", "script", type=FILE, help="console lines to send first, one a line")
def record(port: str, output: Path, hz: int, duration: float, script: Path | None) -> None:
    """Log a board's telemetry to a file."""
    from .board import Board
    from .board import record as record_board

    with Board(port) as board, _working(f"recording from {port}") as say:
        board.greet()
        for line in script.read_text().splitlines() if script else []:
            if line.strip() and not line.startswith("#"):
                board.ask(line.strip())
        lines = record_board(board, hz, duration, say)
    write_atomically(output, "\n".join(lines) + "\n")
    out.print(f"{len(lines) - 1} rows -> {output}")


@cli.command()
@click.argument("settings", type=FILE)
@click.option("--port", required=True)
@click.option("--save/--no-save", default=True, show_default=True, help="keep them in the EEPROM")
def upload(settings: Path, port: str, save: bool) -> None:
    """Send exported settings to a board."""
    from .board import Board, settings_lines
    from .logs import read_bytes

    lines = settings_lines(read_bytes(settings).decode("ascii", "replace"), str(settings))
    with Board(port) as board, _working("sending") as say:
        board.greet()
        remarks: list[str] = []
        for line in lines:
            say(line)
            remarks = board.ask(line)
        if remarks:
            raise WorkError(f"the board does not take them together: {remarks[-1]}")
        if save:
            board.ask("$save", 10.0)
    out.print(f"{len(lines)} settings sent{' and saved' if save else ''}")


@cli.command()
@click.option("--port", required=True)
@click.option("--hz", type=click.IntRange(1, 50), default=2, show_default=True)
@click.option("--duration", type=float, default=1e9, help="s; Ctrl-C ends it")
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


def main() -> None:
    """Run the command line: exit code 0 done, 1 the work failed, 2 the input or arguments are wrong."""
    try:
        code = cli(standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except InputError as error:
        err.print(f"ninespring: {error}", style="red", soft_wrap=True, markup=False)
        sys.exit(2)
    except click.ClickException as error:
        err.print(f"ninespring: {error.format_message()}", style="red", soft_wrap=True, markup=False)
        sys.exit(2)
    except (WorkError, RuntimeError, MemoryError, OSError) as error:
        err.print(f"ninespring: {error}", style="red", soft_wrap=True, markup=False)
        sys.exit(1)
    except (click.Abort, KeyboardInterrupt):
        err.print("ninespring: stopped")
        sys.exit(1)


if __name__ == "__main__":
    main()
