"""The effects that a diagnosis knows (design, section 5): numbers, physical bounds, variants, sizes to try."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from . import native
from .fitting import Free, Problem, Spec

ON_CHIP = frozenset(
    (
        "radiation",
        "natural_convection",
        "latent_heat",
        "resistance_phase",
        "shared_air",
        "plate_conduction",
        "fan_wake",
        "edge_loss",
        "spring_mismatch",
    )
)
MEASUREMENT = frozenset(("ambient_drift", "sensor_lag", "sensor_gain", "optical_mixing"))
WHY_NOT_ON_CHIP = {
    "ambient_drift": "the surroundings of this run, not the array: the chip takes ambient as an input",
    "sensor_lag": "belongs to the thermometer, not to the array: the chip must not be corrected with it",
    "sensor_gain": "belongs to the thermometer, not to the array: the chip must not be corrected with it",
    "optical_mixing": "belongs to the camera, not to the array: the chip must not be corrected with it",
    "supply_sag": "the chip measures voltage and current of each spring: it sees the real power",
}
IN_WORDS = {
    "radiation": "heat radiates away, more than in proportion",
    "natural_convection": "still air carries more heat away the hotter a spring is",
    "latent_heat": "the phase change takes up and gives back heat",
    "resistance_phase": "the resistance, and with it the heat, depends on the phase",
    "shared_air": "the air between the springs warms up",
    "plate_conduction": "the springs heat a common plate",
    "fan_wake": "the fan's air carries heat from one spring to the next",
    "edge_loss": "outer springs lose more heat",
    "spring_mismatch": "one spring differs from the others",
    "supply_sag": "the supply gives less while other springs draw",
    "ambient_drift": "the surroundings change during the run",
    "sensor_lag": "the thermometers follow late",
    "sensor_gain": "the thermometers read in a wrong proportion or with an offset",
    "optical_mixing": "the camera's pixels also see neighbours or a background",
}


@dataclass(frozen=True)
class Candidate:
    """One way an effect can be there: its free numbers, what is fixed with it, sizes to probe and start at."""

    effect: str
    variant: str
    free: tuple[Free, ...]
    fixed: tuple[tuple[str, float], ...] = ()
    probes: tuple[Mapping[str, float], ...] = ()
    """Values at which its direction is simulated for the forecast (one direction each)."""
    signed: bool = False
    """Whether minus its direction is physical too."""
    most: float = 3.0
    """How many times its probe size a forecast may use."""
    more_starts: tuple[Mapping[str, float], ...] = field(default=())
    also_on: tuple[str, ...] = ()
    """Further effects of the plant that carry it."""

    def start_at(self, size: float) -> dict[str, float]:
        """Return starting values for a forecast size (1: as probed)."""
        if not self.probes:
            return {}
        out = dict(self.probes[0])
        if len(self.free) == 1:
            one = self.free[0]
            neutral = NEUTRAL.get(one.names[0].partition("[")[0] if one.names else "", 0.0)
            value = neutral + size * (out[one.key] - neutral)
            if one.log:
                value = max(value, out[one.key] * 0.05)
            out[one.key] = min(one.high, max(one.low, value))
        return out


NEUTRAL = {
    "loss_scale": 1.0,
    "heat_capacity_scale": 1.0,
    "sensor_gain": 1.0,
    "resistance_austenite_ohm": float("nan"),
}


def positive(name: str, low: float, high: float, start: float, effect: str | None) -> Free:
    """Return a positive number fitted in its logarithm."""
    return Free(name, start, low, high, native.parameter_table()[name].unit, (name,), True, effect=effect)


def linear(name: str, low: float, high: float, start: float, scale: float, effect: str | None) -> Free:
    """Return a number fitted as it is; `scale` is a change that matters."""
    base = name.partition("[")[0]
    unit = native.parameter_table()[base].unit
    return Free(name, start, low, high, unit, (name,), False, effect=effect, scale=scale)


def base_spec(problem: Problem, frozen: bool = False, extra: Mapping[str, float] | None = None) -> Spec:
    """Return the declared model of these runs: what is always fitted (nothing where frozen)."""
    runs = problem.runs
    fixed = dict(problem.declared) | dict(extra or {})
    free: list[Free] = []
    get = problem.base_value
    modes = {run.mode for run in runs}
    if "current" in modes and "resistance_ohm" not in fixed:
        # without voltages nothing fixes the scale of power: the declared martensite's resistance does
        fixed["resistance_ohm"] = get("resistance_martensite_ohm")
    if not frozen:
        fan = np.concatenate([run.fan for run in runs])
        still, blowing = bool((fan < 0.9).any()), bool((fan > 0.1).any())
        if modes != {"command"}:
            free.append(_declared(problem, "heat_capacity_j_per_k", 0.02, 50.0))
        names = [("loss", 1e-4, 1.0), ("orthogonal", 1e-6, 0.5), ("diagonal", 1e-7, 0.5)]
        rows, cols = problem.array.rows, problem.array.cols
        if rows * cols < 2:
            names = names[:1]
        elif min(rows, cols) < 2:
            names = names[:2]
        for name, low, high in names:
            if still:
                free.append(_declared(problem, f"{name}_w_per_k", low, high))
            if blowing:
                free.append(_declared(problem, f"{name}_fan_w_per_k", low, high))
        if "command" in modes:
            for k in range(runs[0].springs):
                if any(np.any(run.drive[:, k] > 0) for run in runs):
                    key = f"command_power_w[{k + 1}]"
                    free.append(Free(key, get("command_power_w"), 1e-4, 100.0, "W", (key,), True))
    for r, run in enumerate(runs):
        if run.ambient_c is None:
            first = run.temperature_c[: max(3, len(run.time_s) // 200)]
            guess = float(np.nanmedian(first)) if np.isfinite(first).any() else 20.0
            coldest = float(np.nanmin(run.temperature_c))
            guess = min(guess, coldest + 3.0) if not np.any(run.drive[0] > 0) else min(guess, 25.0)
            free.append(
                Free(
                    f"ambient_c@{r + 1}",
                    float(np.clip(guess, -20.0, 60.0)),
                    -35.0,
                    75.0,
                    "degC",
                    (),
                    False,
                    run=r,
                    scale=1.0,
                )
            )
    return Spec((), tuple(fixed.items()), tuple(free), ())


def _declared(problem: Problem, name: str, low: float, high: float) -> Free:
    start = min(high, max(low, problem.base_value(name)))
    return Free(name, start, low, high, native.parameter_table()[name].unit, (name,), True)


def candidates(problem: Problem) -> list[Candidate]:
    """Return every effect, in every variant, that these runs could show."""
    array, runs = problem.array, problem.runs
    springs, rows, cols = array.springs, array.rows, array.cols
    modes = {run.mode for run in runs}
    fan = np.concatenate([run.fan for run in runs])
    hottest = max(float(np.nanmax(run.temperature_c)) for run in runs)
    get = problem.base_value
    out: list[Candidate] = []

    def add(effect: str, variant: str, free: list[Free], probes: list[dict[str, float]], **more: object) -> None:
        out.append(Candidate(effect, variant, tuple(free), probes=tuple(probes), **more))  # type: ignore[arg-type]

    add(
        "radiation",
        "",
        [linear("emissivity", 0.0, 1.0, 0.4, 0.3, "radiation")],
        [{"emissivity": 0.6}],
        most=1.7,
    )
    add(
        "natural_convection",
        "",
        [linear("convection_exponent", 0.0, 0.6, 0.2, 0.2, "natural_convection")],
        [{"convection_exponent": 0.2}],
        most=3.0,
    )
    transforms = hottest > get("austenite_start_c") - 8.0
    if transforms:
        add(
            "latent_heat",
            "",
            [linear("latent_heat_j", 0.0, 200.0, 5.0, 5.0, "latent_heat")],
            [{"latent_heat_j": 5.0}],
            most=6.0,
        )
    if "current" in modes and transforms:
        martensite = get("resistance_martensite_ohm")
        name = "resistance_austenite_ohm"
        add(
            "resistance_phase",
            "",
            [
                linear(
                    name,
                    0.5 * martensite,
                    2.0 * martensite,
                    1.2 * martensite,
                    0.2 * martensite,
                    "resistance_phase",
                )
            ],
            [{name: 1.15 * martensite}],
            signed=True,
            more_starts=({name: 0.85 * martensite}, {name: 1.25 * martensite}),
        )
    # Air or a plate that answers faster than a spring's tenth is in balance with them: its bounds end there.
    loss = springs * get("loss_w_per_k")
    least = 0.1 * springs * get("heat_capacity_j_per_k")
    if springs > 1:
        capacity, exchange = "air_heat_capacity_j_per_k", "air_exchange_w_per_k"
        add(
            "shared_air",
            "",
            [
                positive(capacity, least, 3000.0, 3.0, "shared_air"),
                positive(exchange, 0.01 * loss, 50.0 * loss, 2 * loss, "shared_air"),
            ],
            [
                {capacity: 3.0, exchange: 3.0 * loss},
                {capacity: 20.0, exchange: 3.0 * loss},
            ],
            more_starts=({capacity: 0.5 * springs, exchange: 2.0 * loss},),
        )
    coupling, heat, away = (
        "plate_coupling_w_per_k",
        "plate_heat_capacity_j_per_k",
        "plate_loss_w_per_k",
    )
    add(
        "plate_conduction",
        "",
        [
            positive(coupling, 1e-6, 20.0 * get("loss_w_per_k"), 1e-3, "plate_conduction"),
            positive(heat, least, 5000.0, 8.0, "plate_conduction"),
            positive(away, 1e-5, 50.0 * loss, 0.02, "plate_conduction"),
        ],
        [
            {coupling: 1e-3, heat: 6.0, away: 0.01},
            {coupling: 1e-3, heat: 40.0, away: 0.02},
        ],
        more_starts=({coupling: 1e-3, heat: 1.0 * springs, away: 3e-3},),
    )
    if (fan > 0.1).any() and springs > 1:
        for direction, name, possible in (
            (0, "east", cols > 1),
            (1, "south", rows > 1),
            (2, "west", cols > 1),
            (3, "north", rows > 1),
        ):
            if possible:
                add(
                    "fan_wake",
                    name,
                    [linear("wake_w_per_k", 0.0, 0.05, 1e-3, 1e-3, "fan_wake")],
                    [{"wake_w_per_k": 1e-3}],
                    fixed=(("wake_direction", float(direction)),),
                    most=5.0,
                )
    if springs > 4 and min(rows, cols) > 1:
        add(
            "edge_loss",
            "per free side",
            [linear("edge_loss_fraction", -0.2, 1.5, 0.1, 0.1, "edge_loss")],
            [{"edge_loss_fraction": 0.1}],
            signed=True,
            most=5.0,
        )
        outer = [k for k in range(springs) if k // cols in (0, rows - 1) or k % cols in (0, cols - 1)]
        if len(outer) < springs:
            add(
                "edge_loss",
                "outer springs alike",
                [
                    Free(
                        "outer_loss_scale",
                        1.2,
                        0.3,
                        4.0,
                        "1",
                        tuple(f"loss_scale[{k + 1}]" for k in outer),
                        False,
                        effect="edge_loss",
                        scale=0.2,
                    )
                ],
                [{"outer_loss_scale": 1.2}],
                signed=True,
                most=5.0,
                fixed=(("edge_loss_fraction", 0.0),),
                also_on=("spring_mismatch",),
            )
    if springs > 1:
        for k in range(springs):
            loss, mass = f"loss_scale[{k + 1}]", f"heat_capacity_scale[{k + 1}]"
            add(
                "spring_mismatch",
                f"spring {k + 1}",
                [
                    linear(loss, 0.2, 5.0, 1.0, 0.15, "spring_mismatch"),
                    linear(mass, 0.2, 5.0, 1.0, 0.15, "spring_mismatch"),
                ],
                [{loss: 1.15, mass: 1.0}, {loss: 1.0, mass: 1.15}],
                signed=True,
                most=5.0,
            )
    if "command" in modes and springs > 1:
        power = max(1e-3, get("command_power_w"))
        supply = get("supply_v")
        total = power * springs
        resistance = "supply_resistance_ohm"
        size = 0.1 * supply**2 / total
        for chopped, variant in enumerate(("loads that draw their mean", "chopped loads")):
            add(
                "supply_sag",
                variant,
                [linear(resistance, 0.0, 100.0, size, size, "supply_sag")],
                [{resistance: size}],
                fixed=(("supply_chopped", float(chopped)),),
                most=6.0,
                more_starts=({resistance: 0.3 * size},),
            )
    duration = max(run.duration_s for run in runs)
    add(
        "ambient_drift",
        "ramp",
        [linear("ambient_ramp_k_per_h", -60.0, 60.0, 2.0, 4.0, "ambient_drift")],
        [{"ambient_ramp_k_per_h": min(20.0, 3600.0 / max(60.0, duration))}],
        fixed=(("ambient_amplitude_k", 0.0),),
        signed=True,
        most=20.0,
    )
    drifts = []
    if duration >= 500.0:
        drifts.append(("free", "ambient_drift_k"))
    if duration >= 1800.0:
        drifts.append(("slow", "ambient_slow_drift_k"))
    for variant, key in drifts:
        free = [
            Free(
                f"{key}@{r + 1}.{k + 1}",
                0.0,
                -6.0,
                6.0,
                "K",
                (),
                False,
                run=r,
                knot=k + 1,
                effect="ambient_drift",
                scale=1.0,
            )
            for r in range(len(runs))
            for k in range(problem.hats[key][r].shape[1])
        ]
        add(
            "ambient_drift",
            variant,
            free,
            [{f.key: float(f is one) for f in free} for one in free],
            fixed=(("ambient_amplitude_k", 0.0), ("ambient_ramp_k_per_h", 0.0)),
            signed=True,
            most=10.0,
        )
    step = float(np.median(np.diff(runs[0].time_s)))
    add(
        "sensor_lag",
        "",
        [positive("sensor_lag_s", 0.02 * step, 600.0, 4.0 * step, "sensor_lag")],
        [{"sensor_lag_s": 3.0 * step}],
        most=8.0,
        more_starts=({"sensor_lag_s": 15.0 * step},),
    )
    add(
        "sensor_gain",
        "all sensors",
        [
            linear("sensor_gain", 0.7, 1.4, 1.02, 0.05, "sensor_gain"),
            linear("sensor_offset_k", -20.0, 20.0, 0.5, 1.0, "sensor_gain"),
        ],
        [
            {"sensor_gain": 1.05, "sensor_offset_k": 0.0},
            {"sensor_gain": 1.0, "sensor_offset_k": 1.0},
        ],
        signed=True,
        most=8.0,
    )
    if springs > 1:
        for k in range(springs):
            gain, offset = f"sensor_gain[{k + 1}]", f"sensor_offset_k[{k + 1}]"
            add(
                "sensor_gain",
                f"sensor {k + 1}",
                [
                    linear(gain, 0.5, 2.0, 1.0, 0.05, "sensor_gain"),
                    linear(offset, -20.0, 20.0, 0.0, 1.0, "sensor_gain"),
                ],
                [{gain: 1.05, offset: 0.0}, {gain: 1.0, offset: 1.0}],
                signed=True,
                most=8.0,
                fixed=(("sensor_gain", 1.0), ("sensor_offset_k", 0.0)),
            )
        side, corner = "optical_orthogonal", "optical_diagonal"
        free = [linear(side, 0.0, 0.2, 0.02, 0.02, "optical_mixing")]
        probe = [{side: 0.02, corner: 0.0}]
        if min(rows, cols) > 1:
            free.append(linear(corner, 0.0, 0.05, 0.005, 0.01, "optical_mixing"))
            probe.append({side: 0.0, corner: 0.01})
        add(
            "optical_mixing",
            "neighbours",
            free,
            [{f.key: one[f.key] for f in free} for one in probe],
            most=6.0,
            fixed=() if len(free) == 2 else ((corner, 0.0),),
        )
    return out
