"""The project's C code, called from Python: the plant (double precision) and the on-chip model (integers).

The functions release the interpreter's lock while they run, so simulations run in parallel threads.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from importlib import resources
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import WorkError

MAX_SPRINGS = 1024
BOARD_SPRINGS = 64
"""Of one board, natively; the Mega's has nine."""
POWER, CURRENT, DUTY, COMMAND, TEMPERATURE = range(5)
MODES = {"power": POWER, "current": CURRENT, "command": COMMAND, "temperature": TEMPERATURE}

OUTSIDE = -2
"""Status of a value, or of several together, that is none."""
_ERRORS = {
    -1: "no parameter or effect of that name",
    OUTSIDE: "value outside its limits",
    -3: "no such spring",
    -4: "rows x columns x layers not in 1..1024",
    -5: "out of memory",
    -6: "time step not positive, or no steady state",
}
_double_p = ctypes.POINTER(ctypes.c_double)
_int_p = ctypes.POINTER(ctypes.c_int)


class _Doubles:
    """How an array of doubles, or none, goes to the C code."""

    @staticmethod
    def from_param(array: np.ndarray | None) -> object:
        """Return where its numbers stand; not by array.ctypes, which takes longer than many a call."""
        return None if array is None else ctypes.c_void_p(array.__array_interface__["data"][0])


NOT_IN_TIME = -6
"""Status of a plant that is not settled in so long."""


class NativeError(RuntimeError):
    """The C code refused; `status` is its number."""

    def __init__(self, status: int, what: str) -> None:
        self.status = status
        super().__init__(f"{what}: {_ERRORS.get(status, f'status {status}')}")


_C_TYPES = {
    "str": ctypes.c_char_p,
    "str | None": ctypes.c_char_p,
    "float": ctypes.c_double,
    "int": ctypes.c_int,
    "bool": ctypes.c_bool,
}


def structure(row: type, **other: type) -> type[ctypes.Structure]:
    """Return how the C code lays out the rows of a table, given the dataclass of one; `other`: fields that C has otherwise."""
    layout = [(one.name, other.get(one.name) or _C_TYPES[str(one.type)]) for one in fields(row)]
    return type(row.__name__, (ctypes.Structure,), {"_fields_": layout})


def fields_of(row: ctypes.Structure) -> dict[str, Any]:
    """Return what a row of a table of the C code holds, by name."""
    values = {name: getattr(row, name) for name, *_ in row._fields_}
    return {name: one.decode() if isinstance(one, bytes) else one for name, one in values.items()}


@dataclass(frozen=True)
class PlantParameter:
    """One entry of the plant's parameter table."""

    name: str
    unit: str
    effect: str | None
    description: str
    default: float
    minimum: float
    maximum: float
    per_spring: bool


@functools.cache
def library() -> ctypes.CDLL:
    """Load the shared library that the package was built with."""
    try:
        lib = ctypes.CDLL(str(resources.files("ninespring") / "libninespring_native.so"))
    except OSError as error:
        raise RuntimeError(f"the compiled part of ninespring is missing ({error}): run `pip install .`") from None
    pointer, integer, size = ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t
    real, text, message = ctypes.c_double, ctypes.c_char_p, (ctypes.c_char_p, ctypes.c_size_t)
    signatures: dict[str, tuple[object, Sequence[object]]] = {
        "plant_parameter_count": (size, ()),
        "plant_parameter": (ctypes.POINTER(structure(PlantParameter)), (size,)),
        "plant_effect_count": (size, ()),
        "plant_effect_name": (text, (size,)),
        "plant_create_layers": (pointer, (integer, integer, integer)),
        "plant_destroy": (None, (pointer,)),
        "plant_copy": (pointer, (pointer,)),
        "plant_set": (integer, (pointer, text, real)),
        "plant_get": (integer, (pointer, text, _double_p)),
        "plant_set_effect": (integer, (pointer, text, ctypes.c_bool)),
        "plant_effect_is_on": (ctypes.c_bool, (pointer, size)),
        "plant_check": (integer, (pointer, ctypes.POINTER(text))),
        "plant_reset": (None, (pointer,)),
        "plant_set_temperature": (integer, (pointer, integer, real)),
        "plant_drive": (integer, (pointer, integer, integer, real)),
        "plant_set_fan": (integer, (pointer, real)),
        "plant_set_ambient": (integer, (pointer, real)),
        "plant_step": (integer, (pointer, real)),
        "plant_settle": (integer, (pointer, real)),
        "plant_simulate": (integer, (pointer, size, _Doubles, _int_p, *(_Doubles,) * 5)),
        "plant_temperature_c": (real, (pointer, integer)),
        "plant_measured_c": (real, (pointer, integer)),
        "plant_austenite": (real, (pointer, integer)),
        "plant_resistance_ohm": (real, (pointer, integer)),
        "plant_start_from_measured": (integer, (pointer, _Doubles)),
        "plant_readings": (integer, (pointer, size, *(_Doubles,) * 6)),
        "chip_export": (integer, (pointer, *(integer,) * 4, *message, *message)),
        "chip_simulate": (integer, (text, integer, integer, size, _Doubles, integer, *(_Doubles,) * 7, *message)),
        "chip_drive": (integer, (pointer, text, _int_p, size, size, _Doubles, _Doubles, *message)),
        "chip_run": (
            integer,
            (
                *(pointer, integer, integer, ctypes.POINTER(text), _int_p, real, ctypes.c_uint64, size, size),
                *(*(_Doubles,) * 4, _int_p, *message),
            ),
        ),
        "paper_configure": (integer, (pointer, real)),
        "whiten": (real, (size, size, pointer, text, pointer, pointer, size, pointer, pointer)),
        "weigh": (real, (size, pointer, text, pointer, pointer, size, pointer, pointer, pointer)),
    }
    for function, signature in signatures.items():
        entry = getattr(lib, function)
        entry.restype, entry.argtypes = signature
    return lib


@functools.cache
def parameter_table() -> dict[str, PlantParameter]:
    """Return the plant's parameters by name, in its order."""
    lib = library()
    rows = (fields_of(lib.plant_parameter(k).contents) for k in range(lib.plant_parameter_count()))
    return {one["name"]: PlantParameter(**one | {"unit": one["unit"] or ""}) for one in rows}


@functools.cache
def effect_names() -> tuple[str, ...]:
    """Return the names of the effects, in the plant's order."""
    lib = library()
    return tuple(lib.plant_effect_name(k).decode() for k in range(lib.plant_effect_count()))


doubles = _Doubles.from_param


def _shaped(name: str, given: npt.ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    """Return an argument as the C code reads it: doubles in a row, exactly so many."""
    out = np.asarray(given, dtype=float)
    if out.shape != shape:
        raise ValueError(f"{name} has shape {out.shape}, wanted {shape}")
    return np.ascontiguousarray(out)


def _log(
    springs: int,
    time_s: npt.ArrayLike,
    drive: npt.ArrayLike,
    fan: npt.ArrayLike | None,
    ambient_c: npt.ArrayLike | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Return the columns of a log, each of as many rows as it has times; at least one."""
    rows = max(1, np.size(time_s))
    return (
        _shaped("time_s", time_s, (rows,)),
        _shaped("drive", drive, (rows, springs)),
        None if fan is None else _shaped("fan", fan, (rows,)),
        None if ambient_c is None else _shaped("ambient_c", ambient_c, (rows,)),
    )


def _switches(pattern: Sequence[bool], springs: int) -> ctypes.Array[ctypes.c_int]:
    return (ctypes.c_int * springs)(*_shaped("pattern", pattern, (springs,)).astype(bool).tolist())


class Plant:
    """One simulated array. Not for two threads at once; make a `copy` for each."""

    def __init__(self, rows: int, cols: int, layers: int = 1) -> None:
        self._lib = library()
        self.rows, self.cols, self.layers = rows, cols, layers
        self._plant = self._lib.plant_create_layers(rows, cols, layers)
        if not self._plant:
            raise NativeError(-4, f"{rows} x {cols}{' x 2' if layers == 2 else ''} springs")

    @property
    def springs(self) -> int:
        """Number of springs, in all layers."""
        return self.layers * self.rows * self.cols

    def __del__(self) -> None:
        if getattr(self, "_plant", None):
            self._lib.plant_destroy(self._plant)
            self._plant = None

    def copy(self) -> Plant:
        """Return an independent plant in the same state."""
        twin = object.__new__(Plant)
        twin._lib, twin.rows, twin.cols, twin.layers = self._lib, self.rows, self.cols, self.layers
        twin._plant = self._lib.plant_copy(self._plant)
        if not twin._plant:
            raise NativeError(-5, "copy of a plant")
        return twin

    def _check(self, status: int, what: str) -> None:
        if status:
            why = self.check() if status == OUTSIDE else None
            raise NativeError(status, f"{what} ({why})" if why else what)

    def set(self, name: str, value: float) -> None:
        """Set a parameter, `name` or `name[k]`."""
        if status := self._lib.plant_set(self._plant, name.encode(), float(value)):
            self._check(status, f"{name} = {value:g}")

    def set_all(self, values: Mapping[str, float]) -> None:
        """Set many; what is said of all springs before what is said of one."""
        for one in (False, True):
            for name, value in values.items():
                if ("[" in name) == one:
                    self.set(name, value)

    def get(self, name: str) -> float:
        """Return a parameter."""
        out = ctypes.c_double()
        self._check(self._lib.plant_get(self._plant, name.encode(), ctypes.byref(out)), name)
        return out.value

    def set_effects(self, names: Iterable[str]) -> None:
        """Switch these effects on and all others off."""
        wanted = set(names)
        for name in effect_names():
            self._check(self._lib.plant_set_effect(self._plant, name.encode(), name in wanted), name)
            wanted.discard(name)
        if wanted:
            raise NativeError(-1, sorted(wanted)[0])

    def check(self) -> str | None:
        """Return what is inconsistent among the parameters and what they are, None if nothing is."""
        message = ctypes.c_char_p()
        if self._lib.plant_check(self._plant, ctypes.byref(message)) == 0:
            return None
        why = (message.value or b"inconsistent").decode()
        named = ", ".join(f"{self.get(word):.7g}" for word in why.split() if word in parameter_table())
        return f"{why}: {named}" if named else why

    def reset(self) -> None:
        """Everything to ambient, martensite, time 0."""
        self._lib.plant_reset(self._plant)

    def set_ambient(self, ambient_c: float) -> None:
        """Set the ambient temperature, degC."""
        self._check(self._lib.plant_set_ambient(self._plant, float(ambient_c)), "ambient")

    def set_fan(self, fraction: float) -> None:
        """Set the fan, 0..1."""
        self._check(self._lib.plant_set_fan(self._plant, float(fraction)), "fan")

    def set_temperature(self, spring: int, temperature_c: float) -> None:
        """Put a spring (0-based) to a temperature, degC."""
        if status := self._lib.plant_set_temperature(self._plant, spring, float(temperature_c)):
            self._check(status, f"temperature {temperature_c:g}")

    def drive(self, spring: int, mode: int, quantity: float) -> None:
        """Drive a spring (0-based) by POWER (W), CURRENT (A), COMMAND (0..1) or TEMPERATURE (degC)."""
        self._check(self._lib.plant_drive(self._plant, spring, mode, float(quantity)), f"drive {quantity:g}")

    def settle(self, limit_s: float = 1e6) -> None:
        """Run to the steady state."""
        self._check(self._lib.plant_settle(self._plant, float(limit_s)), "steady state")

    def settle_without(self, effect: str, limit_s: float) -> None:
        """Run, with one effect off meanwhile, to the steady state or, where that is further, for so long."""
        on = self.has(effect)
        self._check(self._lib.plant_set_effect(self._plant, effect.encode(), False), effect)
        status = self._lib.plant_settle(self._plant, float(limit_s))
        self._check(0 if status == NOT_IN_TIME else status, "steady state")
        self._check(self._lib.plant_set_effect(self._plant, effect.encode(), on), effect)

    def has(self, effect: str) -> bool:
        """Return whether an effect is on."""
        return bool(self._lib.plant_effect_is_on(self._plant, effect_names().index(effect)))

    def measured_c(self) -> np.ndarray:
        """Return what the sensors show now, (springs,), degC."""
        return np.array([self._lib.plant_measured_c(self._plant, k) for k in range(self.springs)])

    def temperature_c(self) -> np.ndarray:
        """Return the springs' temperatures now, (springs,), degC."""
        return np.array([self._lib.plant_temperature_c(self._plant, k) for k in range(self.springs)])

    def austenite(self) -> np.ndarray:
        """Return the springs' phase now, (springs,), 0..1."""
        return np.array([self._lib.plant_austenite(self._plant, k) for k in range(self.springs)])

    def step(self, seconds: float) -> None:
        """Go on for so long with the inputs as they are."""
        self._check(self._lib.plant_step(self._plant, float(seconds)), "step")

    def start_from_measured(self, first_c: np.ndarray) -> None:
        """Put the springs where the sensors would show `first_c` (NaN: stays where it is)."""
        first_c = _shaped("first_c", first_c, (self.springs,))
        self._check(self._lib.plant_start_from_measured(self._plant, first_c), "first temperatures")

    def readings(
        self, time_s: np.ndarray, power_w: np.ndarray, fan: np.ndarray, ambient_c: np.ndarray | None
    ) -> np.ndarray:
        """Run a whole log; return what a board would read of each spring as v / i, (rows, springs), ohm."""
        log = _log(self.springs, time_s, power_w, fan, ambient_c)
        ohm, temperature = np.empty_like(log[1]), np.empty_like(log[1])
        self._check(self._lib.plant_readings(self._plant, len(log[0]), *log, ohm, temperature), "readings")
        return ohm

    def trace(
        self,
        time_s: np.ndarray,
        mode: int,
        drive: np.ndarray,
        fan: np.ndarray | None = None,
        ambient_c: np.ndarray | None = None,
    ) -> np.ndarray:
        """Run a whole log row by row; return true temperatures (degC) and austenite, (rows, springs, 2)."""
        time_s, drive, fan, ambient_c = _log(self.springs, time_s, drive, fan, ambient_c)
        rows, n = drive.shape
        out = np.empty((rows, n, 2))
        for row in range(rows):
            out[row] = np.column_stack((self.temperature_c(), self.austenite()))
            if row + 1 == rows:
                break
            for k in range(n):
                self.drive(k, mode, float(drive[row, k]))
            if fan is not None:
                self.set_fan(float(fan[row]))
            if ambient_c is not None:
                self.set_ambient(float(ambient_c[row]))
            self.step(float(time_s[row + 1] - time_s[row]))
        return out

    def simulate(
        self,
        time_s: np.ndarray,
        mode: int,
        drive: np.ndarray,
        fan: np.ndarray | None = None,
        ambient_c: np.ndarray | None = None,
        true_c: bool = False,
    ) -> np.ndarray:
        """Run a whole log; return what the sensors show (or the springs have), (rows, springs), degC."""
        time_s, drive, fan, ambient_c = _log(self.springs, time_s, drive, fan, ambient_c)
        rows, n = drive.shape
        modes = (ctypes.c_int * n)(*([mode] * n))
        out = np.empty((rows, n))
        shown = (None, out) if true_c else (out, None)
        status = self._lib.plant_simulate(self._plant, rows, time_s, modes, drive, fan, ambient_c, *shown)
        self._check(status, "simulation")
        return out


def _chip(refusal: str, function: str, *arguments: object) -> str:
    """Call a function of the chip, all of which end with room for a message; return that, or raise it behind `refusal`."""
    message = ctypes.create_string_buffer(1024)
    if getattr(library(), function)(*arguments, message, len(message)):
        raise WorkError(f"{refusal} {message.value.decode()}")
    return message.value.decode()


Part = tuple[int, int, int, int]
"""Springs of a board: its first row (counted on through the layers) and column, 0-based, its rows and columns."""


def boards_of(rows: int, cols: int, board_rows: int, board_cols: int, layers: int = 1) -> list[Part]:
    """Return the boards into which an array is cut, as sim_host/loop/boards.h numbers them."""
    return [
        (layer * rows + row, col, min(board_rows, rows - row), min(board_cols, cols - col))
        for layer in range(layers)
        for row in range(0, rows, board_rows)
        for col in range(0, cols, board_cols)
    ]


def chip_export(plant: Plant, part: Part | None = None) -> tuple[str, str]:
    """Return the console lines of the on-chip model with this plant's numbers, and what was left out.

    `part`: of a board that has only these springs.
    """
    row, col, rows, cols = part or (0, 0, plant.layers * plant.rows, plant.cols)
    if min(row, col, rows - 1, cols - 1) < 0 or row + rows > plant.layers * plant.rows or col + cols > plant.cols:
        raise ValueError(f"part is {part}, the plant has {plant.layers * plant.rows} rows and {plant.cols} columns")
    text = ctypes.create_string_buffer(16384)
    where = plant._plant, row, col, rows, cols
    left_out = _chip("the model does not fit the chip:", "chip_export", *where, text, len(text))
    return text.value.decode(), left_out


def chip_simulate(
    lines: str,
    shape: tuple[int, int],
    time_s: np.ndarray,
    mode: int,
    drive: np.ndarray,
    command_power_w: np.ndarray,
    fan: np.ndarray,
    ambient_c: np.ndarray,
    first_c: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Run a log through the on-chip fixed-point model, set by console lines over the firmware's defaults.

    `command_power_w`: (springs,), W at full command. Return its temperatures (degC) and austenite, (rows, springs).
    """
    springs = shape[0] * shape[1]
    times, drive, *along = _log(springs, time_s, drive, fan, ambient_c)
    power, first = _shaped("command_power_w", command_power_w, (springs,)), _shaped("first_c", first_c, (springs,))
    temperature, austenite = np.empty_like(drive), np.empty_like(drive)
    given = times, mode, drive, power, *along, first
    _chip("the chip refuses", "chip_simulate", lines.encode(), *shape, len(times), *given, temperature, austenite)
    return temperature, austenite


def chip_drive(
    plant: Plant, lines: str, pattern: Sequence[bool], rows: int, on_rows: int
) -> tuple[np.ndarray, np.ndarray]:
    """Drive a copy of a plant by the chip's controller with console lines over the firmware's defaults.

    The pattern is on for `on_rows` seconds of `rows`. Return true temperatures (degC) and austenite, (rows, springs).
    """
    temperature, austenite = np.empty((rows, plant.springs)), np.empty((rows, plant.springs))
    given = plant._plant, lines.encode(), _switches(pattern, plant.springs), rows, on_rows
    _chip("the chip refuses", "chip_drive", *given, temperature, austenite)
    return temperature, austenite


def chip_run(
    plant: Plant,
    board: tuple[int, int],
    lines: Sequence[str],
    pattern: Sequence[bool],
    fan: float,
    seed: int,
    rows: int,
    on_rows: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
    """Drive a copy of a plant from cold by its boards: the pattern on for `on_rows` seconds, then off.

    `board`: rows and columns of springs of one board; `lines`: console lines of each (`boards_of`).
    Return true temperatures (degC) and austenite, (rows, springs), of each second heat (W) and current (A) of all, and
    how many springs a fault has switched off by the end.
    """
    boards = len(boards_of(plant.rows, plant.cols, *board, plant.layers))
    if len(lines) != boards:
        raise ValueError(f"lines of {len(lines)} boards, wanted {boards}")
    temperature, austenite = np.empty((rows, plant.springs)), np.empty((rows, plant.springs))
    power, current = np.empty(rows), np.empty(rows)
    faults = ctypes.c_int()
    told = (ctypes.c_char_p * len(lines))(*(one.encode() for one in lines))
    given = plant._plant, *board, told, _switches(pattern, plant.springs), fan, seed, rows, on_rows
    _chip("the chip refuses", "chip_run", *given, temperature, austenite, power, current, ctypes.byref(faults))
    return temperature, austenite, power, current, faults.value


def paper_configure(plant: Plant, pitch_mm: float) -> None:
    """Give a plant the paper's loss and couplings at a pitch (sim_host/plant/paper.h)."""
    if status := library().paper_configure(plant._plant, float(pitch_mm)):
        raise NativeError(status, f"pitch {pitch_mm:g} mm")
