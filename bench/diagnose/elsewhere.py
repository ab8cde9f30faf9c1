"""A second world, written apart from the first: other equations, another phase law, other things that go wrong.

Enthalpy by explicit Euler at 0.1 s; each phase branch is a logistic curve and the state between them stays where it is (a
play operator): neither the plant's law nor that of `world.py`. What goes wrong is of kinds that the search for causes
without a name was not written for. Read by `real_logs.py`; nothing of the diagnosis is used here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

SPRINGS = 9
STEP_S = 0.1
NOISE_C = 0.25
ROW, COLUMN = np.divmod(np.arange(SPRINGS), 3)

KNOWN = ("latent_heat", "edge_loss", "spring_mismatch", "fan_wake", "shared_air", "radiation", "sensor_lag")
"""Effects of the library that act here, too."""
UNKNOWN = {
    "loss_swings": "the loss of every spring swings slowly, as under a room's own air conditioning",
    "trickle": "one spring's stage leaks: it is given a little heat all the time, driven or not",
    "loosens": "one thermometer comes loose: from some time on it shows less and less of its spring's rise",
    "coarse": "the thermometers step by a kelvin and a half",
    "common_return": "the common lead warms all springs by the square of all currents together",
    "backlash": "the thermometers follow with a play of some tenths to one kelvin",
    "slow_fan": "the air takes half a minute to move, and to come to rest, after the fan is switched",
    "door": "for some minutes of each run the surroundings are colder",
}
"""What acts that is in no library."""


@dataclass
class Apart:
    """One case: what acts, its numbers, and what is logged of two runs."""

    known: str
    unknown: str
    numbers: dict[str, float] = field(default_factory=dict)
    logs: list[dict[str, np.ndarray]] = field(default_factory=list)


def _drive(rng: np.random.Generator, rows: int) -> np.ndarray:
    """Return currents (rows, springs), A: on and off with a slow wave of levels, unlike steps of one random size."""
    time_s = np.arange(rows)
    out = np.zeros((rows, SPRINGS))
    for k in range(SPRINGS):
        period, phase = rng.uniform(110.0, 260.0), rng.uniform(0.0, 1.0)
        on = ((time_s / period + phase) % 1.0) < rng.uniform(0.4, 0.65)
        level = 1.35 + 0.6 * np.sin(2 * np.pi * time_s / rng.uniform(500.0, 1400.0) + rng.uniform(0.0, 6.0))
        out[:, k] = on * np.round(level, 2)
    return out


def make(seed: int, known: str, unknown: str, rows: int = 900) -> Apart:
    """Return the case of a seed: one known effect (or none) beside one unknown cause (or none)."""
    rng = np.random.default_rng([seed, 41])
    u = rng.uniform
    n = {
        "capacity": 0.3 * u(0.85, 1.15),
        "loss": 5.8e-3 * u(0.9, 1.15),
        "blown": 11.3e-3 * u(0.9, 1.1),
        "side": 0.55e-3 * u(0.7, 1.3),
        "corner": 0.27e-3 * u(0.7, 1.3),
        "ohm": 0.18 * u(0.95, 1.05),
        "spring": float(rng.integers(SPRINGS)),
        "latent": u(4.0, 9.0),
        "edge": u(0.12, 0.3),
        "mismatch": u(1.15, 1.35),
        "wake": u(0.8e-3, 2.2e-3),
        "air_capacity": u(3.0, 7.0),
        "air_exchange": u(0.07, 0.14),
        "emissivity": u(0.6, 0.95),
        "lag": u(3.0, 10.0),
        "swing": u(0.15, 0.4),
        "swing_s": u(300.0, 900.0),
        "trickle": u(0.03, 0.09),
        "loose_from": u(150.0, 600.0),
        "loose": u(0.15, 0.4),
        "lead": u(0.4e-3, 1.2e-3),
        "play": u(0.6, 1.5),
        "fan_s": u(20.0, 45.0),
        "door": u(2.0, 5.0),
    }
    case = Apart(known, unknown, n)
    for r in range(2):
        time_s = np.arange(float(rows))
        fan = ((time_s > u(200, 350)) & (time_s < u(500, 700))).astype(float) * (r == 1)
        case.logs.append(_run(case, rng, _drive(rng, rows), fan, u(18.0, 25.0)))
    return case


def _logistic(temperature: np.ndarray, middle_c: float) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-(temperature - middle_c) / 1.6))


def _run(case: Apart, rng: np.random.Generator, current: np.ndarray, fan: np.ndarray, room_c: float) -> dict:
    n, rows = case.numbers, len(current)
    acts = {case.known, case.unknown}
    beside = np.abs(ROW[:, None] - ROW) + np.abs(COLUMN[:, None] - COLUMN)
    corner = (np.abs(ROW[:, None] - ROW) == 1) & (np.abs(COLUMN[:, None] - COLUMN) == 1)
    network = n["side"] * (beside == 1) + n["corner"] * corner
    missing = 4 - (beside == 1).sum(axis=1)
    scale = np.ones(SPRINGS)
    if "edge_loss" in acts:
        scale += n["edge"] * missing
    one = int(n["spring"])
    if "spring_mismatch" in acts:
        scale[one] *= n["mismatch"]
    latent = n["latent"] if "latent_heat" in acts else 0.0
    temperature, phase = np.full(SPRINGS, room_c), np.zeros(SPRINGS)
    air, moving = room_c, float(fan[0])
    ohm = n["ohm"]
    true = np.zeros((rows, SPRINGS))
    for row in range(rows):
        true[row] = temperature
        heat = current[row] ** 2 * ohm
        if "trickle" in acts:
            heat = heat + n["trickle"] * (np.arange(SPRINGS) == one)
        if "common_return" in acts:
            heat = heat + n["lead"] * current[row].sum() ** 2 / SPRINGS
        for step in range(round(1.0 / STEP_S)):
            now = row + step * STEP_S
            moving = moving + STEP_S / n["fan_s"] * (fan[row] - moving) if "slow_fan" in acts else float(fan[row])
            loss = (n["loss"] + moving * (n["blown"] - n["loss"])) * scale
            if "loss_swings" in acts:
                loss = loss * (1.0 + n["swing"] * np.sin(2 * np.pi * now / n["swing_s"]))
            around = room_c - (n["door"] if "door" in acts and 300.0 <= now < 520.0 else 0.0)
            surround = air if "shared_air" in acts else around
            out = loss * (temperature - surround)
            air += STEP_S * (out.sum() - n["air_exchange"] * (air - around)) / n["air_capacity"]
            flow = heat - out + network @ temperature - network.sum(axis=1) * temperature
            if "radiation" in acts:
                flow = flow - n["emissivity"] * 5.67e-8 * 277e-6 * (
                    (temperature + 273.15) ** 4 - (around + 273.15) ** 4
                )
            if "fan_wake" in acts:
                upwind = np.where(COLUMN > 0, np.roll(temperature, 1) - around, 0.0)
                flow = flow + moving * n["wake"] * upwind
            up, down = _logistic(temperature, 93.0), _logistic(temperature, 73.0)
            # on a branch and moving along it the phase goes with the temperature, between them it stays
            on_up, on_down = (phase <= up) & (flow > 0), (phase >= down) & (flow < 0)
            slope = np.where(on_up, up * (1 - up), np.where(on_down, down * (1 - down), 0.0)) / 1.6
            temperature = temperature + STEP_S * flow / (n["capacity"] + latent * slope)
            phase = np.clip(phase, _logistic(temperature, 93.0), _logistic(temperature, 73.0))
    shown = _seen(case, true, room_c) + rng.normal(0.0, NOISE_C, true.shape)
    if case.unknown == "coarse":
        shown = 1.5 * np.round(shown / 1.5)
    log = {f"i{k + 1}_a": current[:, k] for k in range(SPRINGS)}
    log |= {f"v{k + 1}_v": current[:, k] * ohm for k in range(SPRINGS)}
    log |= {f"t{k + 1}_c": shown[:, k] for k in range(SPRINGS)}
    return log | {"fan": fan, "ambient_c": np.full(rows, room_c)}


def _seen(case: Apart, true: np.ndarray, room_c: float) -> np.ndarray:
    """Return what the thermometers make of the true temperatures."""
    n, shown = case.numbers, true
    if case.known == "sensor_lag":
        shown = _filtered(shown, lambda state, value: state + (value - state) * (1.0 - np.exp(-1.0 / n["lag"])))
    if case.unknown == "backlash":
        shown = _filtered(shown, lambda state, value: np.clip(state, value - n["play"], value + n["play"]))
    if case.unknown == "loosens":
        one, since = int(n["spring"]), np.maximum(0.0, np.arange(len(true)) - n["loose_from"])
        left = 1.0 - n["loose"] * np.minimum(1.0, since / 120.0)
        shown = shown.copy()
        shown[:, one] = room_c + (shown[:, one] - room_c) * left
    return shown


def _filtered(values: np.ndarray, follow: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    out = values.copy()
    for row in range(1, len(values)):
        out[row] = follow(out[row - 1], values[row])
    return out
