"""One point of a sweep: one deterministic native run of controller and plant, and what is kept of it."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError, WorkError
from ..model import native
from ..model.models import Array
from ..model.simulate import array_parameters, board_settings
from .couplings import couplings
from .spec import METRICS, Spec, array_of_point, board_of_point, patterns_of

STARTED = 0.95
"""Austenite from which a driven spring has moved."""
BACK = 0.05
"""Austenite below which it is back."""
ALWAYS = ("latent_heat", "resistance_phase")
"""What every NiTi spring does."""


@functools.lru_cache(maxsize=256)
def _field(described: str, mesh: str) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return effects and parameters of an array's geometry; each process reckons a geometry once."""
    given = json.loads(described)
    model = couplings(Array(**given), mesh).model
    return tuple(model.effects), model.parameters


def plant_of_point(spec: Spec, point: Mapping[str, Any]) -> native.Plant:
    """Return the plant as it is declared."""
    array = array_of_point(point)
    plant = native.Plant(array.rows, array.cols, array.layers)
    plant.set("ambient_c", float(point.get("ambient_c", 20.0)))
    effects: tuple[str, ...] = ()
    if spec.couplings == "law":
        native.paper_configure(plant, array.pitch_mm or 5.0)
        plant.set_all(array_parameters(array))
    else:
        described: dict[str, Any] = {"rows": array.rows, "cols": array.cols, "pitch_mm": array.pitch_mm}
        described |= {"spring": array.spring, "material": array.material, "cooling": array.cooling}
        described |= {"stiffness": array.stiffness}
        plant.set_all(array_parameters(array))
        effects, parameters = _field(json.dumps(described, sort_keys=True), spec.mesh)
        plant.set_all(parameters)
    plant.set_effects((*ALWAYS, *effects))
    return plant


def real_of(plant: native.Plant, point: Mapping[str, Any], rng: np.random.Generator) -> native.Plant:
    """Return the plant that was built: springs differ as far as the tolerances say."""
    tolerance = float(point.get("tolerance", 0.0))
    spread_k = float(point.get("transformation_spread_k", 0.0))
    real = plant.copy()
    drawn = rng.normal(size=(4, plant.springs))
    if tolerance == 0.0 and spread_k == 0.0:
        return real
    on = [name for k, name in enumerate(native.effect_names()) if plant._lib.plant_effect_is_on(plant._plant, k)]
    real.set_effects({*on, "spring_mismatch", "transformation_shift"})
    for k in range(plant.springs):
        for row, name in enumerate(("loss_scale", "heat_capacity_scale", "resistance_scale")):
            real.set(f"{name}[{k + 1}]", float(np.clip(1.0 + tolerance * drawn[row, k], 0.3, 3.0)))
        shift_k = plant.get(f"transformation_shift_k[{k + 1}]") + spread_k * drawn[3, k]
        real.set(f"transformation_shift_k[{k + 1}]", float(np.clip(shift_k, -40.0, 40.0)))
    return real


def pattern_of(point: Mapping[str, Any], array: Array, rng: np.random.Generator) -> np.ndarray:
    """Return which springs are driven, (springs,)."""
    return np.concatenate([_layer_pattern(one, array.rows, array.cols, rng) for one in patterns_of(point, array)])


def _layer_pattern(wanted: str, rows: int, cols: int, rng: np.random.Generator) -> np.ndarray:
    row, col = np.divmod(np.arange(rows * cols), cols)
    middle = (row == rows // 2) & (col == cols // 2)
    if wanted[0] in "01":
        return np.array([one == "1" for one in wanted])
    if wanted == "random":
        return rng.random(rows * cols) < 0.5
    if wanted == "checkerboard":
        return (row + col) % 2 == 0
    if wanted == "middle" or (wanted == "all_but_middle" and rows * cols == 1):
        return middle
    return ~middle if wanted == "all_but_middle" else np.full(rows * cols, wanted == "all")


def settings_of(point: Mapping[str, Any]) -> str:
    """Return a board's console lines besides its model."""
    lines = [f"$policy={int(point.get('policy', 'precompensate') == 'precompensate')}"]
    lines += [f"${name}={value:.3f}" for name, value in board_settings(array_of_point(point)).items()]
    lines += [
        f"${name}={point[name]:.3f}"
        for name in ("supply_limit_a", "boost_current_a", "open_current_a")
        if name in point
    ]
    return "\n".join([*lines, ""])


def run_point(spec: Spec, index: int, point: Mapping[str, Any]) -> dict[str, Any]:
    """Run one point; return its row: point, seed, what was varied, metrics (NaN where there is none), error."""
    seed = int(np.random.SeedSequence([spec.seed, index]).generate_state(1)[0])
    out: dict[str, Any] = {"point": index, "seed": seed} | {axis.key: point[axis.key] for axis in spec.axes}
    try:
        return out | metrics_of(spec, point, seed) | {"error": ""}
    except (InputError, WorkError, native.NativeError) as error:
        return out | dict.fromkeys(METRICS, math.nan) | {"error": str(error)}


def metrics_of(spec: Spec, point: Mapping[str, Any], seed: int) -> dict[str, float]:
    """Run a point by its seed; return its metrics (UNITS in spec.py)."""
    rng = np.random.default_rng(seed)
    declared = plant_of_point(spec, point)
    array = array_of_point(point)
    board = board_of_point(point, array)
    lines = [
        native.chip_export(declared, part)[0] + settings_of({**point, **spec.boards.get(number, {})})
        for number, part in enumerate(native.boards_of(array.rows, array.cols, *board, array.layers), 1)
    ]
    real = real_of(declared, point, rng)
    real.reset()
    pattern = pattern_of(point, array, rng)
    fan = float(point.get("fan", 0.0))
    on = spec.on_s
    t, x, power, current, faults = native.chip_run(real, board, lines, list(pattern), fan, seed, spec.duration_s, on)
    out = dict.fromkeys(METRICS, math.nan)
    out |= {"hottest_c": float(t.max()), "energy_j": float(power.sum()), "supply_a": float(current.max())}
    out["faults"] = float(faults)
    out["hold_w"] = float(power[3 * on // 4 : on].mean())
    if pattern.any():
        moved = x[:on, pattern] >= STARTED
        out["started"] = float(moved.any(axis=0).mean())
        if moved.any(axis=0).all():
            out["start_s"] = float(moved.argmax(axis=0).max() + 1)
        back = (x[on:, pattern] <= BACK).all(axis=1)
        if back.any() and out["started"]:
            out["cool_s"] = float(back.argmax() + 1)
        out["pictures_per_min"] = 60.0 / (out["start_s"] + out["cool_s"])
    if not pattern.all():
        out["undriven_c"] = float(t[:, ~pattern].max())
        out["undriven_austenite"] = float(x[:, ~pattern].max())
    return out
