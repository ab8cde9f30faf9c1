"""array.toml (what was built) and model.toml (what was fitted): reading, checking, writing (docs/files.md).

Names, units and limits of parameters are the plant's own table (`native.parameter_table`).
"""

from __future__ import annotations

import datetime
import difflib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import __version__, native
from .errors import InputError
from .explore import cooling
from .importing import line_of, read_toml

SCHEMA = "ninespring.model/1"
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
    cooling: dict[str, Any] = field(default_factory=dict)
    """What `ninespring couplings` reckons with; nothing else looks at it, and no model keeps it."""

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

    def __repr__(self) -> str:
        effects = ", ".join(self.effects) or "no effects"
        return f"<model of {self.array.rows} x {self.array.cols}: {effects}; {len(self.parameters)} parameters>"


class _Reader:
    def __init__(self, path: str | Path) -> None:
        self.path = path
        self.data = read_toml(path)

    def refuse(self, message: str, near: str) -> InputError:
        return InputError(message, self.path, line_of(self.path, near) or 1, 1)

    def known(self, table: dict[str, Any], names: Any, where: str) -> None:
        for key in table:
            if key not in names:
                close = difflib.get_close_matches(key, list(names), 1)
                hint = f" (did you mean {close[0]}?)" if close else ""
                raise self.refuse(f"{where} has no key '{key}'{hint}; it has {', '.join(names)}", key)

    def number(self, table: dict[str, Any], key: str, low: float, high: float, where: str) -> float:
        value = table[key]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refuse(f"{where} {key} must be a number, without quotes", key)
        if not low <= value <= high:
            raise self.refuse(f"{where} {key} is {value:g}; it must be {low:g} to {high:g}", key)
        return float(value)

    def array(self) -> Array:
        table = self.data.get("array")
        if not isinstance(table, dict):
            raise InputError("there is no [array] table; add rows and cols", self.path, 1, 1)
        self.known(table, ("rows", "cols", "pitch_mm"), "[array]")
        for key in ("rows", "cols"):
            if key not in table:
                raise self.refuse(f"[array] is without {key}; add it", "[array]")
            if isinstance(table[key], bool) or not isinstance(table[key], int):
                raise self.refuse(f"[array] {key} must be a whole number", key)
            if not 1 <= table[key] <= native.MAX_SPRINGS:
                raise self.refuse(f"[array] {key} must be 1 to {native.MAX_SPRINGS}", key)
        array = Array(table["rows"], table["cols"])
        if array.springs > native.MAX_SPRINGS:
            raise self.refuse(f"{array.rows} x {array.cols} are more than {native.MAX_SPRINGS} springs", "rows")
        if "pitch_mm" in table:
            array.pitch_mm = self.number(table, "pitch_mm", 0.1, 1000.0, "[array]")
        for name, keys in (("spring", SPRING_KEYS), ("material", MATERIAL_KEYS)):
            part = self.data.get(name, {})
            if not isinstance(part, dict):
                raise self.refuse(f"[{name}] must be a table", name)
            self.known(part, keys, f"[{name}]")
            getattr(array, name).update({key: self.number(part, key, *keys[key], f"[{name}]") for key in part})
        sensor = self.data.get("sensor", {})
        self.known(sensor, ("kind", "noise_c"), "[sensor]")
        if "noise_c" in sensor:
            self.number(sensor, "noise_c", 0.0, 50.0, "[sensor]")
        array.sensor = dict(sensor)
        array.cooling = self.cooling()
        return array

    def cooling(self) -> dict[str, Any]:
        """Return the checked `[cooling]` table (explore/cooling.py)."""
        part = self.data.get("cooling", {})
        if not isinstance(part, dict):
            raise self.refuse("[cooling] must be a table", "cooling")
        self.known(part, cooling.KEYS, "[cooling]")
        out: dict[str, Any] = {}
        for key, value in part.items():
            if key in cooling.NUMBERS:
                out[key] = self.number(part, key, *cooling.NUMBERS[key], "[cooling]")
                continue
            if value not in cooling.WORDS[key]:
                close = difflib.get_close_matches(str(value), cooling.WORDS[key], 1)
                hint = f" (did you mean {close[0]}?)" if close else ""
                raise self.refuse(
                    f"[cooling] {key} has no '{value}'{hint}; it has {', '.join(cooling.WORDS[key])}", key
                )
            out[key] = value
        return out


def read_array(path: str | Path) -> Array:
    """Read array.toml; refused with file and line where it breaks docs/files.md."""
    reader = _Reader(path)
    reader.known(reader.data, ("array", "spring", "material", "sensor", "cooling"), "the file")
    return reader.array()


def read_model(path: str | Path) -> Model:
    """Read model.toml; refused with file and line where it breaks docs/files.md."""
    reader = _Reader(path)
    reader.known(
        reader.data,
        ("schema", "array", "spring", "material", "sensor", "effects", "parameter", "provenance"),
        "the file",
    )
    if reader.data.get("schema") != SCHEMA:
        raise reader.refuse(
            f"schema is '{reader.data.get('schema', '')}'; this version reads \"{SCHEMA}\"",
            "schema",
        )
    model = Model(reader.array(), name=str(path))
    names = native.effect_names()
    for effect in reader.data.get("effects", []):
        if effect not in names:
            close = difflib.get_close_matches(str(effect), names, 1)
            hint = f" (did you mean {close[0]}?)" if close else ""
            raise reader.refuse(f"there is no effect '{effect}'{hint}", str(effect))
        model.effects.append(effect)
    table = native.parameter_table()
    for entry in reader.data.get("parameter", []):
        reader.known(entry, ("name", "value", "unit", "stderr", "spring", "effect"), "[[parameter]]")
        name = entry.get("name", "")
        if name not in table:
            close = difflib.get_close_matches(name, list(table), 1)
            hint = f" (did you mean {close[0]}?)" if close else ""
            raise reader.refuse(f"there is no parameter '{name}'{hint}", f'"{name}"')
        known = table[name]
        if "value" not in entry:
            raise reader.refuse(f"parameter {name} is without value; add it", f'"{name}"')
        value = reader.number(entry, "value", known.minimum, known.maximum, name)
        if entry.get("unit", known.unit) != known.unit:
            raise reader.refuse(
                f"{name} is in '{known.unit}', not in '{entry['unit']}'; convert the value",
                f'"{name}"',
            )
        full = name
        if "spring" in entry:
            if not known.per_spring:
                raise reader.refuse(f"{name} is of the whole array; remove spring", f'"{name}"')
            if not 1 <= entry["spring"] <= model.array.springs:
                raise reader.refuse(f"{name}: there is no spring {entry['spring']}", f'"{name}"')
            full = f"{name}[{entry['spring']}]"
        if full in model.parameters:
            raise reader.refuse(f"parameter {full} appears twice; remove one", f'"{name}"')
        model.parameters[full] = value
        if "stderr" in entry:
            model.stderr[full] = reader.number(entry, "stderr", 0.0, 1e12, name)
    model.provenance = dict(reader.data.get("provenance", {}))
    return model


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
    for key in ("rmse_before_c", "rmse_after_c", "hottest_c"):
        if made.get(key) is not None:
            lines.append(f"{key} = {_value(made[key])}")
    for log in made.get("logs", []):
        lines += ["", "[[provenance.logs]]", f"file = {json.dumps(log['file'])}"]
        lines.append(f'sha256 = "{log["sha256"]}"')
    return "\n".join(lines) + "\n"
