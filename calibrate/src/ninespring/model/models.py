"""array.toml (what was built) and model.toml (what was fitted): reading, checking, writing (docs/files.md).

Names, units and limits of parameters are the plant's own table (`native.parameter_table`).
"""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import InputError
from ..io.logs import Run
from ..io.toml_file import At, Keys, TomlFile, did_you_mean, number, table, whole
from . import cooling, native, stiffness

SCHEMA = "ninespring.model/1"
ROOMS = (
    "room_over_logged_k",
    "room_over_logged_s",
    "around_share",
    "room_spread_k",
    "room_over_first_k",
    "room_over_first_sigma_k",
    "room_first_minute_misses_k",
)
ERRORS = ("rmse_before_c", "rmse_after_c", "hottest_c", *ROOMS)
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
STIFFNESS_KEYS = SPRING_KEYS | {key: MATERIAL_KEYS[key] for key in stiffness.MATERIAL} | stiffness.NUMBERS
"""Of `[stiffness]`: its numbers."""
COUPLED = ("orthogonal_", "diagonal_", "second_", "wake_w")
"""What the stiffness layer has times `stiffness_coupling_scale`."""
BOARD_KEYS = {"supply_limit_a": (0.1, 60.0), "boost_current_a": (0.1, 3.2), "open_current_a": (0.0, 3.2)}
"""Of `[board.K]`: settings of the chip, within its limits."""

_SHAPE = {key: whole(1, native.MAX_SPRINGS) for key in ("rows", "cols")}
_BOARD_SHAPE = {key: whole(1, native.BOARD_SPRINGS) for key in ("board_rows", "board_cols")}
TABLES = {
    "array": Keys({"pitch_mm": number(0.1, 1000.0), **_BOARD_SHAPE}, _SHAPE),
    "spring": table(SPRING_KEYS),
    "material": table(MATERIAL_KEYS),
    "sensor": Keys({"kind": str, "noise_c": number(0.0, 50.0)}),
    "stiffness": table(STIFFNESS_KEYS, stiffness.WORDS),
    "board": Keys(each=table(BOARD_KEYS)),
}
"""What array.toml and model.toml say of an array."""
_PARAMETER = Keys(
    {"stderr": number(0.0, 1e12), "spring": whole(1, native.MAX_SPRINGS), "effect": str, "kept": str},
    {"name": str, "value": float, "unit": str},
)
_PROVENANCE = Keys(
    {
        **{key: str for key in ("tool", "date", "note")},
        **{key: number(-100.0, 1e6) for key in ERRORS},
        "around_share": number(0.0, 1.0),
        "doubts": [str],
        "logs": [Keys(must={"file": str, "sha256": str})],
    }
)
MODEL = Keys(TABLES | {"effects": [str], "parameter": [_PARAMETER], "provenance": _PROVENANCE}, {"schema": str})


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
    stiffness: dict[str, Any] | None = None
    """What the springs of the stiffness layer have of their own; None: there is no such layer."""
    board: tuple[int, int] | None = None
    """Rows and columns of springs of a board; None: all of a layer."""
    boards: dict[int, dict[str, float]] = field(default_factory=dict)
    """What board k (from 1) has of its own."""

    @property
    def layers(self) -> int:
        """1, or 2 with a stiffness layer: spring k's is spring k + rows x cols."""
        return 1 if self.stiffness is None else 2

    @property
    def springs(self) -> int:
        """Number of springs, in all layers."""
        return self.layers * self.rows * self.cols

    def one_layer(self, who: str) -> None:
        """Refuse a stiffness layer where only one is known."""
        if self.layers > 1:
            raise InputError(
                f"a stiffness layer, but {who} one layer, as a board has: give that board's log, "
                "and an array or model without [stiffness]"
            )

    def one_board(self, who: str) -> None:
        """Refuse a layer on several boards where only one board is known."""
        if (boards := len(self.parts) // self.layers) > 1:
            rows, cols = self.board or (self.rows, self.cols)
            raise InputError(
                f"an array on {boards} boards, but {who} one, whose log and settings count its springs from 1: describe each "
                f"board's springs as an array of their own, without board_rows (rows = {rows}, cols = {cols})"
            )

    def of_layer(self, layer: str) -> Array:
        """Return one layer alone: its springs, where `[stiffness]` says nothing those above; nothing of the other."""
        own = (self.stiffness or {}) if stiffness.LAYERS.index(layer) else {}
        return Array(
            self.rows,
            self.cols,
            self.pitch_mm,
            self.spring | {key: own[key] for key in SPRING_KEYS if key in own},
            self.material | {key: own[key] for key in stiffness.MATERIAL if key in own},
            self.sensor,
            board=self.board,
        )

    @property
    def parts(self) -> list[native.Part]:
        """Springs of each board."""
        return native.boards_of(self.rows, self.cols, *(self.board or (self.rows, self.cols)), self.layers)


@dataclass
class Model:
    """A model: array, effects that are on, parameters by the plant's names (`name` or `name[k]`)."""

    array: Array
    effects: list[str] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    stderr: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    kept: dict[str, str] = field(default_factory=dict)
    """Parameters that `export` leaves as the chip has them, and why."""
    name: str = ""
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Line and column of each parameter's value, where the model was read from a file."""

    def __repr__(self) -> str:
        effects = ", ".join(self.effects) or "no effects"
        return f"<model of {self.array.rows} x {self.array.cols}: {effects}; {len(self.parameters)} parameters>"


def model_of_layer(model: Model, layer: str) -> Model:
    """Return a model of two layers as one of one layer knows it: its springs, its couplings, nothing of the other."""
    array, which = model.array, stiffness.LAYERS.index(layer)
    if array.stiffness is None:
        raise InputError(f"--layer {layer}: the model has one layer", model.name)
    out = Model(array.of_layer(layer), list(model.effects), provenance=model.provenance, name=model.name)
    n, scale = out.array.springs, model.parameters.get("stiffness_coupling_scale", 1.0)
    values = dict(model.parameters)
    if which and scale != 1.0:  # what the model does not say, and the plant has
        table = native.parameter_table()
        values = {name: one.default for name, one in table.items() if name.startswith(COUPLED)} | values
    for name in dict.fromkeys(full.partition("[")[0] for full in values):
        if name.startswith(("series_", "stiffness_")):
            continue
        scaled = scale if which and name.startswith(COUPLED) else 1.0
        own = {f"{name}[{k + 1}]": f"{name}[{which * n + k + 1}]" for k in range(n)}
        said = {values.get(full) for full in own.values()}
        if None not in said and len(said) == 1:  # all the same: said once
            own = {name: own[f"{name}[1]"]}
        for to, full in ({name: name} | own).items():
            if full in values:
                out.parameters[to] = scaled * values[full]
            if full in model.stderr:
                out.stderr[to] = scaled * model.stderr[full]
    return out


def _array(file: TomlFile, given: dict[str, Any]) -> Array:
    """Return the array of a file's tables, its shape looked at."""
    if "array" not in given:
        raise file.refuse("there is no [array] table; add rows and cols", ())
    shape = given["array"]
    parts = {name: given.get(name, {}) for name in ("spring", "material", "sensor", "cooling")}
    array = Array(shape["rows"], shape["cols"], shape.get("pitch_mm"), **parts, stiffness=given.get("stiffness"))
    if array.springs > native.MAX_SPRINGS:
        two = " in two layers" if array.layers == 2 else ""
        said = f"{array.rows} x {array.cols}{two} are more than {native.MAX_SPRINGS} springs"
        raise file.refuse(said, ("array", "cols"))
    sizes = [key for key in ("board_rows", "board_cols") if key in shape]
    if len(sizes) == 1:
        raise file.refuse("[array] board_rows and board_cols go together", ("array", sizes[0]))
    if sizes:
        rows, cols = array.board = tuple(shape[key] for key in sizes)
        if min(rows, array.rows) * min(cols, array.cols) > native.BOARD_SPRINGS:
            said = f"{rows} x {cols} are more than {native.BOARD_SPRINGS} springs on a board"
            raise file.refuse(said, ("array", "board_cols"))
    boards = [str(k + 1) for k in range(len(array.parts))]
    for name, own in given.get("board", {}).items():
        if name not in boards:
            raise file.refuse(f"[board.{name}], but the array has board 1 to {len(boards)}", ("board", name))
        array.boards[int(name)] = own
    return array


def no_effect(name: str) -> str:
    """Return that there is no such effect, and which may be meant."""
    names = native.effect_names()
    return f"there is no effect '{name}'{did_you_mean(name, names) or ': ' + ', '.join(names)}"


def check_effects(names: Iterable[str]) -> None:
    """Refuse names of which one is no effect's."""
    for name in names:
        if name not in native.effect_names():
            raise InputError(no_effect(name))


def read_array(path: str | Path) -> Array:
    """Read array.toml; refused with file, line and column where it breaks docs/files.md."""
    file = TomlFile(path)
    return _array(file, file.read(Keys({**TABLES, "cooling": table(cooling.NUMBERS, cooling.WORDS)})))


def read_model(path: str | Path) -> Model:
    """Read model.toml; refused with file, line and column where it breaks docs/files.md."""
    file = TomlFile(path)
    if (schema := file.data.get("schema", SCHEMA)) != SCHEMA:
        raise file.refuse(f"schema is '{schema}'; this version reads \"{SCHEMA}\"", ("schema",))
    given = file.read(MODEL)
    model = Model(_array(file, given), name=str(path), provenance=given.get("provenance", {}))
    for name in given.get("effects", ()):
        if name not in native.effect_names():
            raise file.refuse(no_effect(name), ("effects",), word=name)
        if name in model.effects:
            raise file.refuse(f"effect {name} appears twice; remove one", ("effects",), word=name)
        model.effects.append(name)
    for k, entry in enumerate(given.get("parameter", ())):
        _take_parameter(file, ("parameter", k), entry, model)
    return model


def _take_parameter(file: TomlFile, at: At, entry: dict[str, Any], model: Model) -> None:
    name, table = entry["name"], native.parameter_table()
    if name not in table:
        raise file.refuse(f"there is no parameter '{name}'{did_you_mean(name, table)}", (*at, "name"))
    known = table[name]
    value = file.read(number(known.minimum, known.maximum), (*at, "value"), name)
    if entry["unit"] != known.unit:
        raise file.refuse(f"{name} is in '{known.unit}', not in '{entry['unit']}'; convert the value", (*at, "unit"))
    if "effect" in entry and entry["effect"] != known.effect:
        raise file.refuse(f"{name} belongs to {known.effect or 'no effect'}; remove or correct effect", (*at, "effect"))
    full = name
    if "spring" in entry:
        spring = file.read(whole(1, model.array.springs), (*at, "spring"))
        if not known.per_spring:
            raise file.refuse(f"{name} is of the whole array; remove spring", (*at, "spring"))
        full = f"{name}[{spring}]"
    if full in model.parameters:
        raise file.refuse(f"parameter {full} appears twice; remove one", (*at, "value"))
    model.parameters[full] = value
    model.places[full] = file.place((*at, "value"))
    for key, kept in (("stderr", model.stderr), ("kept", model.kept)):
        if key in entry:
            kept[full] = entry[key]


def _value(one: Any) -> str:
    if isinstance(one, list):
        return f"[{', '.join(map(_value, one))}]"
    if isinstance(one, str | int):
        return json.dumps(one, ensure_ascii=False)
    text = f"{one:.7g}"
    return text if any(c in text for c in ".en") else f"{text}.0"


def _lines(header: str, table: Mapping[str, Any]) -> list[str]:
    """Return a table of TOML, without what is None."""
    return ["", header, *(f"{key} = {_value(one)}" for key, one in table.items() if one is not None)]


def model_text(model: Model) -> str:
    """Return model.toml as text: what `read_model` and the host tools read."""
    array, table = model.array, native.parameter_table()
    lines = [f'schema = "{SCHEMA}"', f"effects = {_value(list(model.effects))}"]
    shape = {"rows": array.rows, "cols": array.cols, "pitch_mm": array.pitch_mm}
    lines += _lines("[array]", shape | dict(zip(_BOARD_SHAPE, array.board or (), strict=False)))
    parts = {name: getattr(array, name) or None for name in ("spring", "material", "sensor")}
    parts |= {f"board.{number}": own for number, own in array.boards.items()} | {"stiffness": array.stiffness}
    for name, part in parts.items():
        lines += [] if part is None else _lines(f"[{name}]", part)
    for full, value in model.parameters.items():
        name, _, of_one = full.partition("[")
        entry = {"name": name, "spring": int(of_one[:-1]) if of_one else None, "value": float(value)}
        entry |= {"unit": table[name].unit, "stderr": model.stderr.get(full), "effect": table[name].effect}
        lines += _lines("[[parameter]]", entry | {"kept": model.kept.get(full)})
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    made = {"tool": f"ninespring {__version__}", "date": now} | model.provenance
    made["doubts"] = made.get("doubts") or None
    lines += _lines("[provenance]", {key: made.get(key) for key in ("tool", "date", "note", "doubts", *ERRORS)})
    for log in made.get("logs", []):
        lines += _lines("[[provenance.logs]]", {key: log[key] for key in ("file", "sha256")})
    return "\n".join(lines) + "\n"


SHAPES = {1: (1, 1), 2: (1, 2), 4: (2, 2), 9: (3, 3), 16: (4, 4), 25: (5, 5), 36: (6, 6), 49: (7, 7), 64: (8, 8)}
"""Springs of a log, and the array they are taken for where no array.toml says it."""


def array_of(array: Array | None, runs: Sequence[Run]) -> Array:
    """Return the array of these runs; refuse what does not go together."""
    for k, run in enumerate(runs):
        for other in runs[:k]:
            if run.sha256 == other.sha256:
                raise InputError(f"is the same as {other.name}: it would count twice, give it once", run.name)
        if run.springs != runs[0].springs:
            both = f"has {run.springs} springs, {runs[0].name} has {runs[0].springs}"
            raise InputError(f"{both}: give logs of one array", run.name)
    if array is None:
        count = runs[0].springs
        below: dict[str, Any] | None = None
        if runs[0].layers == 2 and count % 2 == 0:
            count, below = count // 2, {}
        if count not in SHAPES:
            raise InputError(
                f"{count} springs: say how they are arranged, `--array array.toml` with [array] rows and cols",
                runs[0].name,
                1,
            )
        array = Array(*SHAPES[count], stiffness=below)
    return array


def pattern_of(text: str, array: Array) -> list[bool]:
    """Return which springs a pattern has on (`111101111`, of two layers `111101111/000010000`), elongation first; refused as `ninespring-sim` refuses it."""
    parts = text.split("/")
    if len(parts) != array.layers:
        if array.layers == 1:
            raise InputError(f"pattern '{text}' is of {len(parts)} layers, the array has one")
        raise InputError(
            f"pattern '{text}' is of {len(parts)} layer{'s' * (len(parts) > 1)}, the array has two; "
            f"write elongation/stiffness, with {array.springs // 2} digits each"
        )
    for part, layer in zip(parts, stiffness.LAYERS, strict=False):
        where = f"{layer} " if array.layers == 2 else ""
        if set(part) - {"0", "1"}:
            raise InputError(f"{where}pattern '{part}' holds something else than 0 and 1")
        if len(part) != array.rows * array.cols:
            raise InputError(f"{where}pattern has {len(part)} digits for {array.rows * array.cols} springs")
    return [one == "1" for part in parts for one in part]
