"""The command line: fit, diagnose, predict, export, import, record, upload, monitor."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from pathlib import Path
from typing import Any, NoReturn

import click
import numpy as np
from rich.table import Table

from . import __version__
from .board_commands import add_board_commands
from .console import FILE, JSON, Group, checked, err, out, result_of, working, write
from .errors import InputError, WorkError
from .logs import Run, check_folder, log_text, read_log, sha256_of

FEWEST_ROWS = 50
"""Logs with fewer rows than this, all together, are no measurement to fit to."""
SHAPES = {1: (1, 1), 2: (1, 2), 4: (2, 2), 9: (3, 3), 16: (4, 4), 25: (5, 5), 36: (6, 6), 49: (7, 7), 64: (8, 8)}
"""Springs of a log, and the array they are taken for where no array.toml says it."""


def _array_and_runs(array_path: Path | None, logs: tuple[Path, ...], model: Any = None) -> tuple[Any, list[Run]]:
    from .models import Array, read_array

    array = model.array if model else read_array(array_path) if array_path else None
    runs = [read_log(path, array.springs if array else None) for path in logs]
    for k, run in enumerate(runs):
        for other in runs[:k]:
            if run.sha256 == other.sha256:
                raise InputError(f"is the same as {other.name}: it would count twice, give it once", run.name)
    counts = {run.springs for run in runs}
    if len(counts) > 1:
        raise InputError(f"the logs have {' and '.join(map(str, sorted(counts)))} springs: give logs of one array")
    if array is None:
        count = counts.pop()
        if count not in SHAPES:
            raise InputError(
                f"{count} springs: say how they are arranged, `--array array.toml` with [array] rows and cols",
                logs[0],
                1,
            )
        array = Array(*SHAPES[count])
    modes = {run.mode for run in runs}
    if len(modes) > 1:
        raise InputError(f"the logs are driven by {' and '.join(sorted(modes))}: diagnose one kind at a time")
    if (rows := sum(len(run.time_s) for run in runs)) < FEWEST_ROWS:
        raise InputError(f"{rows} rows are too few to fit to: log some minutes (docs/calibrating.md)", logs[0])
    if not any(np.any(run.drive) for run in runs):
        raise InputError("no spring is ever driven: log what the springs were given (i1_a ... or u1 ...)", logs[0], 1)
    return array, runs


def _say_notes(runs: list[Run]) -> None:
    for run in runs:
        _say(f"{Path(run.name).name}: ", run.notes)


def _say(where: str, notes: list[str]) -> None:
    for note in notes:
        err.print(where + note, style="yellow", markup=False)


def _logs_of(runs: list[Run]) -> list[dict[str, Any]]:
    return [{"file": Path(r.name).name, "sha256": r.sha256, "rows": len(r.time_s), "notes": r.notes} for r in runs]


@click.group(
    cls=Group,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Logs, models and their units: docs/files.md. From bench to calibrated chip in one page: docs/calibrating.md. "
    "Exit code 0: done; 1: the work failed; 2: the input or the arguments are wrong, and one line says what and where.",
)
@click.version_option(__version__)
def cli() -> None:
    """Calibrate the thermal model of an array of NiTi springs, and say what the model lacks."""


ARRAY = click.option(
    "--array", "array_path", type=FILE, help="array.toml; left out: a square (or 1 x 2) of the paper's spring"
)
MODEL = click.option("--model", "model_path", type=FILE, required=True, help="model.toml that fit or diagnose wrote")


@cli.command(
    epilog="""\b
Examples:
  ninespring fit run1.csv run2.csv -o model.toml
  ninespring fit --effects latent_heat,shared_air run1.csv -o model.toml
"""
)
@click.argument("logs", nargs=-1, required=True, type=FILE)
@ARRAY
@click.option("--effects", default="", help="effects to switch on and fit, comma-separated")
@click.option("-o", "--output", type=FILE, required=True, help="model.toml to write")
@JSON
def fit(logs: tuple[Path, ...], array_path: Path | None, effects: str, output: Path, json_path: Path | None) -> None:
    """Fit the declared model, with the effects named, to logs.

    Errors are root mean squares in K; numbers are in J/K, W/K, J, s as the table says. Held out: on blocks of two and a
    half minutes that the numbers were not fitted to.
    """
    from . import diagnosis, native, plausibility, steady
    from . import effects as library
    from .models import model_text
    from .statistics import rms

    check_folder(output, json_path)
    wanted = list(dict.fromkeys(e.strip() for e in effects.split(",") if e.strip()))
    for name in wanted:
        if name not in native.effect_names():
            raise InputError(f"there is no effect '{name}': {', '.join(native.effect_names())}")
    for path in logs:
        if steady.is_steady(path):
            raise InputError("a steady table: `ninespring diagnose` fits it, effect by effect", path, 1)
    array, runs = _array_and_runs(array_path, logs)
    _say_notes(runs)
    with working("fitting") as say:
        problem, chosen, base = diagnosis.fit_effects(array, runs, wanted, say)
        say("held-out blocks")
        held = diagnosis.holdout_rmse(problem, chosen)
        suspect = plausibility.swapped(runs)
        suspect += [text for run in runs for text in plausibility.undriven_but_hottest(run)]
        if rms(chosen.residual) > 1.5 * problem.noise_c:
            say("is a clock off?")
            suspect += plausibility.shifted_clock(problem, (chosen,))
    model = diagnosis.model_of(problem, chosen, runs)
    model.provenance["rmse_before_c"] = rms(base.residual)
    result = result_of(
        "fit",
        logs=_logs_of(runs),
        rmse_before_c=rms(base.residual),
        rmse_c=rms(chosen.residual),
        holdout_rmse_c=held,
        noise_c=problem.noise_c,
        effects=list(chosen.spec.effects),
        parameters={
            k: v for e in (None, *chosen.spec.effects) for k, v in diagnosis.parameters_of(problem, chosen, e).items()
        },
        not_identifiable=sorted(chosen.stuck),
        at_bounds=chosen.at_bounds(),
        warnings=suspect,
    )
    write({output: model_text(model), json_path: checked(result)})
    _say("", suspect)
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


@cli.command(
    epilog="""\b
Examples:
  ninespring diagnose run1.csv run2.csv -o diagnosis
  ninespring diagnose --array array.toml tclab.csv -o diagnosis
  ninespring diagnose --model model.toml --frozen run3.csv -o check
  ninespring diagnose --model model.toml --frozen steady.csv -o steady
"""
)
@click.argument("logs", nargs=-1, required=True, type=FILE)
@ARRAY
@click.option("--model", "model_path", type=FILE, help="model.toml: declared values and effects already on")
@click.option("--frozen", is_flag=True, help="keep the model's values as they are; fit effects only")
@click.option(
    "-o",
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    help="folder for diagnosis.json, report.html, model.toml",
)
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
    """Find the effect that the model lacks: writes diagnosis.json, report.html, model.toml.

    LOGS are logs of one array, or one steady table (docs/files.md). Errors are root mean squares in K; evidence is in
    nats, the logarithm of how many times likelier the data are with the effect.
    """
    from . import diagnosis, report, steady
    from .models import model_text, read_model

    check_folder(json_path)
    if frozen and not model_path:
        raise InputError("--frozen needs --model")
    model = read_model(model_path) if model_path else None
    if any(steady.is_steady(path) for path in logs):
        if len(logs) > 1:
            raise InputError("give one steady table, or logs")
        with working("fitting") as say:
            result = steady.diagnose_table(logs[0], model, array_path, frozen, say)
        page, made = report.steady_report(result), steady.model_after(result, model, array_path)
    else:
        array, runs = _array_and_runs(array_path, logs, model)
        with working("fitting") as say:
            found = diagnosis.diagnose(array, runs, model=model, frozen=frozen, progress=say)
            if surrogate:
                say("empirical surrogate")
                found.result["surrogate"] = diagnosis.surrogate(found.problem, found.final)
            say("writing the report")
            page = report.html_report(found)
        result, made = found.result, found.model
    text = checked(result)
    files: dict[Path | None, str] = {
        output / "diagnosis.json": text,
        output / "report.html": page,
        output / "model.toml": model_text(made),
        json_path: text,
    }
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made a folder: {error.strerror}", output) from None
    write(files)
    for note in result["warnings"]:
        if "isolated spike" not in note:
            out.print(f"note: {note}", style="yellow", markup=False)
    if "cases" in result:
        steady.print_result(out, result)
    else:
        _print_diagnosis(result, report.verdict(result))
    out.print(f"-> {output / 'report.html'}", soft_wrap=True)


def _print_diagnosis(result: dict[str, Any], verdict: str) -> None:
    from .report import with_unit

    out.print(verdict, style="bold", markup=False)
    if result["effects"]:
        table = Table("effect", "error, K", "held out, K", "evidence, nats", "numbers", "chip")
        for one in result["effects"]:
            numbers = "\n".join(f"{k} {with_unit(v)}" for k, v in list(one["parameters"].items())[:4])
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
    lines = [
        f"{one['instead_of']} or {one['name']}: these data cannot tell. {one['separating_experiment']}"
        for one in result["rivals"]
    ]
    if result["unexplained"]:
        lines.append(f"unexplained: {result['residual']['note']}")
    lines += [
        f"{one['name']} is not exported: {one['why_not_on_chip']}"
        for one in result["effects"]
        if "why_not_on_chip" in one
    ]
    if "surrogate" in result:
        s = result["surrogate"]
        lines.append(
            "empirical surrogate (not physics, never exported): "
            f"held out {s['holdout_before_c']:.3f} -> {s['holdout_after_c']:.3f} K"
        )
    for line in lines:
        out.print(line, markup=False)


@cli.command(
    epilog="""\b
Examples:
  ninespring predict --model diagnosis/model.toml run3.csv -o predicted.csv
  ninespring predict --chip --model diagnosis/model.toml run3.csv -o predicted.csv
"""
)
@click.argument("log", type=FILE)
@MODEL
@click.option("-o", "--output", type=FILE, required=True, help="log to write: time_s (s), t1_c..tn_c (degC)")
@click.option("--chip", is_flag=True, help="by the on-chip fixed-point model instead of the plant")
@JSON
def predict(log: Path, model_path: Path, output: Path, chip: bool, json_path: Path | None) -> None:
    """Predict the temperatures of a log, and tell the error where it has some.

    The array is the model's; the log needs no temperatures, and starts at the first ones where it has them.
    """
    from . import diagnosis, plausibility
    from .models import read_model

    check_folder(output, json_path)
    model = read_model(model_path)
    array = model.array
    run = read_log(log, array.springs, temperatures=False, why=f"{model_path.name} is of {array.rows} x {array.cols}")
    run.notes += plausibility.swapped([run]) + plausibility.undriven_but_hottest(run)
    _say_notes([run])
    with working("simulating"):
        shown = diagnosis.predict(model, run, chip)
    columns = {f"t{k + 1}_c": shown[:, k] for k in range(run.springs)}
    square = (run.temperature_c - shown) ** 2
    seen = np.isfinite(square)
    rmse = float(np.sqrt(square[seen].mean())) if seen.any() else None
    each = [float(np.sqrt(square[seen[:, k], k].mean())) if seen[:, k].any() else None for k in range(run.springs)]
    note = model.provenance.get("note")
    result = result_of(
        "predict",
        logs=_logs_of([run]),
        model={"file": model_path.name, "sha256": sha256_of(model_path)},
        by="chip" if chip else "plant",
        rows=len(run.time_s),
        rmse_c=rmse,
        rmse_per_spring_c=each,
        **({"note": note} if note else {}),
    )
    write({output: log_text(run.time_s, columns), json_path: checked(result)})
    out.print(f"{len(run.time_s)} rows" + ("" if rmse is None else f", error {rmse:.3f} K rms") + f" -> {output}")
    if note:
        out.print(f"note: {note}", markup=False)


@cli.command(
    epilog="""\b
Example:
  ninespring export --model diagnosis/model.toml -o settings.txt
"""
)
@MODEL
@click.option("-o", "--output", type=FILE, required=True, help="console lines to write, `$name=value`")
@JSON
def export(model_path: Path, output: Path, json_path: Path | None) -> None:
    """Write the console lines that put a model into the chip.

    Effects of the thermometers, of the surroundings and of the supply are left out: the file says why.
    """
    from . import diagnosis
    from .effects import WHY_NOT_ON_CHIP
    from .models import read_model

    check_folder(output, json_path)
    model = read_model(model_path)
    text, message = diagnosis.chip_settings(model)
    left = {e: WHY_NOT_ON_CHIP[e] for e in model.effects if e in WHY_NOT_ON_CHIP}
    settings = dict(line[1:].split("=", 1) for line in text.splitlines())
    result = result_of(
        "export",
        model={"file": model_path.name, "sha256": sha256_of(model_path)},
        settings={name: float(value) for name, value in settings.items()},
        left_out=left,
    )
    head = [f"# from {model_path.name}", *(f"# {e} is left out: {why}" for e, why in left.items())]
    write({output: "\n".join([*head, text]), json_path: checked(result)})
    if message:
        out.print(message, markup=False)
    out.print(f"{len(settings)} settings -> {output} (`ninespring upload` sends them)")


@cli.command(
    "import",
    epilog="""\b
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
)
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--map", "mapping", help="mapping file (TOML) of columns and units, or built in: tclab, tclab-prbs")
@click.option("--regions", type=FILE, help="regions file (TOML) for thermal-camera frames: pixels of each spring")
@click.option(
    "--interval", type=click.FloatRange(min=0, min_open=True), default=1.0, show_default=True, help="s a frame"
)
@click.option(
    "--unit", type=click.Choice(["degC", "degF", "K"]), default="degC", show_default=True, help="of the frames"
)
@click.option("--times", type=FILE, help="times of the frames, s on the log's clock, one a line")
@click.option("--offset", type=float, default=0.0, show_default=True, help="s to add to the frames' times")
@click.option(
    "--statistic",
    type=click.Choice(["mean", "median", "max"]),
    default="mean",
    show_default=True,
    help="of the pixels of a region",
)
@click.option(
    "--log",
    "log_path",
    type=FILE,
    help="log of currents to put the frames' temperatures into; without --times the first frame is at its first row",
)
@click.option("-o", "--output", type=FILE, required=True, help="log to write")
@JSON
def import_(
    source: Path,
    mapping: str | None,
    regions: Path | None,
    interval: float,
    unit: str,
    offset: float,
    times: Path | None,
    statistic: str,
    log_path: Path | None,
    output: Path,
    json_path: Path | None,
) -> None:
    """Make a log of another logger's file (--map) or of thermal-camera frames (--regions).

    SOURCE is a table with a header; or frames: a .npy of (frames, height, width), a .csv, or a folder of .csv.
    """
    from . import importing

    check_folder(output, json_path)
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
            columns = importing.reduce_frames(
                *(source, count, frames, places, statistic), lambda row: say(f"frame {row} of {count}", row), unit
            )
        if log_path:
            text = importing.merge_into_log(log_path, stamps, interval, offset, columns)
        else:
            when = (np.arange(count) * interval if stamps is None else stamps) + offset
            text = log_text(when, columns, {"imported_from": source.name})
    header, *rows = [line for line in text.splitlines() if not line.startswith("#")]
    result = result_of("import", source=source.name, columns=header.split(","), rows=len(rows))
    write({output: text, json_path: checked(result)})
    seen = sum(name.startswith("t") for name in result["columns"][1:])
    out.print(f"{len(rows)} rows, temperatures of {seen} springs -> {output}", soft_wrap=True, markup=False)


add_board_commands(cli)


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
