"""The benchmark's own world: an array of springs that shares no code and no integrator with the product.

Equations in differential form on temperatures, phase by a Duhem law (a rate per kelvin, no memory of turning
points), classical Runge-Kutta at 0.2 s over all runs at once in NumPy. The product explains its data with the
C plant (enthalpy, turning points, its own integrator): agreement is not built in.
"""

# ruff: noqa: B023 - the inner functions are called within the turn of the loop that made them
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

STEFAN_BOLTZMANN = 5.670374419e-8
ROWS = COLUMNS = 3
SPRINGS = ROWS * COLUMNS
STEP_S = 0.2

EFFECTS = (
    "radiation",
    "natural_convection",
    "latent_heat",
    "resistance_phase",
    "shared_air",
    "plate_conduction",
    "fan_wake",
    "edge_loss",
    "spring_mismatch",
    "supply_sag",
    "ambient_drift",
    "sensor_lag",
    "sensor_gain",
    "optical_mixing",
    "holder_mass",
)
OUTSIDE = {
    "loose_contact": "electrics: one spring's contact goes bad now and then, its heat falls by a part",
    "crosstalk": "electrics: driving one spring also heats another, far away",
    "current_pickup": "electrics: each thermometer shows an offset in proportion to its spring's current",
    "loss_ageing": "time: the loss of every spring changes steadily over the run (dust, a drying film)",
    "delayed_heat": "time: a part of the heat arrives half a minute late",
    "thermal_bridge": "space: a metal strip joins two springs that are not neighbours",
    "gusts": "air: a draught comes and goes, the loss rises and falls with it",
    "plume": "air: warm air rises, each row warms the row above it without any fan",
}
"""Effects that are in no library, by name: the kind and what happens."""


@dataclass
class World:
    """Numbers of one array. Powers W, conductances W/K, temperatures degC, times s."""

    heat_capacity: float = 0.300
    loss: float = 5.8e-3
    loss_fan: float = 11.3e-3
    orthogonal: float = 0.586e-3
    orthogonal_fan: float = 0.658e-3
    diagonal: float = 0.293e-3
    diagonal_fan: float = 0.329e-3
    resistance: float = 0.175
    command_power: float = 0.9
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    """Effects that act (library or outside), each with its numbers."""
    camera: np.ndarray | None = None
    """What a camera shows of each spring: (9, 9) weights of the springs, the rest is the room's (camera.py)."""


@dataclass
class Inputs:
    """What one run is driven with, at 1 Hz: arrays (n, 9) and (n,)."""

    time_s: np.ndarray
    current: np.ndarray
    command: np.ndarray
    fan: np.ndarray
    ambient: np.ndarray


def neighbours() -> tuple[np.ndarray, np.ndarray]:
    """Return the (9, 9) 0/1 matrices of orthogonal and diagonal neighbours."""
    row, column = np.divmod(np.arange(SPRINGS), COLUMNS)
    apart = np.abs(row[:, None] - row) + 1j * np.abs(column[:, None] - column)
    return ((np.abs(apart) == 1).astype(float), (apart == 1 + 1j).astype(float))


def simulate(world: World, runs: list[Inputs]) -> dict[str, np.ndarray]:
    """Return noise-free temperatures as a thermometer shows them, currents and voltages, (runs, n, 9).

    All runs have the same times. Each starts in equilibrium with its ambient, undriven, martensite.
    """
    effect = world.effects
    time_s = runs[0].time_s
    count, rows = len(runs), len(time_s)
    orthogonal, diagonal = neighbours()
    fan = np.stack([run.fan for run in runs])
    ambient = np.stack([run.ambient for run in runs])
    current = np.stack([run.current for run in runs])
    command = np.stack([run.command for run in runs])
    outer = np.arange(SPRINGS) != 4
    missing = 4.0 - orthogonal.sum(axis=1)

    loss_scale = np.ones(SPRINGS)
    mass_scale = np.ones(SPRINGS)
    if e := effect.get("edge_loss"):
        sides = missing if e.get("per_side", 0.0) > 0 else outer.astype(float)
        loss_scale = loss_scale * (1 + e["fraction"] * sides)
    if e := effect.get("spring_mismatch"):
        loss_scale[int(e["spring"])] *= e["loss_scale"]
        mass_scale[int(e["spring"])] *= e["mass_scale"]
    bridge = np.zeros((SPRINGS, SPRINGS))
    if e := effect.get("thermal_bridge"):
        a, b = int(e["first"]), int(e["second"])
        bridge[a, b] = bridge[b, a] = e["conductance"]
    wake = np.zeros((SPRINGS, SPRINGS))
    if e := effect.get("fan_wake"):
        for k in range(SPRINGS):
            if k % COLUMNS:
                wake[k, k - 1] = e["conductance"]
    plume = np.zeros((SPRINGS, SPRINGS))
    if e := effect.get("plume"):
        for k in range(SPRINGS - COLUMNS):
            plume[k, k + COLUMNS] = e["conductance"]
    capacity = world.heat_capacity * mass_scale
    r_martensite = world.resistance
    r_austenite = world.resistance * effect.get("resistance_phase", {"ratio": 1.25})["ratio"]
    if "resistance_phase" not in effect:
        r_austenite = r_martensite
    air_on = effect.get("shared_air")
    plate_on = effect.get("plate_conduction")
    holders_on = effect.get("holder_mass")
    latent = effect.get("latent_heat", {"joule": 0.0})["joule"]
    # an alloy that is not as declared: degC by which it transforms elsewhere, K of further hysteresis
    elsewhere = effect.get("_alloy", {}).get("shift", 0.0)
    opened = 0.5 * effect.get("_alloy", {}).get("hysteresis", 0.0)
    warmed = effect.get("resistance_temperature", {}).get("rise", 0.0)
    drift = effect.get("ambient_drift")
    convection = effect.get("natural_convection")
    radiation = effect.get("radiation")
    sag = effect.get("supply_sag")

    temperature = np.repeat(ambient[:, :1], SPRINGS, axis=1).copy()
    air = ambient[:, 0].copy()
    plate = ambient[:, 0].copy()
    holder = temperature.copy()
    delayed = np.zeros((count, SPRINGS))
    phase = np.zeros((count, SPRINGS))
    out = {key: np.zeros((count, rows, SPRINGS)) for key in ("temperature", "current", "voltage")}

    def duhem(t: np.ndarray, rising: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """Phase per kelvin in the direction of motion (austenite fraction, 88..98 up, 78..68 down)."""
        up = np.clip((t - elsewhere - opened - 88.0) / 10.0, 0.0, 1.0)
        f_up = 0.5 * (1 - np.cos(np.pi * up))
        slope_up = np.where((up > 0) & (up < 1), 0.05 * np.pi * np.sin(np.pi * up), 0.0)
        down = np.clip((t - elsewhere + opened - 68.0) / 10.0, 0.0, 1.0)
        f_down = 0.5 * (1 - np.cos(np.pi * down))
        slope_down = np.where((down > 0) & (down < 1), 0.05 * np.pi * np.sin(np.pi * down), 0.0)
        rate_up = (1 - xi) * slope_up / np.maximum(1 - f_up, 1e-3)
        rate_down = xi * slope_down / np.maximum(f_down, 1e-3)
        return np.where(rising, rate_up, rate_down)

    for row in range(rows):
        now = float(time_s[row])
        surroundings = ambient[:, row].copy()
        if drift:
            surroundings = surroundings + drift["kelvin"] * np.sin(0.5 * np.pi * now / drift["period_s"])
        shown = current[:, row].copy()
        resistance = (r_martensite + (r_austenite - r_martensite) * phase) * (1.0 + warmed * (temperature - 20.0))
        if (e := effect.get("contact_resistance")) and now >= e["from"]:
            # the sensor measures the contact with the spring; its heat is the contact's own
            resistance = resistance + e["ohm"] * (np.arange(SPRINGS) == int(e["spring"]))
        if sag:
            drawn = command[:, row].sum(axis=1, keepdims=True)
        out["temperature"][:, row] = temperature
        out["current"][:, row] = shown
        out["voltage"][:, row] = shown * resistance
        if row == rows - 1:
            break
        fan_now = fan[:, row : row + 1]
        loss = (world.loss + fan_now * (world.loss_fan - world.loss)) * loss_scale
        g_orthogonal = world.orthogonal + fan_now * (world.orthogonal_fan - world.orthogonal)
        g_diagonal = world.diagonal + fan_now * (world.diagonal_fan - world.diagonal)
        if e := effect.get("loss_ageing"):
            loss = loss * (1 + e["fraction"] * now / time_s[-1])
        if e := effect.get("gusts"):
            loss = loss * (1 + e["fraction"] * max(0.0, np.sin(2 * np.pi * now / e["period_s"])))
        still = world.loss * loss_scale
        span = float(time_s[row + 1]) - now
        steps = max(1, round(span / STEP_S))
        h = span / steps

        def rates(
            t: np.ndarray, a: np.ndarray, p: np.ndarray, b: np.ndarray, d: np.ndarray, xi: np.ndarray
        ) -> tuple[np.ndarray, ...]:
            around = a[:, None] if air_on else surroundings[:, None]
            over = t - around
            lost = loss * over
            if convection:
                # only the natural part rises with the difference, either way; blown air does not care
                rise = (np.abs(over) / 60.0) ** convection["power"]
                lost = lost + (1 - fan_now) * still * (rise - 1.0) * over
            to_air = lost.sum(axis=1)
            if radiation:
                kelvin, cold = t + 273.15, surroundings[:, None] + 273.15
                lost = lost + radiation["emissivity"] * STEFAN_BOLTZMANN * 277e-6 * (kelvin**4 - cold**4)
            heat = r_martensite + (r_austenite - r_martensite) * xi
            heat = shown**2 * heat * (1.0 + warmed * (t - 20.0))
            if sag is not None or mode_command:
                heat = world.command_power * command[:, row]
                if sag:
                    # a source resistance in front of resistive loads
                    heat = heat / (1 + sag["fraction"] * drawn) ** 2
            rate_d = np.zeros_like(d)
            if e := effect.get("delayed_heat"):
                rate_d = (heat - d) / e["delay_s"]
                heat = heat * (1 - e["fraction"]) + e["fraction"] * d
            if (e := effect.get("_heat")) and e["from"] <= now < e["to"]:
                # a step of heat that nothing logs, in the first run
                extra = e["watt"] * (np.arange(SPRINGS) == int(e["spring"])) * (np.arange(count) == 0)[:, None]
                heat = heat + extra
            if e := effect.get("loose_contact"):
                bad = (now % e["period_s"]) < e["bad_s"]
                if bad and now > e["period_s"]:
                    heat = heat.copy()
                    heat[:, int(e["spring"])] *= 1 - e["fraction"]
            if e := effect.get("crosstalk"):
                heat = heat.copy()
                heat[:, int(e["to"])] += e["fraction"] * heat[:, int(e["of"])]
            flow = heat - lost
            for matrix, g in ((orthogonal, g_orthogonal), (diagonal, g_diagonal)):
                flow = flow + g * (t @ matrix.T - t * matrix.sum(axis=1))
            if bridge.any():
                flow = flow + t @ bridge.T - t * bridge.sum(axis=1)
            if wake.any():
                flow = flow + fan_now * (over @ wake.T)
            if plume.any():
                flow = flow + np.maximum(over, 0.0) @ plume.T
            rate_a = np.zeros_like(a)
            if air_on:
                rate_a = (to_air - air_on["exchange"] * (a - surroundings)) / (air_on["capacity"])
            rate_p = np.zeros_like(p)
            if plate_on:
                into = plate_on["coupling"] * (t - p[:, None])
                flow = flow - into
                rate_p = (into.sum(axis=1) - plate_on["loss"] * (p - surroundings)) / (plate_on["capacity"])
            rate_b = np.zeros_like(b)
            if holders_on:
                # a holder loses heat itself, too, which the product's does not
                behind = holders_on["coupling"] * (t - b)
                flow = flow - behind
                rate_b = (behind - holders_on["loss"] * (b - surroundings[:, None])) / holders_on["capacity"]
            per_kelvin = duhem(t, flow > 0, xi)
            rate_t = flow / (capacity + latent * per_kelvin)
            return rate_t, rate_a, rate_p, rate_b, rate_d, per_kelvin * rate_t

        mode_command = bool(effect.get("_command"))
        for _ in range(steps):
            state = (temperature, air, plate, holder, delayed, phase)
            k1 = rates(*state)
            k2 = rates(*(s + 0.5 * h * k for s, k in zip(state, k1, strict=True)))
            k3 = rates(*(s + 0.5 * h * k for s, k in zip(state, k2, strict=True)))
            k4 = rates(*(s + h * k for s, k in zip(state, k3, strict=True)))
            temperature, air, plate, holder, delayed, phase = (
                s + h / 6 * (a + 2 * b + 2 * c + d) for s, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True)
            )
            phase = np.clip(phase, 0.0, 1.0)

    shown_t = out["temperature"]
    if world.camera is not None:
        room = ambient[:, :, None]
        if drift:
            room = room + (drift["kelvin"] * np.sin(0.5 * np.pi * time_s / drift["period_s"]))[:, None]
        shown_t = room + (shown_t - room) @ world.camera.T
    if e := effect.get("optical_mixing"):
        shown_t = shown_t + e["fraction"] * (shown_t @ orthogonal.T - shown_t * orthogonal.sum(axis=1))
    if e := effect.get("sensor_lag"):
        lagged = shown_t.copy()
        for row in range(1, rows):
            # the thermometer is a first-order element driven by a straight line between samples
            h = time_s[row] - time_s[row - 1]
            decay = np.exp(-h / e["tau_s"])
            slope = (shown_t[:, row] - shown_t[:, row - 1]) / h
            lagged[:, row] = (
                shown_t[:, row]
                - slope * e["tau_s"]
                + (lagged[:, row - 1] - shown_t[:, row - 1] + slope * e["tau_s"]) * decay
            )
        shown_t = lagged
    if e := effect.get("sensor_gain"):
        shown_t = shown_t * e["gain"]
    if e := effect.get("current_pickup"):
        shown_t = shown_t + e["kelvin_per_ampere"] * current
    out["shown"] = shown_t
    out["command"] = command
    return out


def random_inputs(rng: np.random.Generator, duration_s: int, fan: bool, scale: float = 1.0) -> Inputs:
    """Random steps on every spring, half of the time off, long enough to reach the transformation."""
    time_s = np.arange(duration_s, dtype=float)
    current = np.zeros((duration_s, SPRINGS))
    command = np.zeros((duration_s, SPRINGS))
    for k in range(SPRINGS):
        at = int(rng.integers(5, 60))
        while at < duration_s:
            hold = int(rng.integers(30, 150))
            level = 0.0 if rng.random() < 0.4 else rng.uniform(0.35, 1.0)
            current[at : at + hold, k] = np.sqrt(level) * 2.1 * scale
            command[at : at + hold, k] = level
            at += hold
    fan_level = np.zeros(duration_s)
    if fan:
        at = int(rng.integers(100, 250))
        while at < duration_s:
            hold = int(rng.integers(120, 240))
            fan_level[at : at + hold] = 1.0
            at += hold + int(rng.integers(100, 200))
    ambient = np.full(duration_s, float(rng.uniform(18.0, 24.0)))
    return Inputs(time_s, current, command, fan_level, ambient)
