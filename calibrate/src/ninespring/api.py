"""What `import ninespring as ns` offers beside the board: the commands' work as functions.

A log is given as what `read_log` returned, or as a path; a model as what `fit`, `diagnose` or `read_model` returned, or as
a path. n is the number of rows, k of springs.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from .errors import InputError
from .explore.results import Results
from .explore.spec import read_spec
from .explore.sweep import local_cluster
from .explore.sweep import sweep as run_sweep
from .export.drive import checked_settings
from .export.settings import Settings
from .find import diagnosis, doubt
from .find import plan as planning
from .find.diagnosis import Diagnosis
from .find.plan import Plan
from .infer import predict as prediction
from .io import history, ranges, recording
from .io.board import Board, settings_in
from .io.importing import import_table
from .io.logs import Run, check_folder, read_log, write_atomically
from .io.recording import Recording
from .io.thermometers import measuring
from .model.models import Array, Model, array_of, check_effects, model_text, read_array, read_model
from .say.plotting import figure

Log = Run | str | Path


def _given(given: Any, kind: type, read: Callable[..., Any], words: str, *more: object) -> Any:
    """Return what is given as itself, or as a path that is read."""
    if isinstance(given, str | Path):
        return read(given, *more)
    if not isinstance(given, kind):
        raise InputError(f"{words}, not {given!r}")
    return given


def _model(model: Model | str | Path) -> Model:
    return _given(model, Model, read_model, "a model is wanted, or a path to model.toml")


def _run(log: Log, springs: int | None = None, temperatures: bool = True) -> Run:
    return _given(log, Run, read_log, "a log is wanted, as read_log returns it, or a path", springs, temperatures)


def _array(array: Array | str | Path | None) -> Array | None:
    return None if array is None else _given(array, Array, read_array, "an array is wanted, or a path to array.toml")


def _array_and_runs(
    logs: Sequence[Log], array: Array | str | Path | None, model: Model | None = None
) -> tuple[Array, list[Run]]:
    if not logs:
        raise InputError("no log is given")
    given = model.array if model else _array(array)
    runs = [_run(one, given.springs if given else None) for one in logs]
    return array_of(given, runs), runs


def fit(*logs: Log, effects: Sequence[str] = (), array: Array | str | Path | None = None) -> Model:
    """Fit the declared model, with the effects named, to logs of one array.

    `array` left out: a square (or 1 x 2) of the paper's spring. The model's `parameters` and `stderr` are in the units of
    their names (`heat_capacity_j_per_k`, `loss_w_per_k`, ...); `provenance["rmse_after_c"]` is its error, K rms.
    """
    check_effects(effects)
    declared, runs = _array_and_runs(logs, array)
    problem, chosen, _ = diagnosis.fit_effects(declared, runs, list(dict.fromkeys(effects)), lambda text: None)
    second = diagnosis.by_resistance(problem, chosen, effects)
    return doubt.model_of_fit(problem, chosen, runs, second)[0]


def diagnose(
    *logs: Log, array: Array | str | Path | None = None, model: Model | str | Path | None = None, frozen: bool = False
) -> Diagnosis:
    """Find the effects that the model lacks, in logs of one array.

    `.effects` are their names, strongest first, `.model` the model with them, `.result` what diagnosis.json holds
    (docs/files.md). `model` gives declared values and effects already on, `frozen` keeps its values as they are.
    """
    given = None if model is None else _model(model)
    if frozen and given is None:
        raise InputError("frozen needs a model")
    declared, runs = _array_and_runs(logs, array, given)
    return diagnosis.diagnose(declared, runs, model=given, frozen=frozen)


def predict(model: Model | str | Path, log: Log, chip: bool = False) -> np.ndarray:
    """Return what the sensors should show of a log by a model, (n, k) in degC; `chip`: by the on-chip fixed-point model."""
    model = _model(model)
    run = _run(log, model.array.springs, temperatures=False)
    if run.springs != model.array.springs:
        raise InputError(f"{run.springs} springs, and the model has {model.array.springs}", run.name)
    return prediction.predict(model, run, chip)


def plot(log: Log, model: Model | str | Path | None = None) -> Figure:
    """Return a figure of a log: each spring's temperature and drive; beside it what a model makes of it, dashed."""
    run = _run(log, temperatures=False)
    return figure(run, None if model is None else predict(model, run))


def make_plan(
    array: Array | str | Path | None = None,
    duration_s: float = 900.0,
    current_a: float = 2.0,
    supply_a: float = 14.0,
    hottest_c: float = 105.0,
    seed: int = 1,
    board_alone: bool = False,
) -> Plan:
    """Return the steps of a recording that identifies an array: `ninespring plan`. `.steps` are lines for `record`.

    `current_a` is one spring's at full level, `supply_a` all springs' together, `hottest_c` any spring's as declared.
    """
    return planning.make_plan(_array(array) or Array(), duration_s, current_a, supply_a, hottest_c, seed, board_alone)


def plan_through(model: Model | str | Path, spring: int, supply_a: float = 14.0, hottest_c: float = 105.0) -> Plan:
    """Return the steps that take one spring (from 1) through its transformation: `ninespring plan --through`. A, degC."""
    return planning.plan_through(_model(model), spring, supply_a, hottest_c)


def record(
    port: str,
    output: str | Path,
    duration_s: float = 900.0,
    hz: int = 1,
    steps: Sequence[str] = (),
    thermometers: str | None = None,
    force: bool = False,
) -> Recording:
    """Record a board's telemetry as a log: `ninespring record`. `steps` are lines as of steps.txt; s by the board's clock.

    The springs are off afterwards, whatever ends it; `.ended` says why where that was nobody's wish. A log that is there is
    kept (InputError) unless `force`.
    """
    ranges.RECORD_S.check("duration_s", duration_s)
    ranges.RECORD_HZ.check("hz", hz)
    script = recording.script_lines("\n".join(steps), "steps", duration_s)
    with (
        contextlib.closing(recording.LogFile(Path(output), force)) as log,
        Board(port, off_at_end=False) as board,
        measuring(thermometers) as logger,
    ):
        return recording.record(board, log, hz, duration_s, script, keys=recording.about(port), thermometers=logger)


def import_log(table: str | Path, mapping: str | Path, output: str | Path, force: bool = False) -> Run:
    """Make a log of another logger's table by a mapping (a path, or built in: 'tclab'): `ninespring import --map`. Return it."""
    check_folder(Path(output), measured=True, force=force)
    write_atomically({Path(output): import_table(Path(table), str(mapping))}, force)
    return read_log(output, temperatures=False)


def chip_settings(model: Model | str | Path, force: bool = False) -> Settings:
    """Return what `ninespring export` writes of a model: `.lines` for `upload`, `.kept` what stays as the chip has it, and why.

    WorkError where the log was doubted or the settings would drive worse than the firmware's, unless `force`.
    """
    return checked_settings(_model(model), "", force)[0]


def upload(port: str, settings: str) -> int:
    """Send console lines (`chip_settings(model).lines`) to a board, read them back, save them: `ninespring upload`.

    Return how many. WorkError, and nothing is saved, where the board refuses one or shows another value. What was saved can be
    taken back: `undo_upload`. Where springs are warm a drive may end in fault 9: `Board.cool` waits.
    """
    given = settings_in(settings, "settings")
    with Board(port, off_at_end=False) as board:
        history.send(board, given, "ns.upload")
    return len(given)


def undo_upload(port: str) -> list[str]:
    """Give a board back what it had before the last upload from this computer: `ninespring upload --undo`. Return what changed."""
    with Board(port, off_at_end=False) as board:
        return history.undo(board).words()


def verify(model: Model | str | Path, log: Log, before: str = "") -> tuple[float, float]:
    """Return the chip's error on a log that the fit never saw, K rms: with the lines `before`, and with the model's over them.

    `before`: console lines that the board has; left out, the firmware's defaults. `ninespring verify`.
    """
    model = _model(model)
    run = _run(log, model.array.springs)
    prediction.refuse_seen(model, run)
    old, new = prediction.chip_errors(model, before, [run])
    return old.rmse_c, new.rmse_c


def replay(model: Model | str | Path, log: Log) -> tuple[np.ndarray, np.ndarray]:
    """Return temperatures (n, k), degC, and austenite (n, k), 0..1, that the on-chip model believes along a log."""
    model = _model(model)
    run = _run(log, model.array.springs, temperatures=False)
    return prediction.chip_trace(model, prediction.chip_lines(model)[0], run)


def sweep(spec: str | Path, output: str | Path, workers: int = 1) -> pd.DataFrame:
    """Run a sweep's points (docs/exploring.md) on this machine into a folder, and return them: `ninespring sweep`."""
    from distributed import Client

    ranges.WORKERS.check("workers", workers)
    wanted = read_spec(Path(spec))
    results = Results(Path(output), wanted)
    done = results.open()
    if not done.all():
        with local_cluster(workers) as where, Client(where) as client:
            run_sweep(client, wanted, results, done, lambda count: None)
    return results.read()


def save(model: Model, path: str | Path) -> None:
    """Write a model as model.toml, for `export`, `predict` and the chip."""
    write_atomically({Path(path): model_text(_model(model))})
