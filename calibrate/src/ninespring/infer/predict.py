"""What a model.toml predicts of a log: by the plant, or by the on-chip model seen through the same sensors."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError, WorkError
from ..export.settings import settings_of
from ..io import results
from ..io.logs.run import Run
from ..io.statistics import rms_there
from ..model import effects, native
from ..model.models import Model
from ..model.simulate import array_parameters, settles_s, simulate_run
from . import room

LESS = 0.9
"""Of an offset of the room, so much less at the end of a run is told."""


def plant_of(model: Model) -> native.Plant:
    """Return the plant that a model.toml describes."""
    plant = native.Plant(model.array.rows, model.array.cols, model.array.layers)
    plant.set_all(array_parameters(model.array))
    plant.set_effects(model.effects)
    plant.set_all(model.parameters)
    return plant


def chip_lines(model: Model) -> tuple[str, str]:
    """Return the console lines of the on-chip model with a model's numbers, and what was left out; refused at its place."""
    plant = plant_of(model)
    try:
        if why := plant.check():
            raise WorkError(why)
        return native.chip_export(plant)
    except WorkError as error:
        names = [name for name in model.places if re.search(rf"\b{name.partition('[')[0]}\b", str(error))]
        raise InputError(str(error), model.name, *(model.places[names[-1]] if names else ())) from None


def in_its_room(model: Model, run: Run) -> Run:
    """Return a run without an ambient with the one that its first minute tells, one whose room is not where it was logged
    with where it is, one that begins warm with how warm what is around its springs was, and say so; others as they are."""
    if run.room_told:
        return run
    known, plant, notes = model.provenance, plant_of(model), []
    if (usual := known.get("around_share", run.around_share)) != run.around_share:
        run = replace(run, around_share=usual)
    share = usual
    if run.ambient_c is not None:
        if over_k := known.get("room_over_logged_k", 0.0):
            seen_s = known.get("room_over_logged_s", math.inf)
            beside_k = room.beside_log_k(run, over_k, seen_s, settles_s(plant, run.springs))
            said = (
                f"what springs lose heat to is taken to be {abs(over_k):.1f} K {'warmer' if over_k > 0 else 'colder'} than "
                "ambient_c says, as it was in what the model was fitted to"
            )
            if abs(beside_k[-1]) < LESS * abs(over_k):
                said += f"; {abs(beside_k[-1]):.1f} K at the end, as those runs took {seen_s:.0f} s and did not show how long it lasts"
            run, notes = replace(run, ambient_c=run.ambient_c + beside_k), [said]
        share = room.around_of(run, plant, float(run.ambient_c[0]), room.LOGGED_K)
    elif room.begun(run) is not None:
        over = known.get("room_over_first_k"), known.get("room_over_first_sigma_k")
        spread_k, misses_k = known.get("room_spread_k", room.ROOMS_K), known.get("room_first_minute_misses_k", 0.0)
        told = room.Rooms(plant.get("ambient_c"), spread_k, None if None in over else over, misses_k, model.stderr)
        value, sigma, share = told.told(run, plant)
        notes = [f"no ambient_c: by the first minute the room is at {value:.1f} degC (+-{sigma:.1f})"]
        run = replace(run, ambient_c=np.full(len(run.time_s), value))
    if share != run.around_share:
        notes.append(f"it begins warm: by the first minute what is around its springs has {share:.0%} of their warmth")
        run = replace(run, around_share=share)
    return replace(run, notes=[*run.notes, *notes], room_told=True) if notes else run


def predict(model: Model, run: Run, chip: bool = False) -> np.ndarray:
    """Return what the sensors should show, (rows, springs), degC; `chip`: by the on-chip model, seen by the same sensors."""
    run = in_its_room(model, run)
    if chip:
        return predict_by_chip(model, chip_lines(model)[0], run)
    return simulate_run(plant_of(model), run, run.ambient_c)


def predict_by_chip(model: Model, lines: str, run: Run) -> np.ndarray:
    """Return what a chip with these console lines predicts, (rows, springs), degC, seen by the model's sensors."""
    run = in_its_room(model, run)
    plant = plant_of(model)
    shown = simulate_run(plant, run, run.ambient_c)
    # What lag, gain and mixing of the sensors add is the plant's: the chip has none of them.
    plant = plant_of(model)
    plant.set_effects([e for e in model.effects if e not in effects.MEASUREMENT])
    seen_by = shown - simulate_run(plant, run, run.ambient_c)
    return chip_trace(model, lines, run)[0] + seen_by


def chip_trace(model: Model, lines: str, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return temperatures (degC) and austenite, (rows, springs), that a chip with these lines believes along a log."""
    run = in_its_room(model, run)
    plant = plant_of(model)
    ambient = run.ambient_c if run.ambient_c is not None else np.full(len(run.time_s), plant.get("ambient_c"))
    power = np.array([plant.get(f"command_power_w[{k + 1}]") for k in range(run.springs)])
    if run.mode == "command" and (without := np.flatnonzero(power <= 0)).size:
        said = f"the log has only commands, and the model no command_power_w of spring {without[0] + 1}; add it"
        raise InputError(said, model.name)
    temperature, austenite = np.empty_like(run.temperature_c), np.empty_like(run.temperature_c)
    for begin, end in zip(run.starts, [*run.starts[1:], len(run.time_s)], strict=True):
        part = slice(begin, end)
        before = temperature[begin - 1] if begin else np.full(run.springs, ambient[0])
        first = np.where(np.isfinite(run.temperature_c[begin]), run.temperature_c[begin], before)
        temperature[part], austenite[part] = native.chip_simulate(
            lines,
            (model.array.rows, model.array.cols),
            run.time_s[part],
            native.MODES[run.mode],
            run.drive[part],
            power,
            run.fan[part],
            ambient[part],
            first,
        )
    return temperature, austenite


def refuse_seen(model: Model, run: Run) -> None:
    """Refuse a log that a model was fitted to."""
    if any(one.get("sha256") == run.sha256 for one in model.provenance.get("logs", [])):
        raise InputError("the model was fitted to this log: give one that the fit never saw", run.name)


def chip_errors(model: Model, old: str, runs: Sequence[Run]) -> tuple[results.ChipError, results.ChipError]:
    """Return the errors of a chip on logs with the lines `old`, and with a model's settings over them."""
    new = f"{old}\n{settings_of(model).lines}"
    return chip_error(model, old, runs), chip_error(model, new, runs)


def chip_error(model: Model, lines: str, runs: Sequence[Run]) -> results.ChipError:
    """Return the error of a chip with these lines on logs, K rms: of all, and of each spring (None: not measured)."""
    left = np.concatenate([run.temperature_c - predict_by_chip(model, lines, run) for run in runs])
    return results.ChipError(rmse_c=rms_there(left), rmse_per_spring_c=[rms_there(one) for one in left.T])
