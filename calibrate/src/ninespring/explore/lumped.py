"""The lumped network (docs/physics.md) of a field: its numbers, each with an error from the reduction and from the mesh.

The numbers are those whose network answers most like the field, for power in any spring and at rates from standing still
to 20 s. What a network with couplings to first and second neighbours cannot answer is the reduction's error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from ..model.cooling import DIRECTIONS
from ..model.models import COUPLED
from .geometry import Geometry
from .modes import Modes

RATES_PER_S = (0.0, 0.001, 0.004, 0.015, 0.05)
STILL = (
    "loss_w_per_k",
    "edge_loss_fraction",
    "orthogonal_w_per_k",
    "diagonal_w_per_k",
    "second_w_per_k",
    "heat_capacity_j_per_k",
)
PLATE = ("plate_coupling_w_per_k", "plate_heat_capacity_j_per_k", "plate_loss_w_per_k")
FAN = ("loss_fan_w_per_k", "orthogonal_fan_w_per_k", "diagonal_fan_w_per_k", "second_fan_w_per_k", "wake_w_per_k")
BELOW = ("stiffness_loss_w_per_k", "stiffness_heat_capacity_j_per_k", "stiffness_coupling_scale", "series_w_per_k")
BELOW_PLATE = ("stiffness_plate_coupling_w_per_k",)
BELOW_FAN = ("stiffness_loss_fan_w_per_k", "series_fan_w_per_k")
"""Of the stiffness layer. What begins with `stiffness_` and is not the scale, the plant has for each of its springs."""
OFF_ZERO = 1e-9
"""Numbers that cannot be negative begin above zero: their logarithm is fitted."""


@dataclass
class Pairs:
    """What the field itself says of pairs of springs in the steady state, W/K."""

    loss: np.ndarray
    """(springs,): to the room, however it gets there."""
    orthogonal: float
    diagonal: float
    second: float
    """Between springs two apart in a row or column."""
    series: float
    """Between the two springs of a taxel; 0 where there is one layer."""


def pairs_of(modes: Modes, rows: int, cols: int) -> Pairs:
    """Return means over all pairs of a kind (both ways: a stream makes them unequal), those of the elongation layer."""
    between = -np.linalg.inv(modes.response())
    n = rows * cols
    loss, series = -between.sum(axis=1), between[:n, n:]
    row, col = np.divmod(np.arange(n), cols)
    down, along = np.abs(row[:, None] - row), np.abs(col[:, None] - col)
    between = between[:n, :n]

    def mean(wanted: np.ndarray) -> float:
        return float(between[wanted].mean()) if wanted.any() else 0.0

    return Pairs(
        loss,
        mean(down + along == 1),
        mean((down == 1) & (along == 1)),
        mean((down + along == 2) & ((down == 0) | (along == 0))),
        float(np.diag(series).mean()) if series.size else 0.0,
    )


class Network:
    """The plant's network as matrices, for one shape."""

    def __init__(self, rows: int, cols: int, direction: str, layers: int = 1) -> None:
        self.n = n = rows * cols
        self.layers = layers
        row, col = np.divmod(np.arange(n), cols)
        down, along = row[:, None] - row, col[:, None] - col
        self.orthogonal = _laplacian(np.abs(down) + np.abs(along) == 1)
        self.diagonal = _laplacian((np.abs(down) == 1) & (np.abs(along) == 1))
        apart = np.abs(down) + np.abs(along)
        self.second = _laplacian((apart == 2) & ((down == 0) | (along == 0)))
        sides = (row == 0).astype(float) + (row == rows - 1) + (col == 0) + (col == cols - 1)
        self.free_sides = sides
        step = ((0, 1), (1, 0), (0, -1), (-1, 0))[DIRECTIONS.index(direction)]
        self.upstream = ((down == step[0]) & (along == step[1])).astype(float)

    def response(self, values: dict[str, float], fan: bool, rate_per_s: float) -> np.ndarray:
        """Return K per W, (springs, springs)."""
        one = self._layer(values, fan, rate_per_s)
        if self.layers == 1:
            return np.linalg.inv(one)[: self.n, : self.n]
        own = {key.removeprefix("stiffness_"): value for key, value in values.items() if key.startswith("stiffness_")}
        scale = own.pop("coupling_scale")
        own |= {key: scale * value for key, value in values.items() if key.startswith(COUPLED)}
        size, series = len(one), values["series_fan_w_per_k" if fan else "series_w_per_k"]
        both = np.zeros((2 * size, 2 * size))
        both[:size, :size], both[size:, size:] = one, self._layer(values | own, fan, rate_per_s)
        above = np.arange(self.n)
        below = above + size
        both[above, above] += series
        both[below, below] += series
        both[above, below] = both[below, above] = -series
        springs = np.concatenate([above, below])
        return np.linalg.inv(both)[np.ix_(springs, springs)]

    def _layer(self, values: dict[str, float], fan: bool, rate_per_s: float) -> np.ndarray:
        name = "_fan_w_per_k" if fan else "_w_per_k"
        n, plate = self.n, "plate_coupling_w_per_k" in values
        matrix = np.zeros((n + plate,) * 2)
        more = values["edge_loss_fraction"] * (values["edge_loss_fan_share"] if fan else 1.0)
        loss = values["loss" + name] * (1 + more * self.free_sides)
        matrix[:n, :n] = values["orthogonal" + name] * self.orthogonal + values["diagonal" + name] * self.diagonal
        matrix[:n, :n] += values["second" + name] * self.second
        matrix[:n, :n] += np.diag(loss + rate_per_s * values["heat_capacity_j_per_k"])
        if fan:
            matrix[:n, :n] -= values["wake_w_per_k"] * self.upstream
        if plate:
            to_plate = values["plate_coupling_w_per_k"]
            matrix[:n, :n] += to_plate * np.eye(n)
            matrix[:n, n] = matrix[n, :n] = -to_plate
            matrix[n, n] = (
                n * to_plate + values["plate_loss_w_per_k"] + rate_per_s * values["plate_heat_capacity_j_per_k"]
            )
        return matrix


def _laplacian(near: np.ndarray) -> np.ndarray:
    return np.diag(near.sum(axis=1)).astype(float) - near


@dataclass
class Lumped:
    """Numbers of the network, and how far they can be trusted."""

    values: dict[str, float]
    reduction: dict[str, float]
    """Standard error of each: what the network cannot answer, spread over its numbers."""
    left: float
    """What the network leaves of the field's answers, rms, as a share of a spring's answer to itself."""


def lumped_of(geometry: Geometry, still: Modes, blown: Modes | None) -> Lumped:
    """Fit the network to the field."""
    layers = len(geometry.springs)
    network = Network(geometry.rows, geometry.cols, geometry.cooling.fan_direction, layers)
    names = list(STILL)
    if geometry.cooling.plate != "none":
        names += PLATE
    if blown is not None:
        names += FAN
    if layers == 2:
        names += [*BELOW, *(BELOW_PLATE if geometry.cooling.plate != "none" else ())]
        names += BELOW_FAN if blown is not None else ()
    alone = network.n == 1
    if alone:
        names = [one for one in names if not one.startswith(("edge", "stiffness_coupling", *COUPLED))]
    elif min(geometry.rows, geometry.cols) == 1:
        names = [one for one in names if not one.startswith("diagonal")]
    if max(geometry.rows, geometry.cols) < 3:
        names = [one for one in names if not one.startswith("second")]
    fixed = dict.fromkeys((*STILL, *(FAN if blown is not None else ())), 0.0)
    if layers == 2:
        fixed["stiffness_coupling_scale"] = 1.0
    if blown is not None:
        # a free side gives off as many watts more with the fan as without
        still_w, blown_w = (pairs_of(one, geometry.rows, geometry.cols).loss.min() for one in (still, blown))
        fixed["edge_loss_fan_share"] = float(still_w / blown_w)
    wanted = [(False, rate, still.response(rate)) for rate in RATES_PER_S]
    if blown is not None:
        wanted += [(True, rate, blown.response(rate)) for rate in RATES_PER_S]
    start = _start(geometry, still, blown)

    def values_of(x: np.ndarray) -> dict[str, float]:
        found = {name: one if name == "edge_loss_fraction" else np.exp(one) for name, one in zip(names, x, strict=True)}
        return fixed | {name: float(one) for name, one in found.items()}

    def off(x: np.ndarray) -> np.ndarray:
        values = values_of(x)
        return np.concatenate(
            [
                ((network.response(values, fan, rate) - true) / np.mean(np.diag(true))).ravel()
                for fan, rate, true in wanted
            ]
        )

    x0 = np.array([start[name] if name == "edge_loss_fraction" else np.log(start[name]) for name in names])
    low = np.array([-0.24 if name == "edge_loss_fraction" else np.log(OFF_ZERO) for name in names])
    high = np.array([2.0 if name == "edge_loss_fraction" else np.log(1e3) for name in names])
    fit = optimize.least_squares(off, np.clip(x0, low + 1e-6, high - 1e-6), bounds=(low, high), x_scale="jac")
    values = values_of(fit.x)
    variance = float(fit.fun @ fit.fun) / max(1, fit.fun.size - len(names))
    spread = np.sqrt(np.maximum(0.0, np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)) * variance))
    reduction = {
        name: float(one if name == "edge_loss_fraction" else one * values[name])
        for name, one in zip(names, spread, strict=True)
    }
    for name, value in values.items():
        if 0.0 < value < 10 * OFF_ZERO:  # at the end of its range: the field has none of it
            values[name] = 0.0
            reduction.pop(name, None)
    return Lumped(values, reduction, float(np.sqrt(np.mean(fit.fun**2))))


def _start(geometry: Geometry, still: Modes, blown: Modes | None) -> dict[str, float]:
    """Return numbers to begin with: the field's own pairs."""
    pairs = pairs_of(still, geometry.rows, geometry.cols)
    side = (np.array([geometry.rows, geometry.cols]) - 1) * geometry.pitch_mm + 2 * geometry.cooling.margin_mm
    area = 1e-6 * float(np.prod(side))
    out = {
        "loss_w_per_k": 0.7 * float(pairs.loss.min()),
        "edge_loss_fraction": 0.3,
        "orthogonal_w_per_k": max(pairs.orthogonal, 1e-6),
        "diagonal_w_per_k": max(pairs.diagonal, 1e-6),
        "second_w_per_k": max(pairs.second, 1e-6),
        "heat_capacity_j_per_k": geometry.spring.heat_capacity_j_per_k,
        "plate_coupling_w_per_k": 0.2 * float(pairs.loss.mean()),
        "plate_heat_capacity_j_per_k": max(0.1, 2 * area * geometry.cooling.plate_thickness_mm * 1e-3 * 1.75e6 / 3),
        "plate_loss_w_per_k": 2 * area * 10.0,
    }
    if geometry.below is not None:
        out["stiffness_coupling_scale"] = geometry.below.spring.length_mm / geometry.spring.length_mm
        out["series_w_per_k"] = max(pairs.series, 1e-6)
        own = {"heat_capacity_j_per_k": geometry.below.spring.heat_capacity_j_per_k}
        shown = ("loss_w_per_k", "plate_coupling_w_per_k")
        out |= {f"stiffness_{key}": value for key, value in ({key: out[key] for key in shown} | own).items()}
    if blown is not None:
        windy = pairs_of(blown, geometry.rows, geometry.cols)
        out |= {
            "loss_fan_w_per_k": 0.8 * float(windy.loss.min()),
            "orthogonal_fan_w_per_k": max(windy.orthogonal, 1e-6),
            "diagonal_fan_w_per_k": max(windy.diagonal, 1e-6),
            "second_fan_w_per_k": max(windy.second, 1e-6),
            "wake_w_per_k": 0.3 * max(windy.orthogonal, 1e-6),
            "stiffness_loss_fan_w_per_k": 0.8 * float(windy.loss.min()),
            "series_fan_w_per_k": max(windy.series, 1e-6),
        }
    return out
