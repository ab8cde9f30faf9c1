"""A fit in words for programs: its numbers with errors, and the model.toml that comes of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..io import results, statistics
from ..io.logs.run import Run
from ..model import native
from ..model.models import Model
from . import room
from .fit import Fit
from .problem import Problem

DRIFT_LEFT_OUT = (
    "the ambient drifted during the runs that this was fitted to. The drift belongs to those runs: it is in "
    "diagnosis.json, not in this model, and no prediction has it"
)
"""Why a model.toml is without a drift of several knots: no other log has it, and a log's own is no prediction."""


def parameters_of(problem: Problem, fit: Fit, effect: str | None = None) -> results.Parameters:
    """Return numbers with standard errors and units; of one effect, or those of the declared model."""
    errors = fit.stderr()
    bounds = set(fit.at_bounds())
    out = {}
    for free, value in zip(fit.spec.free, fit.values, strict=True):
        if free.effect != effect:
            continue
        error = errors[free.key]
        one = results.Number(value=float(value), stderr=float(error) if math.isfinite(error) else None, unit=free.unit)
        if free.key in fit.stuck:
            one.note = "the data cannot fix it: held"
        elif free.key in bounds:
            one.note = "at its bound"
        out[free.key] = one
    return out


def as_shown(problem: Problem, fit: Fit) -> list[Run]:
    """Return the runs as hot as both the thermometers and the fit have them: with neither's noise nor overshoot."""
    parts = zip(problem.runs, fit.residual, strict=True)
    return [replace(run, temperature_c=run.temperature_c - np.maximum(0.0, left)) for run, left in parts]


def model_of(
    problem: Problem,
    fit: Fit,
    runs: Sequence[Run],
    rmse_before_c: float | None = None,
    absent: Mapping[str, tuple[float, float]] | None = None,
) -> Model:
    """Return the model.toml of a fit: declared, fixed and fitted numbers, effects, provenance.

    `absent` are numbers (value, error) of effects that are off: the data speak against them.
    """
    table = native.parameter_table()
    model = Model(problem.array)
    model.effects = [e for e in fit.spec.plant_effects if e in native.effect_names()]
    model.parameters = dict(problem.declared) | {k: v for k, v in fit.spec.fixed}
    errors = fit.stderr()
    model.parameters |= fit.spec.settings(fit.values, problem.base_value)
    model.stderr = fit.errors_of_settings()
    constants = [fit.value(f.key) for f in fit.spec.free if f.key.startswith("ambient_c@")]
    rooms = [f.run for f in fit.spec.free if f.key.startswith("ambient_c@") and f.run is not None]
    if constants:
        model.parameters["ambient_c"] = float(np.mean(constants))
    drifts = [k for k, f in enumerate(fit.spec.free) if f.knot is not None]
    if drifts:
        # A drift of these very runs has no place in a model of the array.
        model.effects.remove("ambient_drift")
        for name in ("ambient_amplitude_k", "ambient_ramp_k_per_h"):
            model.parameters.pop(name, None)
    on = {None, *model.effects}
    model.parameters = {k: v for k, v in model.parameters.items() if table[k.partition("[")[0]].effect in on}
    model.stderr = {k: v for k, v in model.stderr.items() if k in model.parameters}
    for name, (value, error) in (absent or {}).items():
        model.parameters[name], model.stderr[name] = value, error
    model.provenance = {
        "logs": [{"file": Path(run.name).name, "sha256": run.sha256} for run in runs],
        "rmse_after_c": statistics.rms(fit.residual),
        "hottest_c": max(float(np.nanmax(run.temperature_c)) for run in runs),
    }
    if (over_k := room.over_logged_k(fit.as_dict(), errors)) is not None:
        model.provenance["room_over_logged_k"] = over_k
        model.provenance["room_over_logged_s"] = max(run.duration_s for run in problem.runs)
    if (share := room.around_share(fit.as_dict())) is not None:
        model.provenance["around_share"] = share
    if rooms:
        told = room.Rooms.of(
            [problem.begun(r, fit.as_dict()) for r in rooms], constants, problem.plant_for(fit.spec, fit.values)
        )
        model.provenance["room_spread_k"] = told.spread_k
        model.provenance["room_first_minute_misses_k"] = told.misses_k
        if told.over:
            model.provenance["room_over_first_k"], model.provenance["room_over_first_sigma_k"] = told.over
    if rmse_before_c is not None:
        model.provenance["rmse_before_c"] = rmse_before_c
    if drifts:
        model.provenance["note"] = DRIFT_LEFT_OUT
    return model
