"""One log through the plant, as docs/files.md says, and the plant that an array or a model declares."""

from __future__ import annotations

import functools
import math

import numpy as np

from ..io.logs.run import Run
from . import native, tables
from .models import Array
from .spec import AROUND

EACH = (
    "heat_capacity_j_per_k",
    "latent_heat_j",
    "resistance_martensite_ohm",
    "resistance_austenite_ohm",
    "resistance_ohm",
)
"""What each spring has of its own by wire, coil and material."""

HIDES_S = 20.0
"""Of what a spring does, thermometers show this much later at most, about."""

WARM_K = 3.0
"""A spring that begins so much above its room was driven before: air, plate and holders are warm, too, as if it had been so warm for long,
or by a share of that which the run tells."""
LEAST_HELD = 1e-3
"""J/K that air, a plate or a holder hold at least."""
HOTTEST_C = 300.0
"""Above which nothing transforms any more, and no spring is held."""

SHIFT_PER_N = "transformation_shift_k_per_n"
LOAD_STEP_N = 0.1
"""A change of load that counts: half a kelvin of the transformation (docs/physics.md: 4 K/N)."""


def started(
    plant: native.Plant, run: Run, ambient: np.ndarray | None, begin: int, start_offset: np.ndarray | None = None
) -> native.Plant:
    """Return the plant as it is where a log, or what follows a gap in it, begins.

    Air, plate and holders are in balance with springs that begin warm, or as much warmer than the room as a share of that makes them, or
    with the first inputs where a run begins warm and steady: nobody saw what was before.
    """
    if ambient is not None:
        plant.set_ambient(float(ambient[begin]))
    plant.set_fan(float(run.fan[begin]))
    plant.reset()
    first = run.temperature_c[begin].copy()
    room_c = plant.get("ambient_c") if ambient is None else float(ambient[begin])
    if run.warm:
        _in_balance(plant, native.MODES[run.mode], run.drive[begin])
    elif begin == 0 and any(map(plant.has, AROUND)) and np.nanmax(first, initial=room_c) > room_c + WARM_K:
        _in_balance(plant, native.TEMPERATURE, room_c + run.around_share * (np.clip(first, -60.0, HOTTEST_C) - room_c))
        for k in range(run.springs):  # let go: what is held is where it is held
            plant.drive(k, native.POWER, 0.0)
    _from_austenite(plant, run, begin, room_c)
    plant.start_from_measured(first + (0.0 if start_offset is None else start_offset))
    return plant


def _from_austenite(plant: native.Plant, run: Run, begin: int, was_c: float | np.ndarray) -> None:
    """Lead springs to austenite that come down from there, and are warmer than what is known, `was_c`, makes them.

    What they are where the log begins follows as they are put down to it. All others are led there from where they were: from the cold
    at first, and after a gap from before it.
    """
    if run.hotter is None:
        return
    over = run.temperature_c[begin] > was_c + WARM_K
    for k in np.flatnonzero(run.hotter[run.starts.index(begin)] & over):
        plant.set_temperature(int(k), HOTTEST_C)


def _in_balance(plant: native.Plant, mode: int, drive: np.ndarray) -> None:
    for k in np.flatnonzero(np.isfinite(drive)):
        plant.drive(int(k), mode, float(drive[k]))
    # where all comes to rest does not depend on what is held there, and what holds much takes days
    quick = _as_quick_as_a_spring(plant, len(drive))
    held = {name: plant.get(name) for name in quick}
    plant.set_all({name: min(held[name], max(LEAST_HELD, one)) for name, one in quick.items()})
    # a drifting ambient has no balance: it begins at the run's first row
    plant.settle_without("ambient_drift", 1e6)
    plant.set_all(held)


def _as_quick_as_a_spring(plant: native.Plant, springs: int) -> dict[str, float]:
    """Return what air, plate and holders would hold, J/K, that answer in a spring's own time; of those that there are."""
    get, pace = plant.get, fades_per_s(plant)
    out = {}
    if plant.has("shared_air"):
        out["air_heat_capacity_j_per_k"] = (get("air_exchange_w_per_k") + springs * get("loss_w_per_k")) / pace
    if plant.has("plate_conduction"):
        out["plate_heat_capacity_j_per_k"] = (
            get("plate_loss_w_per_k") + springs * get("plate_coupling_w_per_k")
        ) / pace
    if plant.has("holder_mass"):
        out["holder_heat_capacity_j_per_k"] = get("holder_coupling_w_per_k") / pace
    return out


def hidden_k(run: Run, ambient_c: float, fades_per_s: float) -> np.ndarray:
    """Return how far springs may be from what their thermometers show at first, (springs,), K, one sigma.

    One that is warmer than its room may be cooling, or be held: a thermometer that lags does not show which. A run that begins
    steady hides nothing.
    """
    warm = np.nan_to_num(np.maximum(run.temperature_c[0] - ambient_c, 0.0))
    return np.zeros(run.springs) if run.warm else HIDES_S * fades_per_s * warm


def fades_per_s(plant: native.Plant) -> float:
    """Return how quickly a plant's spring fades towards its room, 1/s."""
    return plant.get("loss_w_per_k") / plant.get("heat_capacity_j_per_k")


def settles_s(plant: native.Plant, springs: int) -> float:
    """Return the time in which a plant's springs, and what they share, come to be as warm as their room, s: all they hold over all they lose."""
    holds, loses = springs * plant.get("heat_capacity_j_per_k"), springs * plant.get("loss_w_per_k")
    if plant.has("plate_conduction"):
        holds, loses = holds + plant.get("plate_heat_capacity_j_per_k"), loses + plant.get("plate_loss_w_per_k")
    if plant.has("shared_air"):
        holds += plant.get("air_heat_capacity_j_per_k")
    if plant.has("holder_mass"):
        holds += springs * plant.get("holder_heat_capacity_j_per_k")
    return holds / max(loses, 1e-9)


def simulate_run(
    plant: native.Plant,
    run: Run,
    ambient: np.ndarray | None,
    start_offset: np.ndarray | None = None,
    trace: bool = False,
) -> np.ndarray:
    """Simulate one log as docs/files.md says: from its first measured temperatures (ambient where none).

    Return what the sensors show, (rows, springs), degC; `trace`: true temperatures and austenite, (rows, springs, 2).

    After a gap the springs start again from what was measured there; air, plate and holders carry on.
    Those start as `started` says.
    """
    along = _Along(plant, run, ambient, trace)
    along.lay_load(0)
    started(plant, run, ambient, 0, start_offset)
    if len(run.starts) == 1:
        return along.rows(0, len(run.time_s))
    out = np.empty((*run.temperature_c.shape, 2) if trace else run.temperature_c.shape)
    bounds = [*run.starts, len(run.time_s)]
    for piece, (begin, end) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        if piece:
            along.rows(begin - 1, begin + 1)
            along.lay_load(begin)
            _from_austenite(plant, run, begin, plant.measured_c())
            plant.start_from_measured(run.temperature_c[begin])
        if end - begin == 1 and not trace:
            out[begin:end] = plant.measured_c()
        else:
            out[begin:end] = along.rows(begin, end)
    return out


class _Along:
    """A plant on its way along a log, loads laid on the springs as they were."""

    def __init__(self, plant: native.Plant, run: Run, ambient: np.ndarray | None, trace: bool) -> None:
        self.plant, self.run, self.ambient = plant, run, ambient
        self.simulate = plant.trace if trace else plant.simulate
        self.load_n = run.load_n if plant.get(SHIFT_PER_N) != 0.0 else None
        self.changes = np.zeros(0, dtype=int) if self.load_n is None else load_changes(self.load_n)

    def lay_load(self, row: int) -> None:
        """Load the springs as a row says."""
        for k, newton in enumerate(() if self.load_n is None else self.load_n[row]):
            self.plant.set(f"load_n[{k + 1}]", float(newton))

    def rows(self, begin: int, end: int) -> np.ndarray:
        """Go from one row to the last before another; return what is shown at each of them."""
        inside = self.changes[(self.changes > begin) & (self.changes < end - 1)]
        if not inside.size:
            return self._straight(begin, end)
        pieces = []
        for first, last in zip([begin, *inside], [*inside, end], strict=True):
            self.lay_load(first)
            shown = self._straight(first, min(last + 1, end))
            # a load that moves heats or cools a spring at once: what is shown as it moves is from before
            pieces.append(shown if first == begin else shown[1:])
        return np.concatenate(pieces)

    def _straight(self, begin: int, end: int) -> np.ndarray:
        run, part = self.run, slice(begin, end)
        air = None if self.ambient is None else self.ambient[part]
        return self.simulate(run.time_s[part], native.MODES[run.mode], run.drive[part], run.fan[part], air)


def load_changes(load_n: np.ndarray) -> np.ndarray:
    """Return the rows at which a load (rows, springs) has moved by LOAD_STEP_N since it was last laid on."""
    return _load_changes(np.ascontiguousarray(load_n, dtype=float).tobytes(), load_n.shape[1])


@functools.lru_cache(maxsize=32)
def _load_changes(load_n: bytes, springs: int) -> np.ndarray:
    """Go along a load row by row: once of each log, which a diagnosis simulates thousands of times."""
    rows = np.frombuffer(load_n).reshape(-1, springs)
    out, laid = [], rows[0]
    for row, load in enumerate(rows):
        if np.abs(load - laid).max() >= LOAD_STEP_N:
            out.append(row)
            laid = load
    return np.array(out, dtype=int)


RESISTANCES = ("resistance_martensite_ohm", "resistance_austenite_ohm")
SAME = 0.01
"""Part of a resistance by which springs are the same."""


def array_parameters(array: Array) -> dict[str, float]:
    """Return the plant's parameters that follow from array.toml: the host tools' rules (docs/files.md)."""
    out = _layer_parameters(array)
    own, lower = array.stiffness or {}, array.of_layer("stiffness")
    if (lower.spring, lower.material) != (array.spring, array.material):
        below = _layer_parameters(lower)
        own = own | {name: below[name] for name in EACH if below[name] != out.get(name)}
    for name in ("transformation_shift_k", *EACH):
        if name in own:
            out |= {f"{name}[{array.springs // 2 + k + 1}]": own[name] for k in range(array.springs // 2)}
    return out


def board_settings(array: Array) -> dict[str, float]:
    """Return what a board must be told besides its model where array.toml describes another spring: which are whole.

    The firmware's limits of a spring's resistance, as far from this array's springs as they are from the paper's.
    """
    declared = {name: native.parameter_table()[name].default for name in RESISTANCES}
    given = declared | array_parameters(array)
    ohm = [value for name, value in given.items() if name.partition("[")[0] in RESISTANCES]
    low, high = min(ohm) / min(declared.values()), max(ohm) / max(declared.values())
    if max(abs(low - 1.0), abs(high - 1.0)) < SAME:  # the paper's springs
        return {}
    least, most = (tables.settings()[f"resistance_{end}imum_ohm"] for end in ("min", "max"))
    out = {most.name: min(most.maximum, most.default * high), least.name: least.default * low}
    # told one after the other, the lower never meets the upper
    return out if high > 1.0 else dict(reversed(out.items()))


def _layer_parameters(array: Array) -> dict[str, float]:
    material, spring = array.material, array.spring
    out = {
        key: value for key, value in material.items() if key == "emissivity" or key.endswith(("_start_c", "_finish_c"))
    }
    if not material and not spring:
        return out
    wire_mm = spring.get("wire_diameter_mm", 0.8)
    length_mm = 110.0
    if "coil_diameter_mm" in spring or "turns" in spring:
        length_mm = math.pi * spring.get("coil_diameter_mm", 3.45) * spring.get("turns", 10.0)
    length_mm = spring.get("wire_length_mm", length_mm)
    section_mm2 = math.pi / 4.0 * wire_mm**2
    mass_kg = section_mm2 * length_mm * 1e-9 * material.get("density_kg_per_m3", 6450.0)
    ohm = 1e-5 * length_mm / section_mm2
    austenite = ohm * material.get("resistivity_austenite_uohm_cm", 100.0)
    return out | {
        "wire_diameter_mm": wire_mm,
        "surface_mm2": math.pi * wire_mm * length_mm,
        "heat_capacity_j_per_k": mass_kg * material.get("heat_capacity_j_per_kgk", 840.0),
        "latent_heat_j": mass_kg * material.get("latent_heat_j_per_kg", 24200.0),
        "resistance_martensite_ohm": ohm * material.get("resistivity_martensite_uohm_cm", 80.0),
        "resistance_austenite_ohm": austenite,
        "resistance_ohm": austenite,
    }
