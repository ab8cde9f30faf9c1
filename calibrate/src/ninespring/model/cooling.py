"""How an array is cooled: the keys of `[cooling]` in array.toml, materials of plates and walls.

Nothing heavy is imported here: every reader of array.toml knows these keys.
"""

from __future__ import annotations

from dataclasses import dataclass

DIRECTIONS = ("east", "south", "west", "north")
"""Where the fan's air goes, in the order of the plant's `wake_direction`."""


@dataclass(frozen=True)
class Material:
    """A solid: W/mK, and J/m3K."""

    conductivity: float
    heat_per_m3k: float


MATERIALS = {
    "perspex": Material(0.19, 1190 * 1470),
    "fr4": Material(0.30, 1850 * 1150),
    "steel": Material(15.0, 7900 * 477),  # stainless, AISI 304
    "aluminium": Material(200.0, 2700 * 900),
    "copper": Material(390.0, 8930 * 385),
}
"""Incropera and DeWitt, tables A.1 and A.3; Perspex and FR4 by their makers' sheets."""

NUMBERS = {
    "fan_m_per_s": (0.0, 10.0),
    "spring_length_mm": (0.5, 1000.0),
    "plate_thickness_mm": (0.1, 20.0),
    "margin_mm": (2.0, 200.0),
    "baffle_thickness_mm": (0.05, 10.0),
    "baffle_height_mm": (0.1, 1000.0),
    "surface_c": (40.0, 200.0),
}
WORDS = {"fan_direction": DIRECTIONS, "plate": ("none", *MATERIALS), "baffle": ("none", *MATERIALS)}
KEYS = (*NUMBERS, *WORDS)


@dataclass(frozen=True)
class Cooling:
    """What surrounds the springs. The defaults are the paper's display: 2 cfm over a gap of 50 x 30 mm, Perspex."""

    fan_m_per_s: float = 0.63
    """Of the air that comes upon the array, with the fan at 1; 0: there is no fan."""
    fan_direction: str = "east"
    spring_length_mm: float | None = None
    """Along the axis, between the plates."""
    plate: str = "perspex"
    plate_thickness_mm: float = 3.0
    margin_mm: float = 15.0
    """Of plates and air beyond the outer springs' axes."""
    baffle: str = "none"
    """Walls half-way between the springs."""
    baffle_thickness_mm: float = 0.5
    baffle_height_mm: float | None = None
    """From one plate; left out: from plate to plate."""
    surface_c: float = 105.0
    """Of the springs, where the coefficients of convection and radiation are taken."""
