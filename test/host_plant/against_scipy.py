"""Hold the plant to an independent integration: its equations written again, solved by SciPy's RK45 and Radau.

Random networks (size, parameters, effects, drives, fan, ambient), each log simulated by the plant in one call
and here with tolerances of 1e-8. Exit code 77 where NumPy or SciPy is absent.
"""

from __future__ import annotations

import ctypes
import sys
from itertools import pairwise

try:
    import numpy as np
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq
except ImportError as missing:
    print(f"SKIPPED: the plant was NOT held to SciPy, {missing}. Run script/setup.")
    sys.exit(77)

NETWORKS = 24
LIMIT_C = 0.01
POWER, CURRENT, DUTY, COMMAND, HELD = range(5)
MODES = [POWER, CURRENT, DUTY, COMMAND]
# name: (low, high) of the random values; per-spring ones get one value a spring
SCALARS = {
    "orthogonal_w_per_k": (0, 1e-3),
    "orthogonal_fan_w_per_k": (0, 1e-3),
    "diagonal_w_per_k": (0, 5e-4),
    "diagonal_fan_w_per_k": (0, 5e-4),
    "second_w_per_k": (0, 2e-4),
    "second_fan_w_per_k": (0, 2e-4),
    "series_w_per_k": (0, 1e-3),
    "series_fan_w_per_k": (0, 1e-3),
    "stiffness_coupling_scale": (0.3, 1.5),
    "ambient_c": (10, 30),
    "supply_v": (4, 6),
    "freewheel_drop_v": (0, 0.4),
    "surface_mm2": (200, 400),
    "wire_diameter_mm": (0.5, 1),
    "emissivity": (0.1, 1),
    "convection_exponent": (0.05, 0.35),
    "convection_reference_k": (50, 100),
    "convection_scale": (0.4, 1),
    "forced_scale": (0.3, 1),
    "fan_velocity_m_per_s": (0.2, 2),
    "fan_half_share": (0.1, 0.9),
    "latent_cooling_ratio": (0.3, 1),
    "resistance_martensite_rise_per_k": (-3e-4, 1.5e-3),
    "resistance_austenite_rise_per_k": (-3e-4, 1.5e-3),
    "air_heat_capacity_j_per_k": (0.2, 5),
    "air_exchange_w_per_k": (0.05, 0.5),
    "plate_heat_capacity_j_per_k": (2, 30),
    "plate_loss_w_per_k": (0.01, 0.1),
    "holder_heat_capacity_j_per_k": (0.1, 2),
    "holder_coupling_w_per_k": (0, 6e-3),
    "wake_w_per_k": (0, 2e-3),
    "edge_loss_fraction": (0, 0.3),
    "edge_loss_fan_share": (0, 2),
    "supply_resistance_ohm": (0, 1),  # over all springs: a supply is made for its array
    "ambient_ramp_k_per_h": (-20, 20),
    "ambient_amplitude_k": (0, 3),
    "ambient_period_s": (100, 1000),
    "ambient_phase_rad": (-3, 3),
    "optical_share": (0, 0.9),
    "optical_width": (0.3, 2.5),
    "optical_shape": (1, 8),  # a smaller one has more beyond 12 widths, where the plant ends its sum, than the limit
    "optical_beyond": (0, 1),
    "optical_background": (0, 0.3),
    "optical_background_rise_k": (0, 10),
}
EACH = {
    "heat_capacity_j_per_k": (0.2, 0.5),
    "loss_w_per_k": (3e-3, 9e-3),
    "loss_fan_w_per_k": (9e-3, 15e-3),
    "resistance_ohm": (0.15, 0.3),
    "command_power_w": (0.6, 1.4),
    "loop_resistance_ohm": (0.1, 0.3),
    "latent_heat_j": (2, 12),
    "resistance_martensite_ohm": (0.15, 0.25),
    "resistance_austenite_ohm": (0.15, 0.25),
    "plate_coupling_w_per_k": (0, 3e-3),
    "loss_scale": (0.8, 1.2),
    "heat_capacity_scale": (0.8, 1.2),
    "resistance_scale": (0.8, 1.2),
    "sensor_lag_s": (1, 15),
    "sensor_gain": (0.8, 1.2),
    "sensor_offset_k": (-2, 2),
    "transformation_shift_k": (-10, 10),
    "contact_ohm": (0, 0.05),
}
STEPPED = ("transformation_shift_k", "contact_ohm")  # a load, a contact: they change in mid-run
M_F, M_S, A_S, A_F = 68.0, 78.0, 88.0, 98.0


class Model:
    """The equations of docs/physics.md in NumPy. State: springs, air, a plate for each layer, sensors, holders (degC)."""

    def __init__(self, shape: tuple[int, int, int], values: dict, on: set, modes: np.ndarray) -> None:
        """Take random values, the effects that are on, and how each spring is driven."""
        self.layers, rows, columns = shape
        self.n, self.v, self.on, self.modes = self.layers * rows * columns, values, on, modes
        layer, row, column = np.unravel_index(np.arange(self.n), shape)
        self.layer, self.row, self.column = layer, row, column
        dl, dr, dc = (abs(one[:, None] - one) for one in (layer, row, column))
        dr = dr + 99 * dl  # those of the other layer are nobody's neighbours
        self.series = ((dl == 1) & (dr == 99) & (dc == 0)).astype(float)
        self.of_layer = np.eye(self.layers)[layer]
        self.scale = np.where(layer == 1, values["stiffness_coupling_scale"], 1.0)
        self.orthogonal = (dr + dc == 1).astype(float)
        self.diagonal = ((dr == 1) & (dc == 1)).astype(float)
        self.second = ((dr + dc == 2) & (dr != dc)).astype(float)
        step = [(0, 1), (1, 0), (0, -1), (-1, 0)][int(values["wake_direction"])]
        self.downstream = (  # [i, j]: i receives from j
            (row[:, None] - row == step[0]) & (column[:, None] - column == step[1]) & (dl == 0)
        ).astype(float)
        mismatch = "spring_mismatch" in on
        one = np.ones(self.n)
        self.heavier = values["heat_capacity_scale"] if mismatch else one
        self.ohm_scale = values["resistance_scale"] if mismatch else one
        self.loss_scale = values["loss_scale"] if mismatch else one
        self.fan_loss_scale = self.loss_scale
        if "edge_loss" in on:
            more = values["edge_loss_fraction"] * (4 - self.orthogonal.sum(1))
            self.fan_loss_scale = self.loss_scale * (1 + values["edge_loss_fan_share"] * more)
            self.loss_scale = self.loss_scale * (1 + more)
        self.capacity = values["heat_capacity_j_per_k"] * self.heavier
        self.shift = self.contact = np.zeros(self.n)
        # turning points: austenite and temperature where each spring last turned
        self.turn_x, self.turn_t = np.zeros(self.n), np.full(self.n, self.ambient(0.0))
        self.step(values)

    def step(self, values: dict) -> None:
        """Take another load on each spring, and other contacts."""
        if "transformation_shift" in self.on:
            self.shift = values["transformation_shift_k"]
        if "contact_resistance" in self.on:
            self.contact = values["contact_ohm"]
        self.branch()

    def branch(self) -> None:
        """Take the branches of each spring's phase to begin at its turning point."""
        # M_s < A_s: at a turning point at least one branch is flat, so the start is the fraction itself
        up_turn = self.cosine(self.turn_t, A_S + self.shift, A_F + self.shift)[0]
        down_turn = self.cosine(self.turn_t, M_F + self.shift, M_S + self.shift)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            self.start = np.where(up_turn < 1, (self.turn_x - up_turn) / (1 - up_turn), 1.0)
            self.top = np.where(down_turn > 0, self.turn_x / down_turn, 0.0)

    def settle_phase(self, t: np.ndarray) -> np.ndarray:
        """After a step of the load: the temperatures at which each spring's phase is possible, with no heat in all."""
        out, x0 = t.copy(), self.turn_x.copy()
        for k in range(self.n):

            def possible(temperature: float, k: int = k) -> float:
                at = np.full(self.n, temperature)
                up, down = (
                    self.cosine(at, A_S + self.shift, A_F + self.shift)[0],
                    self.cosine(at, M_F + self.shift, M_S + self.shift)[0],
                )
                return float(np.clip(x0[k], up[k], down[k]))

            latent = self.v["latent_heat_j"][k] * self.heavier[k] if "latent_heat" in self.on else 0.0

            def heat(temperature: float, k: int = k, latent: float = latent) -> float:
                change = possible(temperature, k) - x0[k]
                given = latent * (change if change > 0 else change * self.v["latent_cooling_ratio"])
                return self.capacity[k] * (temperature - t[k]) + given

            far = latent / self.capacity[k] + 1.0
            out[k] = brentq(heat, t[k] - far, t[k] + far, xtol=1e-12)
            self.turn_x[k], self.turn_t[k] = possible(out[k]), out[k]
        self.branch()
        return out

    def ambient(self, t: float) -> float:
        """Air far away at time t (s), degC."""
        v = self.v
        if "ambient_drift" not in self.on:
            return v["ambient_c"]
        wave = np.sin(2 * np.pi * t / v["ambient_period_s"] + v["ambient_phase_rad"])
        return v["ambient_c"] + v["ambient_ramp_k_per_h"] * t / 3600 + v["ambient_amplitude_k"] * wave

    @staticmethod
    def cosine(t: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
        """Rise from 0 at low to 1 at high, and its slope."""
        phase = np.clip((t - low) / (high - low), 0, 1) * np.pi
        return (1 - np.cos(phase)) / 2, np.sin(phase) / 2 * np.pi / (high - low)

    def phase(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Austenite at t, and its slope were t to rise, were it to fall."""
        up, up_slope = self.cosine(t, A_S + self.shift, A_F + self.shift)
        down, down_slope = self.cosine(t, M_F + self.shift, M_S + self.shift)
        x, start, top = self.turn_x, self.start, self.top
        rising = (t >= self.turn_t) & (t > A_S + self.shift)
        falling = (t <= self.turn_t) & (t < M_S + self.shift)
        now = np.where(rising, start + (1 - start) * up, np.where(falling, top * down, x))
        return now, np.where(rising, (1 - start) * up_slope, 0), np.where(falling, top * down_slope, 0)

    def remember(self, t: np.ndarray) -> None:
        """Call often: moves the turning point with a spring that transforms."""
        x = self.phase(t)[0]
        moved = x != self.turn_x
        # Between the bands the memory stays where the last transformation ended: no ratchet.
        self.turn_t = np.where(moved, t, self.turn_t)
        self.turn_x = x
        self.branch()

    def resistance(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Resistances (n,), ohm."""
        v = self.v
        martensite = austenite = v["resistance_ohm"]
        if "resistance_phase" in self.on:
            martensite, austenite = v["resistance_martensite_ohm"], v["resistance_austenite_ohm"]
        if "resistance_temperature" in self.on:
            martensite = martensite * (1 + v["resistance_martensite_rise_per_k"] * (t - 20))
            austenite = austenite * (1 + v["resistance_austenite_rise_per_k"] * (t - 20))
        return (martensite * (1 - x) + austenite * x) * self.ohm_scale

    def power(self, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Heating (n,), W, for drive quantities u (n,)."""
        v, m, ohm = self.v, self.modes, self.resistance(t, x)
        loop = ohm + self.contact + v["loop_resistance_ohm"]
        wanted = u * v["command_power_w"] * self.ohm_scale
        supply = v["supply_v"]
        chopped = "supply_sag" in self.on and v["supply_chopped"]
        sunk = np.where(m == COMMAND, wanted / supply, 0.0) * v["supply_resistance_ohm"]
        if "supply_sag" in self.on:
            steady_w = u[m == POWER].sum() + (u * u * loop)[m == CURRENT].sum()
            duty_s = (u * u / loop)[m == DUTY].sum()
            command_s = wanted[m == COMMAND].sum() / v["supply_v"] ** 2

            def excess(volt: float) -> float:
                amps = steady_w / volt + duty_s * volt + command_s * (v["supply_v"] if chopped else volt)
                return volt + v["supply_resistance_ohm"] * amps - v["supply_v"]

            supply = brentq(excess, 0.6 * supply, supply, xtol=1e-13) if excess(supply) > 0 else supply
        amps = np.maximum(u * supply - (1 - u) * v["freewheel_drop_v"], 0) / loop
        return np.where(
            m == POWER,
            u * ohm / (ohm + self.contact),
            np.where(
                m == CURRENT,
                u * u * ohm,
                np.where(
                    m == DUTY,
                    amps * amps * ohm,
                    wanted * ((supply + sunk) / v["supply_v"] if chopped else (supply / v["supply_v"]) ** 2),
                ),
            ),
        )

    def blown(self, fan: float) -> float:
        """Part of what the fan adds at full."""
        half = self.v["fan_half_share"] if "fan_curve" in self.on else 0.5
        return fan * half / (fan * half + (1 - fan) * (1 - half))

    def loss(self, t: np.ndarray, air: float, fan: float) -> np.ndarray:
        """Conductance to the air (n,), W/K."""
        v = self.v
        part = self.blown(fan)
        natural = v["loss_w_per_k"] * (1 - part) * self.loss_scale
        forced = v["loss_fan_w_per_k"] * part * self.fan_loss_scale
        if "natural_convection" not in self.on:
            return natural + forced
        rise = abs(t - air)
        if not v["convection_correlation"]:
            return natural * (rise / v["convection_reference_k"]) ** v["convection_exponent"] + forced
        film, d, pr = (t + air) / 2 + 273.15, v["wire_diameter_mm"] * 1e-3, 0.70
        nu, k = 15.89e-6 * (film / 300) ** 1.77, 0.0263 * (film / 300) ** 0.873
        ra = 9.81 / film * rise * d**3 / nu**2 * pr
        h_natural = (0.6 + 0.387 * ra ** (1 / 6) / (1 + (0.559 / pr) ** (9 / 16)) ** (8 / 27)) ** 2 * k / d
        re = fan * v["fan_velocity_m_per_s"] * d / nu
        nusselt = 0.3 + 0.62 * re**0.5 * pr ** (1 / 3) / (1 + (0.4 / pr) ** (2 / 3)) ** 0.25 * (
            1 + (re / 282000) ** (5 / 8)
        ) ** (4 / 5)
        h_forced = (nusselt * k / d) if fan > 0 else 0.0
        both = ((v["convection_scale"] * h_natural) ** 4 + (v["forced_scale"] * h_forced) ** 4) ** 0.25
        return both * v["surface_mm2"] * 1e-6 * self.loss_scale

    def slope(self, time: float, y: np.ndarray, u: np.ndarray, commanded: float) -> np.ndarray:
        """Time derivative of the state."""
        fan = self.blown(commanded)
        n, v, on = self.n, self.v, self.on
        sensors, holders = n + 1 + self.layers, 2 * n + 1 + self.layers
        t, plate, sensor, holder = y[:n], y[n + 1 : sensors], y[sensors:holders], y[holders:]
        ambient = self.ambient(time)
        air = y[n] if "shared_air" in on else ambient
        x, up, down = self.phase(t)
        g_o = v["orthogonal_w_per_k"] * (1 - fan) + v["orthogonal_fan_w_per_k"] * fan
        g_d = v["diagonal_w_per_k"] * (1 - fan) + v["diagonal_fan_w_per_k"] * fan
        g_s = v["second_w_per_k"] * (1 - fan) + v["second_fan_w_per_k"] * fan
        g = self.scale[:, None] * (g_o * self.orthogonal + g_d * self.diagonal + g_s * self.second)
        g += (v["series_w_per_k"] * (1 - fan) + v["series_fan_w_per_k"] * fan) * self.series
        given = self.loss(t, air, commanded) * (t - air)
        if "fan_wake" in on:
            reached = self.downstream @ t - self.downstream.sum(1) * air
            given = given - v["wake_w_per_k"] * fan * self.scale * reached
        q = self.power(t, x, u) + g @ t - g.sum(1) * t - given
        if "radiation" in on:
            area = v["emissivity"] * 5.670374419e-8 * v["surface_mm2"] * 1e-6
            q = q - area * ((t + 273.15) ** 4 - (ambient + 273.15) ** 4)
        out = np.zeros_like(y)
        if "plate_conduction" in on:
            flow = v["plate_coupling_w_per_k"] * (t - self.of_layer @ plate)
            q = q - flow
            taken = flow @ self.of_layer - v["plate_loss_w_per_k"] * (plate - ambient)
            out[n + 1 : sensors] = taken / v["plate_heat_capacity_j_per_k"]
        if "holder_mass" in on:
            out[holders:] = v["holder_coupling_w_per_k"] * (t - holder) / v["holder_heat_capacity_j_per_k"]
            q = q - v["holder_coupling_w_per_k"] * (t - holder)
        if "shared_air" in on:
            out[n] = (given.sum() - v["air_exchange_w_per_k"] * (air - ambient)) / v["air_heat_capacity_j_per_k"]
        capacity = self.capacity
        if "latent_heat" in on:
            latent = v["latent_heat_j"] * self.heavier
            capacity = capacity + np.where(q > 0, latent * up, latent * v["latent_cooling_ratio"] * down)
        out[:n] = q / capacity
        out[sensors:holders] = (t - sensor) / v["sensor_lag_s"]
        return out

    def blurred(self, t: np.ndarray, ambient: float) -> np.ndarray:
        """What a camera shows (n,): the whole plane's places weighed by a point-spread, those beyond the array too."""
        v, far = self.v, 60
        away = np.arange(-far, far + 1)
        weight = np.exp(-((np.hypot(away[:, None], away) / v["optical_width"]) ** v["optical_shape"]))
        weight[far, far] = 0.0
        weight *= v["optical_share"] / weight.sum()
        dr, dc = (np.abs(one[:, None] - one).astype(int) for one in (self.row, self.column))
        share = weight[far + dr, far + dc] * (self.layer[:, None] == self.layer)
        absent = v["optical_beyond"] * (v["optical_share"] - share.sum(1))
        return (1 - share.sum(1) - absent) * t + share @ t + absent * ambient

    def seen(self, time: float, y: np.ndarray) -> np.ndarray:
        """What the sensors show (n,), degC."""
        v, ambient = self.v, self.ambient(time)
        sensors = self.n + 1 + self.layers
        t = y[sensors : sensors + self.n] if "sensor_lag" in self.on else y[: self.n]
        if "optical_mixing" in self.on:
            t = self.blurred(t, ambient)
            b = v["optical_background"]
            t = (1 - b) * t + b * (ambient + v["optical_background_rise_k"])
        if "sensor_gain" in self.on:
            t = ambient + v["sensor_gain"] * (t - ambient) + v["sensor_offset_k"]
        return t


def load(path: str) -> ctypes.CDLL:
    """Load the plant with the signatures used here."""
    lib = ctypes.CDLL(path)
    pointer, real, text, array = ctypes.c_void_p, ctypes.c_double, ctypes.c_char_p, ctypes.c_void_p
    lib.plant_create_layers.restype = pointer
    lib.plant_destroy.argtypes = [pointer]
    lib.plant_effect_count.restype, lib.plant_effect_name.restype = ctypes.c_size_t, text
    lib.plant_effect_name.argtypes = [ctypes.c_size_t]
    lib.plant_set.argtypes = [pointer, text, real]
    lib.plant_set_effect.argtypes = [pointer, text, ctypes.c_bool]
    lib.plant_reset.argtypes = [pointer]
    lib.plant_simulate.argtypes = [pointer, ctypes.c_size_t] + [array] * 7
    lib.plant_energy_balance_j.argtypes = lib.plant_energy_input_j.argtypes = [pointer]
    lib.plant_energy_balance_j.restype = lib.plant_energy_input_j.restype = real
    return lib


def compare(lib: ctypes.CDLL, seed: int) -> tuple[float, float, str]:
    """Simulate one random network twice; largest differences of temperature and of measurement, degC."""
    rng = np.random.default_rng(seed)
    rows, columns = int(rng.integers(1, 4)), int(rng.integers(1, 4))
    layers = 1 + seed % 2
    n = layers * rows * columns
    effects = [lib.plant_effect_name(k).decode() for k in range(lib.plant_effect_count())]
    on = {e for k, e in enumerate(effects) if k == seed % len(effects) or rng.random() < 0.4}
    values: dict = {k: rng.uniform(*r) for k, r in SCALARS.items()}
    values |= {k: rng.uniform(*r, n) for k, r in EACH.items()}
    values["supply_resistance_ohm"] /= n
    values["wake_direction"] = float(rng.integers(0, 4))
    values["convection_correlation"] = float(rng.integers(0, 2))
    modes = rng.choice(MODES, n).astype(np.int32)
    points = 15
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(3, 15, points - 1))])
    top = np.select([modes == POWER, modes == CURRENT, modes == DUTY], [1.4, 2.6, 0.24], 1.0)
    drive = rng.uniform(0, 1, (points, n)) * top * (rng.random((points, n)) < 0.75)
    fan = np.where(rng.random(points) < 0.5, 0.0, rng.random(points)).round(3)
    ambient = np.full(points, np.nan)
    values["supply_chopped"] = float(rng.integers(0, 2))

    plant = lib.plant_create_layers(rows, columns, layers)
    for name, value in values.items():
        for k, one in enumerate(np.atleast_1d(value)):
            key = f"{name}[{k + 1}]" if np.ndim(value) else name
            assert lib.plant_set(plant, key.encode(), float(one)) == 0, key
    for effect in on:
        assert lib.plant_set_effect(plant, effect.encode(), True) == 0, effect
    lib.plant_reset(plant)
    shown, real = np.empty((points, n)), np.empty((points, n))
    half = points // 2
    later = {k: rng.uniform(*EACH[k], n) for k in STEPPED}
    for part in (slice(0, half + 1), slice(half, points)):
        if part.start:
            for name, value in later.items():
                for k, one in enumerate(value):
                    assert lib.plant_set(plant, f"{name}[{k + 1}]".encode(), float(one)) == 0, name
        arrays = [a[part].ctypes.data for a in (time, drive, fan, ambient, shown, real)]
        assert lib.plant_simulate(plant, len(time[part]), arrays[0], modes.ctypes.data, *arrays[1:]) == 0
        if not part.start:
            before_step = real[half].copy(), shown[half].copy()
    assert abs(lib.plant_energy_balance_j(plant)) <= 1e-9 * lib.plant_energy_input_j(plant)
    lib.plant_destroy(plant)

    model = Model((layers, rows, columns), values, on, modes)
    y = np.full(3 * n + 1 + layers, model.ambient(0.0))
    phase_matters = bool(on & {"latent_heat", "resistance_phase", "resistance_temperature"})
    method = "RK45" if phase_matters else "Radau"  # RK45 takes the kinks of a transformation best
    worst = [0.0, 0.0]
    for r in range(points):
        if r == half:  # what the first half ended with, then the step
            worst[0] = max(worst[0], abs(y[:n] - before_step[0]).max())
            worst[1] = max(worst[1], abs(model.seen(time[r], y) - before_step[1]).max())
            model.step(later)
            if "transformation_shift" in on:
                y[:n] = model.settle_phase(y[:n])
        worst[0] = max(worst[0], abs(y[:n] - real[r]).max())
        worst[1] = max(worst[1], abs(model.seen(time[r], y) - shown[r]).max())
        if r + 1 == points:
            break
        # Turning points are noted every 0.5 s; in between each spring moves one way (near enough).
        pieces = int(np.ceil((time[r + 1] - time[r]) / 0.5)) if phase_matters else 1
        edges = np.linspace(time[r], time[r + 1], pieces + 1)
        for a, b in pairwise(edges):
            args, first = (drive[r], fan[r]), b - a if phase_matters else None  # or it is looked for in each piece
            y = solve_ivp(model.slope, (a, b), y, method, args=args, first_step=first, rtol=1e-8, atol=1e-8).y[:, -1]
            model.remember(y[:n])
    label = f"{layers} x {rows} x {columns}, {method}, top {real.max():.0f} degC, {' '.join(sorted(on))}"
    return worst[0], worst[1], label


def main() -> int:
    """Compare all; 1 if any is off."""
    lib = load(sys.argv[1])
    seeds = range(int(sys.argv[2]), int(sys.argv[2]) + 1) if len(sys.argv) > 2 else range(NETWORKS)
    bad, largest = 0, 0.0
    for seed in seeds:
        true_error, shown_error, label = compare(lib, seed)
        off = max(true_error, shown_error) > LIMIT_C
        bad += off
        largest = max(largest, true_error, shown_error)
        print(f"{seed:2} {true_error:.1e} {shown_error:.1e} {'OFF ' if off else ''}{label}", flush=True)
    print(f"{bad} of {len(seeds)} networks differ by more than {LIMIT_C} degC; largest {largest:.1e}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
