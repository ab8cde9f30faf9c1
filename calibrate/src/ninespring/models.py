"""array.toml (what was built) and model.toml (what was fitted): reading, checking, writing (docs/files.md).

Names, units and limits of parameters are the plant's own table (`native.parameter_table`).
"""

from __future__ import annotations

import datetime
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import __version__, native
from .toml_file import At, TomlFile, did_you_mean

SCHEMA = "ninespring.model/1"
TABLES = ("array", "spring", "material", "sensor")
ERRORS = ("rmse_before_c", "rmse_after_c", "hottest_c")
SPRING_KEYS = {
    "wire_diameter_mm": (0.01, 10.0),
    "coil_diameter_mm": (0.1, 100.0),
    "turns": (0.1, 1000.0),
    "wire_length_mm": (1.0, 10000.0),
}
MATERIAL_KEYS = {
    "density_kg_per_m3": (500.0, 20000.0),
    "heat_capacity_j_per_kgk": (50.0, 5000.0),
    "latent_heat_j_per_kg": (0.0, 100000.0),
    "resistivity_martensite_uohm_cm": (1.0, 1000.0),
    "resistivity_austenite_uohm_cm": (1.0, 1000.0),
    "martensite_finish_c": (-50.0, 200.0),
    "martensite_start_c": (-50.0, 200.0),
    "austenite_start_c": (-50.0, 200.0),
    "austenite_finish_c": (-50.0, 200.0),
    "emissivity": (0.0, 1.0),
}


@dataclass
class Array:
    """What was built: shape, spring, material, sensor. Tables hold only what the file gives."""

    rows: int = 3
    cols: int = 3
    pitch_mm: float | None = None
    spring: dict[str, float] = field(default_factory=dict)
    material: dict[str, float] = field(default_factory=dict)
    sensor: dict[str, Any] = field(default_factory=dict)

    @property
    def springs(self) -> int:
        """Number of springs."""
        return self.rows * self.cols


@dataclass
class Model:
    """A model: array, effects that are on, parameters by the plant's names (`name` or `name[k]`)."""

    array: Array
    effects: list[str] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    stderr: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    name: str = ""
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Line and column of each parameter's value, where the model was read from a file."""

    def __repr__(self) -> str:
        effects = ", ".join(self.effects) or "no effects"
        return f"<model of {self.array.rows} x {self.array.cols}: {effects}; {len(self.parameters)} parameters>"


def _array(file: TomlFile) -> Array:
    if file.get(("array",)) is None:
        raise file.refuse("there is no [array] table; add rows and cols", ())
    file.table(("array",), ("rows", "cols", "pitch_mm"))
    array = Array(*(file.whole(("array", key), 1, native.MAX_SPRINGS) for key in ("rows", "cols")))
    if array.springs > native.MAX_SPRINGS:
        raise file.refuse(f"{array.rows} x {array.cols} are more than {native.MAX_SPRINGS} springs", ("array", "cols"))
    if file.get(("array", "pitch_mm")) is not None:
        array.pitch_mm = file.number(("array", "pitch_mm"), 0.1, 1000.0)
    for name, keys in (("spring", SPRING_KEYS), ("material", MATERIAL_KEYS)):
        given = file.table((name,), keys)
        getattr(array, name).update({key: file.number((name, key), *keys[key]) for key in given})
    array.sensor = dict(file.table(("sensor",), ("kind", "noise_c")))
    if "kind" in array.sensor:
        file.text_at(("sensor", "kind"))
    if "noise_c" in array.sensor:
        file.number(("sensor", "noise_c"), 0.0, 50.0)
    return array


def read_array(path: str | Path) -> Array:
    """Read array.toml; refused with file, line and column where it breaks docs/files.md."""
    file = TomlFile(path)
    file.table((), TABLES)
    return _array(file)


def read_model(path: str | Path) -> Model:
    """Read model.toml; refused with file, line and column where it breaks docs/files.md."""
    file = TomlFile(path)
    file.table((), ("schema", *TABLES, "effects", "parameter", "provenance"))
    if (schema := file.text_at(("schema",))) != SCHEMA:
        raise file.refuse(f"schema is '{schema}'; this version reads \"{SCHEMA}\"", ("schema",))
    model = Model(_array(file), name=str(path))
    for at in file.tables(("effects",)):
        name = file.get(at)
        if name not in native.effect_names():
            said = f"there is no effect '{name}'{did_you_mean(str(name), native.effect_names())}"
            raise file.refuse(said, ("effects",), word=str(name))
        if name in model.effects:
            raise file.refuse(f"effect {name} appears twice; remove one", ("effects",), word=str(name))
        model.effects.append(name)
    for at in file.tables(("parameter",)):
        _read_parameter(file, at, model)
    _check_provenance(file)
    model.provenance = dict(file.data.get("provenance", {}))
    return model


def _read_parameter(file: TomlFile, at: At, model: Model) -> None:
    entry = file.table(at, ("name", "value", "unit", "stderr", "spring", "effect"))
    name, table = file.text_at((*at, "name")), native.parameter_table()
    if name not in table:
        raise file.refuse(f"there is no parameter '{name}'{did_you_mean(name, table)}", (*at, "name"))
    known = table[name]
    value = file.number((*at, "value"), known.minimum, known.maximum, name)
    if (unit := file.text_at((*at, "unit"))) != known.unit:
        raise file.refuse(f"{name} is in '{known.unit}', not in '{unit}'; convert the value", (*at, "unit"))
    if "effect" in entry and entry["effect"] != known.effect:
        raise file.refuse(f"{name} belongs to {known.effect or 'no effect'}; remove or correct effect", (*at, "effect"))
    full = name
    if "spring" in entry:
        spring = file.whole((*at, "spring"), 1, model.array.springs)
        if not known.per_spring:
            raise file.refuse(f"{name} is of the whole array; remove spring", (*at, "spring"))
        full = f"{name}[{spring}]"
    if full in model.parameters:
        raise file.refuse(f"parameter {full} appears twice; remove one", (*at, "value"))
    model.parameters[full] = value
    model.places[full] = file.place((*at, "value"))
    if "stderr" in entry:
        model.stderr[full] = file.number((*at, "stderr"), 0.0, 1e12, f"{name} stderr")


def _check_provenance(file: TomlFile) -> None:
    given = file.table(("provenance",), ("tool", "date", "logs", *ERRORS, "note"))
    for key in given:
        if key in ERRORS:
            file.number(("provenance", key), -100.0, 1e6)
        elif key != "logs":
            file.text_at(("provenance", key))
    for at in file.tables(("provenance", "logs")):
        file.table(at, ("file", "sha256"))
        file.text_at((*at, "file"))
        file.text_at((*at, "sha256"))


def _value(number: float) -> str:
    text = f"{number:.7g}"
    return text if any(c in text for c in ".en") else f"{text}.0"


def model_text(model: Model) -> str:
    """Return model.toml as text: what `read_model` and the host tools read."""
    lines = [f'schema = "{SCHEMA}"']
    lines.append(f"effects = [{', '.join(json.dumps(e) for e in model.effects)}]")
    array = model.array
    lines += ["", "[array]", f"rows = {array.rows}", f"cols = {array.cols}"]
    if array.pitch_mm is not None:
        lines.append(f"pitch_mm = {_value(array.pitch_mm)}")
    for name in ("spring", "material", "sensor"):
        part = getattr(array, name)
        if part:
            lines += ["", f"[{name}]"]
            lines += [f"{key} = {json.dumps(v) if isinstance(v, str) else _value(v)}" for key, v in part.items()]
    table = native.parameter_table()
    for full, value in model.parameters.items():
        name, _, rest = full.partition("[")
        known = table[name]
        lines += ["", "[[parameter]]", f'name = "{name}"']
        if rest:
            lines.append(f"spring = {int(rest[:-1])}")
        lines += [f"value = {_value(value)}", f'unit = "{known.unit}"']
        if full in model.stderr:
            lines.append(f"stderr = {_value(model.stderr[full])}")
        if known.effect:
            lines.append(f'effect = "{known.effect}"')
    made = {
        "tool": f"ninespring {__version__}",
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    } | model.provenance
    lines += ["", "[provenance]"]
    for key in ("tool", "date", "note"):
        if key in made:
            lines.append(f"{key} = {json.dumps(made[key])}")
    for key in ERRORS:
        if made.get(key) is not None:
            lines.append(f"{key} = {_value(made[key])}")
    for log in made.get("logs", []):
        lines += ["", "[[provenance.logs]]", f"file = {json.dumps(log['file'])}"]
        lines.append(f'sha256 = "{log["sha256"]}"')
    return "\n".join(lines) + "\n"
