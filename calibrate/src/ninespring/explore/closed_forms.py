"""Problems whose answers are known in closed form, put to the same mesher and the same field: found and exact.

Shape factors: Incropera and DeWitt, table 4.1 (Hahne and Grigull 1975).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from ..model import stiffness
from ..model.cooling import MATERIALS, Cooling
from ..model.models import Array
from . import correlations as by
from .field import MM, PLATE_EMISSIVITY, PLATE_RISE_K, Film, Mesh, build, film_of
from .geometry import Below, Geometry, spring_of
from .mesh import plan_mesh
from .modes import Solver


def _geometry(cols: int, pitch_mm: float, **cooling: object) -> Geometry:
    around = Cooling(**cooling)  # type: ignore[arg-type]
    return Geometry(1, cols, pitch_mm, spring_of(Array(), around), around)


def _answers(geometry: Geometry, mesh: Mesh, film: Film, right: np.ndarray) -> np.ndarray:
    """Return the springs' mean steady rise, for powers in them; no radiation."""
    mesh = replace(mesh, along=1)  # along the axis nothing changes, or a parabola: one quadratic element has it
    field = build(geometry, False, mesh, film)
    return field.spring.T @ Solver(field).solve(0.0, field.spring @ right[:, None])[:, 0]


def two_cylinders(mesh: Mesh) -> tuple[float, float]:
    """Return the shape factor of two parallel cylinders in a medium, per length: 2 pi / acosh(2 (w / D)^2 - 1)."""
    geometry = _geometry(2, 5.0, plate="none", margin_mm=150.0)
    length, k = geometry.spring.length_mm * MM, 0.029
    # one gives what the other takes: nothing reaches far, and the faint sink does not count
    rise = _answers(geometry, mesh, Film(0.0, k, 10.0), np.array([1.0, -1.0]))
    exact = 2 * math.pi / math.acosh(2 * (5.0 / (2 * geometry.spring.radius_mm)) ** 2 - 1)
    return 1.0 / (rise[0] - rise[1]) / (k * length), exact


def cylinder_and_plane(mesh: Mesh) -> tuple[float, float]:
    """Return the shape factor of a cylinder beside a plane, per length: 2 pi / acosh(2 z / D)."""
    from skfem import Basis, ElementTriP2, condense, solve
    from skfem.models.poisson import laplace

    radius, depth, far = 1.0, 2.0, 80.0
    plan = plan_mesh((-far, -depth, far, far), [(0.0, 0.0)], radius, [], mesh.corners)
    basis = Basis(plan, ElementTriP2())
    matrix = laplace.assemble(basis)
    inside = np.flatnonzero(np.hypot(*plan.p[:, plan.t].mean(axis=1)) < radius)
    hot = basis.get_dofs(elements=inside).all()
    cold = basis.get_dofs(lambda x: x[1] < -depth + 1e-9).all()
    t = np.zeros(basis.N)
    t[hot] = 1.0
    t = solve(*condense(matrix, x=t, D=np.union1d(hot, cold)))
    return float(t @ (matrix @ t)), 2 * math.pi / math.acosh(depth / radius)


def plate_as_fin(mesh: Mesh) -> tuple[float, float]:
    """Return W/K that two plates take up along one edge, each a straight fin: sqrt(h k t) W tanh(m L), m^2 = h / k t.

    One face gives heat to the room; the other has air that takes nothing, and a spring that leads nowhere.
    """
    geometry = _geometry(1, 5.0, plate="steel", plate_thickness_mm=0.5, margin_mm=40.0)
    field = build(geometry, False, replace(mesh, along=1), Film(0.0, 1e-9, 1e3))
    side = 2 * (geometry.cooling.margin_mm + geometry.spring.radius_mm) * MM
    hot = geometry.ambient_c + PLATE_RISE_K
    h = by.natural_plate(side, hot, geometry.ambient_c) + by.radiation(PLATE_EMISSIVITY, hot, geometry.ambient_c)
    steel, thick = MATERIALS["steel"].conductivity, geometry.cooling.plate_thickness_mm * MM
    west = field.place[:, 0] < field.place[:, 0].min() + 1e-9
    held = west & (field.place[:, 2] < thick * (1 + 1e-9))
    free = ~held
    t = held.astype(float)
    matrix = field.conductance.tocsr()
    t[free] = splu(matrix[free][:, free].tocsc()).solve(-(matrix[free][:, held] @ t[held]))
    m = math.sqrt(h / (steel * thick))
    return float(t @ (matrix @ t)), 2 * math.sqrt(h * steel * thick) * side * math.tanh(m * side)


def spring_alone(mesh: Mesh, fan: bool = True) -> tuple[float, float]:
    """Return W/K of one spring between plates that conduct nothing: what its correlation says, h A."""
    geometry = _geometry(1, 5.0, plate="none", margin_mm=40.0)
    film = film_of(geometry, fan)
    rise = _answers(geometry, mesh, film, np.array([1.0]))
    area = 2 * math.pi * geometry.spring.radius_mm * geometry.spring.length_mm * MM**2
    return 1.0 / float(rise[0]), film.convection_w_per_m2k * area


def two_rods(mesh: Mesh, joint_diameter_mm: float = 2.0) -> tuple[float, float]:
    """Return W/K between the means of two equal springs joined end to end: stiffness.series_w_per_k.

    The air gives up all heat within a fifth of a millimetre, so that none goes along in it; what a spring loses is found
    by heating both, and both sides' walls are insulated. The joint is so short that what it loses itself does not count.
    """
    around = Cooling(plate="none", margin_mm=2.0)
    spring = spring_of(Array(), around)
    joint: dict[str, Any] = {"joint": "steel", "gap_mm": 0.002, "joint_diameter_mm": joint_diameter_mm}
    below = Below(spring, joint["gap_mm"], MATERIALS[joint["joint"]], joint_diameter_mm)
    geometry = Geometry(1, 1, 5.0, spring, around, below=below)
    mesh = replace(mesh, along=mesh.corners // 4)  # a spring is nine times as long as what the joint cools of it
    field = build(geometry, False, mesh, Film(0.0, 0.005, 2e-4))
    answers = field.spring.T @ Solver(field).solve(0.0, field.spring)
    both, apart = (1.0 / (answers[0, 0] + sign * answers[0, 1]) for sign in (1, -1))
    along = spring.along_w_per_mk * math.pi * spring.radius_mm**2 / spring.length_mm * MM
    return (apart - both) / 2.0, stiffness.series_w_per_k(both, along, stiffness.joint_w_per_k(joint))


PROBLEMS: dict[str, Callable[[Mesh], tuple[float, float]]] = {
    "two parallel cylinders": two_cylinders,
    "a cylinder and a plane": cylinder_and_plane,
    "a plate as a fin": plate_as_fin,
    "a spring alone, blown": spring_alone,
    "two rods end to end": two_rods,
}
