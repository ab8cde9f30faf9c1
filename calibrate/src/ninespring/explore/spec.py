"""SPEC.toml of a sweep: what is varied, how it is sampled, what each point is; refused whole where it cannot be done.

A point is a flat table of values, one for each key of KEYS. Point i of a spec is always the same.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..io.logs import read_text
from ..io.toml_file import TomlFile, did_you_mean
from ..model import cooling, native, stiffness
from ..model.models import MATERIAL_KEYS, SPRING_KEYS, STIFFNESS_KEYS, Array, pattern_of
from .geometry import geometry_of

METHODS = ("grid", "latin", "sobol", "saltelli", "optimise")
PATTERNS = ("all", "all_but_middle", "middle", "checkerboard", "random", "none")
EVERY = "every"
"""[vary] pattern: all patterns of an array of at most EVERY_SPRINGS."""
EVERY_SPRINGS = 12
POLICIES = ("open", "precompensate")
COUPLINGS = ("law", "field")
OWN: dict[str, tuple[float, float]] = {
    "rows": (1, native.MAX_SPRINGS),
    "cols": (1, native.MAX_SPRINGS),
    "size": (1, 32),
    "layers": (1, 2),
    "board_rows": (1, native.BOARD_SPRINGS),
    "board_cols": (1, native.BOARD_SPRINGS),
    "pitch_mm": (1.0, 100.0),
    "fan": (0.0, 1.0),
    "ambient_c": (-40.0, 80.0),
    "supply_limit_a": (0.1, 60.0),
    "boost_current_a": (0.1, 3.2),
    "open_current_a": (0.0, 3.2),
    "tolerance": (0.0, 0.5),
    "transformation_spread_k": (0.0, 20.0),
}
"""Key: its limits. `size` n is rows = cols = n."""
STIFFNESS = {f"stiffness_{key}": key for key in (*STIFFNESS_KEYS, *stiffness.WORDS)}
"""Key: that of `[stiffness]` in array.toml."""
LIMITS: dict[str, tuple[float, float]] = (
    OWN
    | SPRING_KEYS
    | MATERIAL_KEYS
    | cooling.NUMBERS
    | {f"stiffness_{key}": limits for key, limits in STIFFNESS_KEYS.items()}
)
WORDS = {"policy": POLICIES, "pattern": PATTERNS, **cooling.WORDS, "stiffness_joint": stiffness.WORDS["joint"]}
WHOLE = ("rows", "cols", "size", "layers", "board_rows", "board_cols")
KEYS = (*LIMITS, *WORDS)
BOARD_KEYS = ("policy", "supply_limit_a", "boost_current_a", "open_current_a")
SWEEP_KEYS = ("method", "points", "seed", "duration_s", "on_s", "couplings", "mesh")
MOST_POINTS = 10_000_000
METRICS = (
    "start_s",
    "started",
    "cool_s",
    "pictures_per_min",
    "hottest_c",
    "undriven_c",
    "undriven_austenite",
    "hold_w",
    "energy_j",
    "supply_a",
    "faults",
)
UNITS = dict(zip(METRICS, ("s", "1", "s", "1/min", "degC", "degC", "1", "W", "J", "A", "springs"), strict=True))


@dataclass
class Axis:
    """What one key goes through."""

    key: str
    values: list[Any] = field(default_factory=list)
    """Those of a list, or of a grid's range."""
    low: float = 0.0
    high: float = 0.0

    def at(self, share: float) -> Any:
        """Return the value at 0..1 of the way."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        value = self.low + share * (self.high - self.low)
        return round(value) if self.key in WHOLE else value


@dataclass
class Spec:
    """A checked spec."""

    method: str = "grid"
    points: int = 0
    asked: int = 0
    """Points that the file asks for: of saltelli, the base of its sample, which has more."""
    seed: int = 1
    duration_s: int = 300
    on_s: int = 180
    couplings: str = "law"
    mesh: str = "coarse"
    fixed: dict[str, Any] = field(default_factory=dict)
    axes: list[Axis] = field(default_factory=list)
    boards: dict[int, dict[str, Any]] = field(default_factory=dict)
    """What boards (from 1) have that differs from the point."""
    metric: str = ""
    goal: str = "min"
    limits: dict[str, tuple[float | None, float | None]] = field(default_factory=dict)
    sha256: str = ""
    text: str = ""
    name: str = "SPEC.toml"

    def shares(self) -> np.ndarray | None:
        """Return the sample in the unit cube, (points, axes); None for a grid or where an optimiser asks."""
        if self.method in ("latin", "sobol"):
            from scipy.stats import qmc

        if self.method == "latin":
            return qmc.LatinHypercube(len(self.axes), rng=self.seed).random(self.asked)
        if self.method == "sobol":
            return qmc.Sobol(len(self.axes), rng=self.seed).random(self.asked)
        if self.method == "saltelli":
            from SALib.sample import sobol

            problem = {
                "num_vars": len(self.axes),
                "names": [a.key for a in self.axes],
                "bounds": [[0, 1]] * len(self.axes),
            }
            return sobol.sample(problem, self.asked, calc_second_order=False, seed=self.seed)
        return None

    def table(self, values: Sequence[Any]) -> dict[str, Any]:
        """Return a point: what is fixed, and a value for each axis."""
        return self.fixed | {axis.key: value for axis, value in zip(self.axes, values, strict=True)}

    def all_points(self) -> Iterator[dict[str, Any]]:
        """Return every point, in order; of an optimiser, which asks where it likes, the corners."""
        if self.method in ("grid", "optimise"):
            for values in itertools.product(*(axis.values or (axis.low, axis.high) for axis in self.axes)):
                yield self.table(values)
        shares = self.shares()
        for row in () if shares is None else shares:
            yield self.table([axis.at(float(share)) for axis, share in zip(self.axes, row, strict=True)])


def array_of_point(point: Mapping[str, Any]) -> Array:
    """Return the array that a point describes."""
    rows, cols = point.get("rows", 3), point.get("cols", 3)
    if point.get("size"):
        rows = cols = point["size"]
    return Array(
        int(rows),
        int(cols),
        float(point.get("pitch_mm", 5.0)),
        {key: point[key] for key in SPRING_KEYS if key in point},
        {key: point[key] for key in MATERIAL_KEYS if key in point},
        {},
        {key: point[key] for key in cooling.KEYS if key in point},
        {key: point[full] for full, key in STIFFNESS.items() if full in point} if point.get("layers") == 2 else None,
    )


def board_of_point(point: Mapping[str, Any], array: Array) -> tuple[int, int]:
    """Return rows and columns of springs of a board: all, where nothing is said and they are few enough."""
    if "board_rows" not in point and "board_cols" not in point and array.rows * array.cols <= native.BOARD_SPRINGS:
        return array.rows, array.cols
    return int(point.get("board_rows", 8)), int(point.get("board_cols", 8))


def patterns_of(point: Mapping[str, Any], array: Array) -> list[str]:
    """Return a word, or 0 and 1 for each spring, of each layer (of two: elongation/stiffness); checked."""
    given = str(point.get("pattern", "all_but_middle" if array.layers == 1 else "all_but_middle/none"))
    parts = given.split("/")
    if len(parts) == array.layers and set(parts) <= set(PATTERNS):
        return parts
    if len(parts) != array.layers:
        pattern_of(given, array)  # refuses it
    digits = ["0" * (array.rows * array.cols) if part in PATTERNS else part for part in parts]
    pattern_of("/".join(digits), array)
    return parts


def check_point(point: Mapping[str, Any]) -> None:
    """Refuse (InputError) what cannot exist."""
    array = array_of_point(point)
    patterns_of(point, array)
    if array.layers == 1 and (below := sorted(set(STIFFNESS) & set(point))):
        raise InputError(f"{below[0]}, but layers is not 2")
    if array.springs > native.MAX_SPRINGS:
        raise InputError(f"{array.rows} x {array.cols} are more than {native.MAX_SPRINGS} springs")
    board_rows, board_cols = board_of_point(point, array)
    if board_rows * board_cols > native.BOARD_SPRINGS:
        raise InputError(f"{board_rows} x {board_cols} are more than {native.BOARD_SPRINGS} springs on a board")
    geometry_of(array)
    plant = native.Plant(1, 1)
    plant.set_all({key: point[key] for key in MATERIAL_KEYS if key in point and key.endswith("_c")})
    if wrong := plant.check():
        raise InputError(wrong)


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path, self.file = path, TomlFile(path)
        self.data = self.file.data

    def refuse(self, message: str, near: str) -> InputError:
        return self.file.refuse(message, (), word=near)

    def known(self, key: str, names: Sequence[str], where: str) -> None:
        if key not in names:
            hint = did_you_mean(key, names) or f"; it has {', '.join(names)}"
            raise self.refuse(f"{where} has no key '{key}'{hint}", key)

    def word(self, value: Any, names: Sequence[str], key: str) -> str:
        if value not in names:
            hint = did_you_mean(str(value), names)
            raise self.refuse(f"{key} has no '{value}'{hint}; it has {', '.join(names)}", key)
        return value

    def number(self, value: Any, low: float, high: float, key: str, whole: bool = False) -> float:
        if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
            raise self.refuse(f"{key} must be a {'whole ' if whole else ''}number", key)
        if not low <= value <= high:
            raise self.refuse(f"{key} is {value:g}; it must be {low:g} to {high:g}", key)
        return value

    def value(self, key: str, value: Any) -> Any:
        if key == "pattern" and isinstance(value, str) and value.count("/") <= 1:
            for part in value.split("/"):
                if not part or set(part) - {"0", "1"}:
                    self.word(part, PATTERNS, key)
            return value
        if key in WORDS:
            return self.word(value, WORDS[key], key)
        number = self.number(value, *LIMITS[key], key, key in WHOLE)
        return number if key in WHOLE else float(number)  # 5 and 6.5 are of one kind, in every file

    def table(self, name: str) -> dict[str, Any]:
        part = self.data.get(name, {})
        if not isinstance(part, dict):
            raise self.refuse(f"[{name}] must be a table", name)
        return part

    def every_pattern(self, fixed: Mapping[str, Any], vary: Mapping[str, Any]) -> Axis:
        if {"rows", "cols", "size", "layers"} & set(vary):
            raise self.refuse(f'pattern = "{EVERY}" wants an array of one size', EVERY)
        array = array_of_point(fixed)
        springs, cut = array.springs, array.rows * array.cols
        if springs > EVERY_SPRINGS:
            raise self.refuse(f"{springs} springs have too many patterns: at most {EVERY_SPRINGS} springs", EVERY)
        every = [f"{k:0{springs}b}" for k in range(2**springs)]
        return Axis("pattern", every if array.layers == 1 else [f"{one[:cut]}/{one[cut:]}" for one in every])

    def axis(self, key: str, given: Any, method: str) -> Axis:
        if isinstance(given, list):
            if not given:
                raise self.refuse(f"{key} has no values", key)
            values = [self.value(key, one) for one in given]
            if len(set(values)) < len(values):
                raise self.refuse(f"{key} has a value twice", key)
            return Axis(key, values)
        if not isinstance(given, dict):
            raise self.refuse(f"[vary] {key} is a list, or {{from = .., to = ..}}; one value belongs into [fixed]", key)
        for one in given:
            self.known(one, ("from", "to", "steps"), f"[vary] {key}")
        if "from" not in given or "to" not in given:
            raise self.refuse(f"[vary] {key} needs from and to", key)
        if key in WORDS:
            raise self.refuse(f"{key} is a word: give a list of {', '.join(WORDS[key])}", key)
        low, high = self.value(key, given["from"]), self.value(key, given["to"])
        if not low < high:
            raise self.refuse(f"{key} goes from {low:g} to {high:g}: the wrong way round", key)
        if method != "grid":
            if "steps" in given:
                raise self.refuse(f"{key}: steps are of a grid; {method} takes the whole range", key)
            return Axis(key, [], low, high)
        if "steps" not in given:
            raise self.refuse(f"{key}: a grid needs steps", key)
        steps = int(self.number(given["steps"], 2, 100000, "steps", True))
        values = np.linspace(low, high, steps).tolist()
        if key in WHOLE:
            values = sorted({round(one) for one in values})
        return Axis(key, [round(one, 12) for one in values])

    def spec(self) -> Spec:
        for name in self.data:
            self.known(name, ("sweep", "fixed", "vary", "board", "optimise"), "the file")
        head = self.table("sweep")
        for key in head:
            self.known(key, SWEEP_KEYS, "[sweep]")
        spec = Spec(name=str(self.path))
        spec.method = self.word(head.get("method", "grid"), METHODS, "method")
        spec.couplings = self.word(head.get("couplings", "law"), COUPLINGS, "couplings")
        spec.mesh = self.word(head.get("mesh", "coarse"), ("coarse", "normal", "fine"), "mesh")
        spec.seed = int(self.number(head.get("seed", 1), 0, 2**31, "seed", True))
        spec.duration_s = int(self.number(head.get("duration_s", 300), 10, 36000, "duration_s", True))
        spec.on_s = int(self.number(head.get("on_s", min(180, spec.duration_s)), 5, spec.duration_s, "on_s", True))
        if spec.method == "grid" and "points" in head:
            raise self.refuse("a grid has as many points as its steps make: leave out points", "points")
        if spec.method != "grid":
            spec.points = spec.asked = int(self.number(head.get("points", 0), 1, MOST_POINTS, "points", True))
        if spec.method in ("sobol", "saltelli") and spec.points & (spec.points - 1):
            raise self.refuse(f"points is {spec.points}: {spec.method} wants a power of two", "points")
        fixed, vary = self.table("fixed"), self.table("vary")
        for table, where in ((fixed, "[fixed]"), (vary, "[vary]")):
            for key in table:
                self.known(key, KEYS, where)
        if both := sorted(set(fixed) & set(vary)):
            raise self.refuse(f"{both[0]} is fixed and varied", both[0])
        spec.fixed = {key: self.value(key, value) for key, value in fixed.items()}
        spec.axes = [
            self.every_pattern(spec.fixed, vary)
            if (key, value) == ("pattern", EVERY)
            else self.axis(key, value, spec.method)
            for key, value in vary.items()
        ]
        if not spec.axes:
            raise self.refuse("nothing is varied: [vary] is empty or missing", "vary")
        if spec.method == "grid":
            spec.points = math.prod(len(axis.values) for axis in spec.axes)
            if spec.points > MOST_POINTS:
                raise self.refuse(f"{spec.points} points are more than {MOST_POINTS}", "vary")
        if {"size", "rows"} <= {*fixed, *vary} or {"size", "cols"} <= {*fixed, *vary}:
            raise self.refuse("size stands for rows and cols: give one or the other", "size")
        if spec.couplings == "law":
            for key in (*SPRING_KEYS, *cooling.KEYS, *STIFFNESS):
                if key in fixed or key in vary:
                    raise self.refuse(f'{key}: the paper\'s law knows only pitch and fan; couplings = "field"', key)
        spec.boards = self.boards()
        self.optimise(spec)
        spec.text = read_text(self.path)
        spec.sha256 = hashlib.sha256(json.dumps(self.data, sort_keys=True).encode()).hexdigest()
        return spec

    def boards(self) -> dict[int, dict[str, Any]]:
        out = {}
        for number, own in self.table("board").items():
            if not number.isdecimal() or number.startswith("0") or not isinstance(own, dict):
                raise self.refuse(f"[board.{number}] must be [board.1], [board.2], ...", number)
            for key in own:
                self.known(key, BOARD_KEYS, f"[board.{number}]")
            out[int(number)] = {key: self.value(key, value) for key, value in own.items()}
        return out

    def optimise(self, spec: Spec) -> None:
        part = self.table("optimise")
        if bool(part) != (spec.method == "optimise"):
            raise self.refuse("method optimise and the table [optimise] go together", "optimise")
        for key in part:
            self.known(key, ("metric", "goal", *METRICS), "[optimise]")
        if not part:
            return
        spec.metric = self.word(part.get("metric", ""), METRICS, "metric")
        spec.goal = self.word(part.get("goal", "min"), ("min", "max"), "goal")
        for key in METRICS:
            if key in part:
                bound = part[key]
                if not isinstance(bound, dict) or not bound or set(bound) - {"least", "most"}:
                    raise self.refuse(f"[optimise] {key} = {{least = .., most = ..}}", key)
                least, most = (
                    self.number(bound[name], -1e9, 1e9, key) if name in bound else None for name in ("least", "most")
                )
                if least is not None and most is not None and least > most:
                    raise self.refuse(f"{key} is at least {least:g} and at most {most:g}: the wrong way round", key)
                spec.limits[key] = (least, most)


def named(point: Mapping[str, Any]) -> str:
    """Return a point's numbers as words."""
    return ", ".join(
        f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}" for key, value in point.items()
    )


def read_spec(path: Path) -> Spec:
    """Read SPEC.toml; every point is looked at before any is run."""
    spec = _Reader(path).spec()
    seen: set[str] = set()
    count = 0
    for count, point in enumerate(spec.all_points(), 1):
        # what cannot exist depends on these alone
        key = json.dumps({k: v for k, v in point.items() if k not in ("fan", "policy", "ambient_c")})
        if count > MOST_POINTS:
            raise InputError(f"more than {MOST_POINTS} points", path)
        if key in seen:
            continue
        if len(seen) < 100_000:
            seen.add(key)
        try:
            check_point(point)
            array = array_of_point(point)
            boards = len(native.boards_of(array.rows, array.cols, *board_of_point(point, array), array.layers))
            if spec.boards and max(spec.boards) > boards:
                raise InputError(f"[board.{max(spec.boards)}], but the array has {boards} boards")
        except InputError as error:
            raise InputError(f"point {count} ({named(point)}) cannot exist: {error.message}", path) from None
    if spec.method == "saltelli":
        spec.points = count
    return spec
