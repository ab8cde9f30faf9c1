"""What tests simulate: plants with effects, how their springs are driven, and a log's columns of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from ninespring.model import native

UNITS = {"i": "_a", "v": "_v", "t": "_c", "u": ""}


def a_plant(
    shape: tuple[int, int],
    effects: Mapping[str, Mapping[str, float]] | Iterable[str] = (),
    numbers: Mapping[str, float] | None = None,
) -> native.Plant:
    """Return a plant at rest with effects on, by name or with the numbers that each brings, and further numbers."""
    plant = native.Plant(*shape)
    plant.set_effects(effects)
    for values in (*(effects.values() if isinstance(effects, Mapping) else ()), numbers or {}):
        plant.set_all(values)
    plant.reset()
    return plant


def columns_of(**given: np.ndarray) -> dict[str, np.ndarray]:
    """Return a log's columns of what its springs have, (rows, springs): i, v, t or u."""
    return {f"{of}{k}{UNITS[of]}": one for of, values in given.items() for k, one in enumerate(values.T, 1)}


def switched(rng: np.random.Generator, rows: int, off: float, low: float, high: float) -> np.ndarray:
    """Return drives of nine springs, (rows, 9): each for half a minute to two, four times in ten off."""
    out = np.full((rows, 9), off)
    for k in range(9):
        at = int(rng.integers(5, 40))
        while at < rows:
            hold = int(rng.integers(30, 120))
            out[at : at + hold, k] = off if rng.random() < 0.4 else rng.uniform(low, high)
            at += hold
    return out


def levels(rng: np.random.Generator) -> np.ndarray:
    """Return commands of two heaters on an Arduino, (600, 2), 0 to 1: a new one each 70 s, the second's 35 s after the first's."""
    out = np.zeros((600, 2))
    for k in range(2):
        for at in range(10 + 35 * k, 600, 70):
            out[at : at + 70, k] = rng.choice([0.0, 0.3, 0.6, 1.0])
    return out
