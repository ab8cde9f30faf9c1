"""The stiffness layer: the keys of `[stiffness]` in array.toml, and the heat that goes down a taxel in closed form.

A taxel is two springs joined end to end, the elongation spring above. Nothing heavy is imported here: every reader of
array.toml knows these keys.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .cooling import MATERIALS

LAYERS = ("elongation", "stiffness")
NUMBERS = {
    "spring_length_mm": (0.5, 1000.0),
    "gap_mm": (0.1, 50.0),
    "joint_diameter_mm": (0.1, 20.0),
    "transformation_shift_k": (-40.0, 40.0),
}
"""Besides the keys of `[spring]`, and of `[material]` where a spring's own number follows from them."""
WORDS = {"joint": tuple(MATERIALS)}
MATERIAL = (
    "density_kg_per_m3",
    "heat_capacity_j_per_kgk",
    "latent_heat_j_per_kg",
    "resistivity_martensite_uohm_cm",
    "resistivity_austenite_uohm_cm",
)
DEFAULTS: dict[str, Any] = {"gap_mm": 2.0, "joint": "steel", "joint_diameter_mm": 2.0, "transformation_shift_k": 0.0}
"""A crimp of 2 mm. The springs are as above where nothing is said."""


def with_defaults(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a checked `[stiffness]` table with its defaults."""
    return DEFAULTS | dict(table)


def joint_w_per_k(table: Mapping[str, Any]) -> float:
    """Return what the joint conducts from end to end, W/K."""
    given = with_defaults(table)
    area_m2 = math.pi / 4.0 * (1e-3 * given["joint_diameter_mm"]) ** 2
    return MATERIALS[given["joint"]].conductivity * area_m2 / (1e-3 * given["gap_mm"])


def series_w_per_k(loss_w_per_k: float, along_w_per_k: float, joint_w_per_k: float = math.inf) -> float:
    """Return the conductance between the MEAN temperatures of two equal springs joined end to end, W/K.

    Each is a straight fin with an insulated far end that loses `loss_w_per_k` along its whole length, conducts
    `along_w_per_k` from end to end, and is heated evenly (Incropera and DeWitt, 3.6; the heating adds a constant). One
    heated by P and the other cooled by it: the joint's middle stays at the air's, and each spring's mean is
    P / G (1 - b tanh(x) / x), x = sqrt(G / A), b = 2 J / (2 J + A x tanh(x)). Of the two-node network it is P / (G + 2 S).
    """
    x = math.sqrt(loss_w_per_k / along_w_per_k)
    pull = along_w_per_k * x * math.tanh(x)
    b = 1.0 if math.isinf(joint_w_per_k) else 2 * joint_w_per_k / (2 * joint_w_per_k + pull)
    taken = b * math.tanh(x) / x
    return loss_w_per_k / 2.0 * taken / (1.0 - taken)
