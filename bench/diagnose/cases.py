"""The benchmark's cases: which effects act, how strongly, what is logged. Everything follows from a seed."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from world import EFFECTS, OUTSIDE, SPRINGS, Inputs, World, random_inputs, simulate

DURATION_S = 900
NOISE_C = 0.3
CONVERSIONS = 3
"""Of a board's sensor in one row."""
BOARD = "# version: ninespring 0.1.0 mega2560, sensors integer\n"
"""What a board's log begins with."""
DEVELOPMENT_SEEDS = range(1000)
"""Seeds that the diagnosis was developed on. Never reported."""
REPORTING_SEEDS = range(300_000, 400_000)
"""Seeds of the reported figures: looked at only to report. What 100000 and 200000 up once showed led to later work."""

PAIRS = [pair for pair in itertools.combinations(EFFECTS, 2) if set(pair) != {"resistance_phase", "supply_sag"}]
BESIDE = [
    (EFFECTS[(3 * k) % len(EFFECTS)], list(OUTSIDE)[(k // len(EFFECTS) + 5 * k) % len(OUTSIDE)])
    for k in range(len(EFFECTS) * len(OUTSIDE))
]
"""Every effect of the library beside every one outside of it, mixed."""


@dataclass
class Case:
    """One case: what acts (truth), what is written for the diagnosis, what is held out."""

    group: str
    """single, pair, none, outside, beside (one of the library and one outside of it) or alloy (not as declared)."""
    truth: tuple[str, ...]
    seed: int
    world: World
    runs: list[Inputs] = field(default_factory=list)
    columns: str = "iv"
    """iv: current and voltage, i: current, u: command."""
    sensors: bool = False
    """Currents and voltages are as a board's sensors give them."""

    @property
    def name(self) -> str:
        """Short name."""
        return f"{self.group}:{'+'.join(self.truth) or 'none'}:{self.seed}"


def effect_numbers(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Return random numbers of an effect: sizes that occur, not sizes that are easy."""
    u = rng.uniform
    either = bool(rng.random() < 0.5)
    a, b = (float(k) for k in rng.choice(SPRINGS, 2, replace=False))
    return {
        "radiation": lambda: {"emissivity": u(0.5, 0.95)},
        "natural_convection": lambda: {"share": 1.0, "power": u(0.2, 0.33)},
        "latent_heat": lambda: {"joule": u(3.0, 10.0)},
        "resistance_phase": lambda: {"ratio": u(1.15, 1.35) if either else u(0.75, 0.88)},
        "shared_air": lambda: {"capacity": u(2.0, 8.0), "exchange": u(0.06, 0.16)},
        "plate_conduction": lambda: {"coupling": u(0.5e-3, 2e-3), "capacity": u(2.0, 10.0), "loss": u(5e-3, 20e-3)},
        "fan_wake": lambda: {"conductance": u(0.5e-3, 2.5e-3)},
        "edge_loss": lambda: {"fraction": u(0.08, 0.3), "per_side": float(either)},
        "spring_mismatch": lambda: {
            "spring": a,
            "loss_scale": u(1.1, 1.35) if either else u(0.7, 0.9),
            "mass_scale": u(0.85, 1.15),
        },
        "supply_sag": lambda: {"fraction": u(0.006, 0.025)},
        "ambient_drift": lambda: {"kelvin": u(1.0, 3.5) * (1 if either else -1), "period_s": u(900.0, 2500.0)},
        "sensor_lag": lambda: {"tau_s": u(1.5, 12.0)},
        "sensor_gain": lambda: {"gain": 1 + u(0.03, 0.08) * (1 if either else -1)},
        "optical_mixing": lambda: {"fraction": u(0.01, 0.05)},
        "holder_mass": lambda: {"coupling": u(1.5e-3, 6e-3), "capacity": u(0.15, 1.0), "loss": u(0.2e-3, 1.5e-3)},
        "loose_contact": lambda: {
            "spring": a,
            "period_s": u(90.0, 240.0),
            "bad_s": u(15.0, 45.0),
            "fraction": u(0.3, 0.8),
        },
        "crosstalk": lambda: {"of": a, "to": b, "fraction": u(0.08, 0.25)},
        "current_pickup": lambda: {"kelvin_per_ampere": u(0.6, 2.0)},
        "loss_ageing": lambda: {"fraction": u(0.1, 0.35) * (1 if either else -0.7)},
        "delayed_heat": lambda: {"fraction": u(0.15, 0.5), "delay_s": u(20.0, 60.0)},
        "thermal_bridge": lambda: {
            "first": 0.0 if either else 2.0,
            "second": 8.0 if either else 6.0,
            "conductance": u(0.5e-3, 2e-3),
        },
        "gusts": lambda: {"fraction": u(0.2, 0.8), "period_s": u(60.0, 200.0)},
        "plume": lambda: {"conductance": u(0.4e-3, 1.5e-3)},
    }[name]()


def make_case(group: str, truth: tuple[str, ...], seed: int) -> Case:
    """Return the case of a seed: two runs to diagnose and a third, never shown, to judge by."""
    words = [group.encode(), *(t.encode() for t in truth)]
    rng = np.random.default_rng([seed, *(int.from_bytes(w[:6], "little") for w in words)])
    u = rng.uniform
    world = World(
        heat_capacity=0.300 * u(0.85, 1.15),
        loss=5.8e-3 * u(0.9, 1.2),
        loss_fan=11.3e-3 * u(0.9, 1.1),
        orthogonal=0.586e-3 * u(0.6, 1.3),
        orthogonal_fan=0.658e-3 * u(0.6, 1.3),
        diagonal=0.293e-3 * u(0.6, 1.3),
        diagonal_fan=0.329e-3 * u(0.6, 1.3),
        command_power=u(0.7, 0.9),
    )
    for name in truth:
        world.effects[name] = effect_numbers(name, rng)
    columns = "iv"
    if "supply_sag" in truth:
        columns = "u"
    elif "resistance_phase" in truth:
        columns = "i"
    elif group == "none":
        columns = ("iv", "iv", "i", "u")[seed % 4]
    if group == "alloy":
        world.effects["_alloy"] = {"shift": float(u(-30.0, 5.0)), "hysteresis": float(u(-4.0, 6.0))}
    if columns == "u":
        world.effects["_command"] = {"on": 1.0}
    scale = 1.0 if columns == "u" else float(u(0.92, 1.02))
    fans = (False, True, True)
    runs = [random_inputs(rng, DURATION_S, fan, scale) for fan in fans]
    return Case(group, truth, seed, world, runs, columns)


def as_read(rng: np.random.Generator, current: np.ndarray, voltage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows of currents and voltages as a board's sensors give them: means of CONVERSIONS until the next row.

    Its regulator hunts by half a step of the duty; a conversion is rounded to 0.1 mA and 4 mV.
    """
    on = current > 0
    ohm = np.where(on, voltage / np.where(on, current, 1.0), 0.0)
    share = (np.arange(CONVERSIONS) + 0.5) / CONVERSIONS
    after = np.append(ohm[1:], ohm[-1])
    after = np.where(after > 0, after, ohm)
    ohm = ohm[:, None] + (after - ohm)[:, None] * share
    ampere = np.where(on[:, None], current[:, None] + rng.uniform(-0.008, 0.008, ohm.shape), 0.0)
    volt = ampere * ohm + on[:, None] * rng.normal(0.0, 5e-4, ohm.shape)
    ampere, volt = 1e-4 * np.round(ampere / 1e-4), 4e-3 * np.round(volt / 4e-3)
    mean = ampere.mean(axis=1)
    weighted = (volt * ampere).sum(axis=1) / np.where(on, ampere.sum(axis=1), 1.0)
    return mean, np.where(on, weighted, 0.0)


def write_logs(case: Case, folder: Path) -> tuple[list[Path], Path, np.ndarray]:
    """Write the two logs, the held-out log, and return their paths and the held-out truth without noise."""
    out = simulate(case.world, case.runs)
    rng = np.random.default_rng([case.seed, 77])
    paths = []
    for r, run in enumerate(case.runs):
        shown = out["shown"][r] + rng.normal(0.0, NOISE_C, out["shown"][r].shape)
        names = ["time_s"]
        columns = [run.time_s]
        for k in range(SPRINGS):
            if case.columns == "u":
                names.append(f"u{k + 1}")
                columns.append(out["command"][r][:, k])
            else:
                current, voltage = out["current"][r][:, k], out["voltage"][r][:, k]
                if case.sensors:
                    current, voltage = as_read(rng, current, voltage)
                names.append(f"i{k + 1}_a")
                columns.append(current)
                if case.columns == "iv":
                    names.append(f"v{k + 1}_v")
                    columns.append(voltage)
        for k in range(SPRINGS):
            names.append(f"t{k + 1}_c")
            columns.append(shown[:, k])
        names += ["fan", "ambient_c"]
        columns += [run.fan, run.ambient]
        path = folder / f"run{r + 1}.csv"
        np.savetxt(
            path,
            np.column_stack(columns),
            delimiter=",",
            fmt="%.5g",
            header=(BOARD if case.sensors else "") + ",".join(names),
            comments="",
        )
        paths.append(path)
    return paths[:2], paths[2], out["shown"][2]


def plan(seeds: range | list[int], groups: tuple[str, ...]) -> list[tuple[str, tuple[str, ...], int]]:
    """Return the list of cases: per seed every single effect, a few pairs, four none, every outside effect."""
    jobs: list[tuple[str, tuple[str, ...], int]] = []
    for n, seed in enumerate(seeds):
        if "single" in groups:
            jobs += [("single", (name,), seed) for name in EFFECTS]
        if "pair" in groups:
            step = 12
            picked = [PAIRS[(n * step + k) % len(PAIRS)] for k in range(step)]
            jobs += [("pair", pair, seed) for pair in picked]
        if "none" in groups:
            jobs += [("none", (), seed * 4 + k) for k in range(4)]
        if "outside" in groups:
            jobs += [("outside", (name,), seed) for name in OUTSIDE]
        if "beside" in groups:
            picked = [BESIDE[(n * 10 + k) % len(BESIDE)] for k in range(10)]
            jobs += [("beside", pair, seed) for pair in picked]
        if "alloy" in groups:
            jobs += [("alloy", ("latent_heat",), seed * 3 + k) for k in range(3)]
    return jobs
