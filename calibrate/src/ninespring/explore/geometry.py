"""The springs of an array as the field solution has them: upright cylinders between two plates.

A coil is a stack of rings. Seen from outside, rings of wire a (radius) at a spacing s conduct into the air like a smooth
cylinder: its radius is found by a field solution of one ring (`ring_radius_mm`), not assumed. Along its axis the cylinder
conducts what the helix conducts; it has the helix' heat capacity.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from ..model import stiffness
from ..model.cooling import MATERIALS, Cooling, Material
from ..model.models import Array
from ..model.simulate import array_parameters
from .mesh import ring_mesh

SLOWEST_M_PER_S = 0.05
NITI_CONDUCTIVITY = 18.0
"""W/mK, austenite (as test/worlds)."""
PAPER_SPACING = 2.35
"""Turns follow each other by so many wire diameters where nothing says otherwise: 110 mm of the paper's wire in 10 turns
of 3.45 mm are 18.8 mm long."""


@dataclass(frozen=True)
class Spring:
    """One spring, mm; its heat capacity in J/K."""

    wire_mm: float
    coil_mm: float
    turns: float
    wire_length_mm: float
    length_mm: float
    heat_capacity_j_per_k: float
    emissivity: float

    @property
    def outer_mm(self) -> float:
        """Outer diameter."""
        return self.coil_mm + self.wire_mm

    @property
    def spacing_mm(self) -> float:
        """From turn to turn."""
        return self.length_mm / self.turns

    @functools.cached_property
    def radius_mm(self) -> float:
        """Of the smooth cylinder that conducts into the air like the coil."""
        return ring_radius_mm(self.wire_mm, self.coil_mm, self.spacing_mm)

    @property
    def along_w_per_mk(self) -> float:
        """Conductivity of the cylinder along its axis: the wire's, over its section and its way."""
        wire = NITI_CONDUCTIVITY * self.wire_mm**2 / 4.0 * self.length_mm / self.wire_length_mm
        return wire / self.radius_mm**2

    @property
    def heat_per_m3k(self) -> float:
        """Of the cylinder, J/m3K."""
        return self.heat_capacity_j_per_k / (math.pi * self.radius_mm**2 * self.length_mm * 1e-9)


@dataclass(frozen=True)
class Below:
    """The stiffness layer: its springs, and the joint by which each hangs at the one above."""

    spring: Spring
    gap_mm: float
    joint: Material
    joint_diameter_mm: float


@dataclass(frozen=True)
class Geometry:
    """An array of springs that are equal within a layer, as the field solution needs it."""

    rows: int
    cols: int
    pitch_mm: float
    spring: Spring
    cooling: Cooling
    ambient_c: float = 20.0
    below: Below | None = None

    @property
    def springs(self) -> tuple[Spring, ...]:
        """One of each layer."""
        return (self.spring,) if self.below is None else (self.spring, self.below.spring)

    @property
    def count(self) -> int:
        """Springs of all layers."""
        return len(self.springs) * self.rows * self.cols

    @property
    def height_mm(self) -> float:
        """From plate to plate."""
        return sum(one.length_mm for one in self.springs) + (self.below.gap_mm if self.below else 0.0)

    @property
    def radii_mm(self) -> tuple[float, ...]:
        """Of the smooth cylinders, the smaller first: one where both layers have the same."""
        return tuple(sorted({one.radius_mm for one in self.springs}))


def spring_of(array: Array, cooling: Cooling) -> Spring:
    """Return the spring that array.toml describes (docs/files.md); what cannot be wound is refused."""
    given = array.spring
    wire, coil, turns = (
        given.get("wire_diameter_mm", 0.8),
        given.get("coil_diameter_mm", 3.45),
        given.get("turns", 10.0),
    )
    if coil <= wire:
        raise InputError(f"a wire of {wire:g} mm cannot be wound to a mean coil of {coil:g} mm")
    around = math.pi * coil * turns
    length = cooling.spring_length_mm or PAPER_SPACING * wire * turns
    wire_length = given.get("wire_length_mm", math.hypot(around, length))
    if length < wire * turns:
        raise InputError(f"{turns:g} turns of {wire:g} mm do not fit into {length:g} mm: spring_length_mm")
    if wire_length < around:
        raise InputError(f"{wire_length:g} mm of wire are less than {turns:g} turns of {coil:g} mm ({around:.4g} mm)")
    shown = Array(1, 1, None, dict(given) | {"wire_diameter_mm": wire}, array.material)
    capacity = array_parameters(shown)["heat_capacity_j_per_k"]
    return Spring(wire, coil, turns, wire_length, length, capacity, array.material.get("emissivity", 0.4))


def geometry_of(array: Array, rows: int | None = None, cols: int | None = None) -> Geometry:
    """Return an array's geometry, of as many springs as asked; what cannot exist is refused by its numbers."""
    cooling = Cooling(**array.cooling)
    springs = {"": spring_of(array, cooling)}
    below = None
    if array.stiffness is not None:
        below = below_of(array)
        springs["[stiffness] "] = below.spring
        if cooling.baffle_height_mm:
            raise InputError("baffle_height_mm: with a stiffness layer walls go from plate to plate; leave it out")
    if array.pitch_mm is None:
        raise InputError("[array] is without pitch_mm: the couplings follow from it")
    for where, spring in springs.items():
        check_room(array.pitch_mm, where, spring, cooling)
    if 0.0 < cooling.fan_m_per_s < SLOWEST_M_PER_S:
        raise InputError(
            f"fan_m_per_s is {cooling.fan_m_per_s:g}: below {SLOWEST_M_PER_S:g} the springs move the air themselves; "
            "write 0 for still air"
        )
    if cooling.baffle != "none" and cooling.plate == "none":
        raise InputError("baffles stand on plates: plate must not be none")
    return Geometry(rows or array.rows, cols or array.cols, array.pitch_mm, springs[""], cooling, below=below)


def below_of(array: Array) -> Below:
    """Return the stiffness layer; where `[stiffness]` says nothing, its springs are those above."""
    given = stiffness.with_defaults(array.stiffness or {})
    own = array.of_layer("stiffness")
    wound = {"wire_diameter_mm", "coil_diameter_mm", "turns"} & set(given)
    if wound and "wire_length_mm" not in given:
        own.spring.pop("wire_length_mm", None)  # it is the length of the spring above
    cooling = Cooling()
    if "spring_length_mm" in given or not wound:
        cooling = Cooling(spring_length_mm=given.get("spring_length_mm", array.cooling.get("spring_length_mm")))
    try:
        spring = spring_of(own, cooling)
    except InputError as error:
        raise InputError(f"[stiffness] {error.message}") from None
    return Below(spring, given["gap_mm"], MATERIALS[given["joint"]], given["joint_diameter_mm"])


def check_room(pitch_mm: float, where: str, spring: Spring, cooling: Cooling) -> None:
    """Refuse what overlaps."""
    if pitch_mm <= spring.outer_mm:
        raise InputError(
            f"{where}coils overlap: {spring.coil_mm:g} mm mean coil + {spring.wire_mm:g} mm wire are {spring.outer_mm:g} mm, "
            f"the pitch is {pitch_mm:g} mm (if {spring.coil_mm:g} mm is the OUTER diameter, "
            f"write coil_diameter_mm = {spring.coil_mm - spring.wire_mm:g})"
        )
    if cooling.baffle != "none" and cooling.baffle_thickness_mm >= pitch_mm - spring.outer_mm:
        raise InputError(
            f"{where}a wall of {cooling.baffle_thickness_mm:g} mm does not fit between coils that are "
            f"{pitch_mm - spring.outer_mm:.3g} mm apart"
        )
    if cooling.baffle_height_mm and cooling.baffle_height_mm > spring.length_mm:
        raise InputError(
            f"baffle_height_mm is {cooling.baffle_height_mm:g}, the plates are {spring.length_mm:.4g} mm apart"
        )


@functools.cache
def ring_radius_mm(wire_mm: float, coil_mm: float, spacing_mm: float, elements: int = 12) -> float:
    """Return the radius of the smooth cylinder that conducts into the air like a stack of rings, by a field solution.

    Half a ring in half its spacing, axisymmetric; the outer edge, four coil radii away, is held.
    """
    from skfem import Basis, BilinearForm, ElementTriP2, condense, solve
    from skfem.helpers import dot, grad

    a, far = coil_mm / 2.0, 2.0 * coil_mm
    mesh, on_wire = ring_mesh(wire_mm / 2.0, a, spacing_mm / 2.0, far, elements)
    basis = Basis(mesh, ElementTriP2())

    @BilinearForm
    def conduct(u: Any, v: Any, w: Any) -> Any:
        return w.x[0] * dot(grad(u), grad(v))

    matrix = conduct.assemble(basis)
    held = basis.get_dofs(on_wire).all()
    outer = basis.get_dofs(lambda x: np.abs(x[0] - far) < 1e-9 * far).all()
    values = np.zeros(basis.N)
    values[held] = 1.0
    t = solve(*condense(matrix, x=values, D=np.union1d(held, outer)))
    flux = 2 * math.pi * float(t @ (matrix @ t))  # per K and unit conductivity, of half a spacing
    return far * math.exp(-2 * math.pi * (spacing_mm / 2.0) / flux)
