"""From array.toml to model.toml: field, network, errors, and the network against the field under a random drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..model import native
from ..model.cooling import DIRECTIONS
from ..model.models import Array, Model
from .field import COARSER, MESHES, Mesh, build
from .geometry import Geometry, geometry_of
from .lumped import Lumped, Pairs, lumped_of, pairs_of
from .modes import Modes, reduce_field

PATCH = 3
"""Rows and columns of the field at the most: a larger array repeats what its middle, its sides and its corners do."""
DRIVE_S, STEP_S = 900.0, 1.0
REST_W = 0.45
"""Of a driven spring: between the paper's 0.394 and 0.493 W."""


@dataclass
class Found:
    """What was found of an array."""

    geometry: Geometry
    """Of the field, which may be a part of the array."""
    lumped: Lumped
    mesh_error: dict[str, float]
    still: Modes
    blown: Modes | None
    pairs: Pairs
    pairs_blown: Pairs | None
    drive_error: float
    """Network against field under a random drive of 15 min: rms of the difference over rms of the rise."""
    model: Model


def fields_of(geometry: Geometry, mesh: Mesh) -> tuple[Modes, Modes | None]:
    """Return the field's states, the air still and blown."""
    still = reduce_field(build(geometry, False, mesh))
    return still, reduce_field(build(geometry, True, mesh)) if geometry.cooling.fan_m_per_s > 0 else None


def couplings(array: Array, mesh: str = "normal", say: Callable[[str], object] = lambda _: None) -> Found:
    """Return an array's couplings from its geometry alone."""
    whole = geometry_of(array)
    geometry = replace(whole, rows=min(whole.rows, PATCH), cols=min(whole.cols, PATCH))
    finest = MESHES[mesh]
    say("field")
    still, blown = fields_of(geometry, finest)
    lumped = lumped_of(geometry, still, blown)
    say("the same on a coarser mesh")
    other = lumped_of(geometry, *fields_of(geometry, finest.coarser()))
    # errors fall with the square of the elements' size
    mesh_error = {
        name: abs(value - other.values[name]) / (COARSER**2 - 1) for name, value in lumped.values.items() if value
    }
    say("network against field")
    model = model_of(array, whole, geometry, lumped, mesh_error)
    return Found(
        geometry,
        lumped,
        mesh_error,
        still,
        blown,
        pairs_of(still, geometry.rows, geometry.cols),
        None if blown is None else pairs_of(blown, geometry.rows, geometry.cols),
        drive_error(geometry, model_of(array, geometry, geometry, lumped, mesh_error), still, blown),
        model,
    )


def model_of(array: Array, whole: Geometry, part: Geometry, lumped: Lumped, mesh_error: dict[str, float]) -> Model:
    """Return the model of an array whose field was solved for a part of it."""
    values = dict(lumped.values)
    if "plate_coupling_w_per_k" in values:
        larger = plate_area(whole) / plate_area(part)
        for name in ("plate_heat_capacity_j_per_k", "plate_loss_w_per_k"):
            values[name] *= larger
    effects = [name for name, key in (("plate_conduction", "plate_coupling_w_per_k"),) if key in values]
    if array.stiffness and array.stiffness.get("transformation_shift_k"):
        effects.append("transformation_shift")
    if values["edge_loss_fraction"]:
        effects.append("edge_loss")
    if values.get("wake_w_per_k"):
        effects.append("fan_wake")
        values["wake_direction"] = float(DIRECTIONS.index(whole.cooling.fan_direction))
    if "loss_fan_w_per_k" not in values:
        for name in ("loss", "orthogonal", "diagonal", "second", "series", "stiffness_loss"):
            if f"{name}_w_per_k" in values:
                values[f"{name}_fan_w_per_k"] = values[f"{name}_w_per_k"]
    table = native.parameter_table()
    error_of = {name: float(np.hypot(error, mesh_error.get(name, 0.0))) for name, error in lumped.reduction.items()}
    kept, errors = {}, {}
    for found, value in values.items():
        for name in names_of(found, whole):
            if table[name.partition("[")[0]].effect in (None, *effects):
                kept[name] = value
                if found in error_of:
                    errors[name] = error_of[found]
    shape = replace(array, rows=whole.rows, cols=whole.cols, cooling={})
    note = (
        f"from geometry by a field solution (ninespring couplings): springs alone in still air at "
        f"{whole.cooling.surface_c:g} degC; no measurement went in"
    )
    return Model(shape, effects, kept, errors, {"note": note})


def names_of(found: str, whole: Geometry) -> list[str]:
    """Return the plant's names for a number of the network: what the stiffness layer has of its own, by its springs."""
    if not found.startswith("stiffness_") or found in native.parameter_table():
        return [found]
    n = whole.rows * whole.cols
    return [f"{found.removeprefix('stiffness_')}[{n + k + 1}]" for k in range(n)]


def plate_area(geometry: Geometry) -> float:
    """Return mm2."""
    side = 2 * (geometry.cooling.margin_mm + geometry.radii_mm[-1])
    return ((geometry.cols - 1) * geometry.pitch_mm + side) * ((geometry.rows - 1) * geometry.pitch_mm + side)


def random_drive(springs: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and powers (W), (rows, springs): each spring on and off at times of its own."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, DRIVE_S + STEP_S, STEP_S)
    power = np.zeros((len(time_s), springs))
    for k in range(springs):
        at = rng.uniform(0.0, 60.0)
        while at < DRIVE_S:
            end = at + rng.uniform(30.0, 150.0)
            power[(time_s >= at) & (time_s < end), k] = REST_W * rng.choice([0.5, 0.75, 1.0, 1.0])
            at = end + rng.uniform(30.0, 150.0)
    return time_s, power


def plant_of(model: Model) -> native.Plant:
    """Return the plant of a model, linear: no latent heat."""
    plant = native.Plant(model.array.rows, model.array.cols, model.array.layers)
    plant.set_effects(model.effects)
    plant.set_all(model.parameters)
    plant.reset()
    return plant


def drive_error(geometry: Geometry, model: Model, still: Modes, blown: Modes | None, seed: int = 1) -> float:
    """Return rms of network less field over rms of the field's rise, worst of still and blown."""
    time_s, power = random_drive(geometry.count, seed)
    worst = 0.0
    for fan, modes in ((0.0, still), (1.0, blown)):
        if modes is None:
            continue
        true = modes.simulate(time_s, power)
        plant = plant_of(model)
        ambient = plant.get("ambient_c")
        shown = plant.simulate(time_s, native.POWER, power, np.full(len(time_s), fan), None, true_c=True) - ambient
        worst = max(worst, float(np.sqrt(np.mean((shown - true) ** 2) / np.mean(true**2))))
    return worst
