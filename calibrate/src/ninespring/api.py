"""What `import ninespring as ns` offers beside the board: the commands' work as functions.

A log is given as what `read_log` returned, or as a path; a model as what `fit`, `diagnose` or `read_model` returned, or as
a path. n is the number of rows, k of springs. Heavy imports happen when a function is called.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError
from .logs import Run, read_log, write_atomically
from .models import Array, Model, model_text, read_array, read_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .verdict.diagnosis import Diagnosis

Log = Run | str | Path


def _model(model: Model | str | Path) -> Model:
    return model if isinstance(model, Model) else read_model(model)


def _array_and_runs(
    logs: Sequence[Log], array: Array | str | Path | None, model: Model | None = None
) -> tuple[Array, list[Run]]:
    from .console import array_of

    if not logs:
        raise InputError("no log is given")
    given = model.array if model else array if isinstance(array, Array) or array is None else read_array(array)
    runs = [one if isinstance(one, Run) else read_log(one, given.springs if given else None) for one in logs]
    return array_of(given, runs), runs


def fit(*logs: Log, effects: Sequence[str] = (), array: Array | str | Path | None = None) -> Model:
    """Fit the declared model, with the effects named, to logs of one array.

    `array` left out: a square (or 1 x 2) of the paper's spring. The model's `parameters` and `stderr` are in the units of
    their names (`heat_capacity_j_per_k`, `loss_w_per_k`, ...); `provenance["rmse_after_c"]` is its error, K rms.
    """
    from . import native
    from .verdict import diagnosis, doubt

    for name in effects:
        if name not in native.effect_names():
            raise InputError(f"there is no effect '{name}': {', '.join(native.effect_names())}")
    declared, runs = _array_and_runs(logs, array)
    problem, chosen, _ = diagnosis.fit_effects(declared, runs, list(dict.fromkeys(effects)), lambda text: None)
    return doubt.model_of_fit(problem, chosen, runs)[0]


def diagnose(
    *logs: Log,
    array: Array | str | Path | None = None,
    model: Model | str | Path | None = None,
    frozen: bool = False,
) -> Diagnosis:
    """Find the effects that the model lacks, in logs of one array.

    `.effects` are their names, strongest first, `.model` the model with them, `.result` what diagnosis.json holds
    (docs/files.md). `model` gives declared values and effects already on, `frozen` keeps its values as they are.
    """
    from .verdict import diagnosis

    given = None if model is None else _model(model)
    if frozen and given is None:
        raise InputError("frozen needs a model")
    declared, runs = _array_and_runs(logs, array, given)
    return diagnosis.diagnose(declared, runs, model=given, frozen=frozen)


def predict(model: Model | str | Path, log: Log, chip: bool = False) -> np.ndarray:
    """Return what the sensors should show of a log by a model, (n, k) in degC; `chip`: by the on-chip fixed-point model."""
    from .fit import predict as prediction

    model = _model(model)
    run = log if isinstance(log, Run) else read_log(log, model.array.springs, temperatures=False)
    if run.springs != model.array.springs:
        raise InputError(f"{run.springs} springs, and the model has {model.array.springs}", run.name)
    return prediction.predict(model, run, chip)


def plot(log: Log, model: Model | str | Path | None = None) -> Figure:
    """Return a figure of a log: each spring's temperature and drive; beside it what a model makes of it, dashed."""
    from .plotting import figure

    run = log if isinstance(log, Run) else read_log(log, temperatures=False)
    return figure(run, None if model is None else predict(model, run))


def save(model: Model, path: str | Path) -> None:
    """Write a model as model.toml, for `export`, `predict` and the chip."""
    write_atomically({Path(path): model_text(model)})
