"""The field: heat conduction in springs, air, walls and plates, three-dimensional, by finite elements.

Elements are prisms: quadratic triangles in the plan times quadratic intervals along the axis, for every material's border is
either upright or level. The air conducts, and gives its heat to the stream at `sink` W/m3K: so much that ONE spring alone
in an endless array-less room loses what the correlation says (`screening_length`). What the fan's stream has taken up
it carries from cell to cell (`stream`), one cell a spring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize, sparse, special

from ..model.cooling import MATERIALS
from . import correlations as by
from .geometry import Geometry
from .mesh import Box, plan_mesh, within

MM = 1e-3
RADIAL_W_PER_MK = 18.0
"""Of a spring across its axis: NiTi. Nine times less changes nothing: the air around conducts six hundred times less."""
PLATE_RISE_K = 15.0
"""Of a plate's outer face above the room, where its coefficient is taken."""
PLATE_EMISSIVITY = 0.9
GRADING = 1.8
"""Elements along the axis grow from the ends: so much of the field is there."""


@dataclass(frozen=True)
class Mesh:
    """How fine: corners of a circle, elements along half of the springs and through a plate."""

    corners: int = 12
    along: int = 3
    plate: int = 1

    def coarser(self) -> Mesh:
        """Return the mesh of elements COARSER times as large."""
        return Mesh(*(max(1, round(one / COARSER)) for one in (self.corners, self.along, self.plate)))


COARSER = 1.5
MESHES = {"coarse": Mesh(9, 2, 1), "normal": Mesh(12, 3, 1), "fine": Mesh(18, 5, 2)}


def screening_length(nusselt: float, radius: float) -> float:
    """Return lambda of k T'' = k T / lambda^2 around a cylinder, at which it loses Nu = 2 x K1(x) / K0(x), x = r / lambda."""
    x = optimize.brentq(lambda x: 2 * x * special.k1e(x) / special.k0e(x) - nusselt, 1e-6, 1e3)
    return radius / x


@dataclass
class Film:
    """What correlations say of one spring alone, at a speed of the air."""

    convection_w_per_m2k: float
    air_w_per_mk: float
    lambda_m: float

    @property
    def sink_w_per_m3k(self) -> float:
        """What the air gives to the stream."""
        return self.air_w_per_mk / self.lambda_m**2


def film_of(geometry: Geometry, fan: bool, layer: int = 0) -> Film:
    """Return the film around one spring, the air still or blown. What rises along a taxel rises from plate to plate."""
    cooling = geometry.cooling
    radius = geometry.springs[layer].radius_mm * MM
    surface, air = cooling.surface_c, geometry.ambient_c
    h = by.natural_upright_cylinder(2 * radius, geometry.height_mm * MM, surface, air)
    if fan:
        h = by.mixed(h, by.cross_flow_cylinder(2 * radius, cooling.fan_m_per_s, surface, air))
    k = by.air_conductivity(0.5 * (surface + air))
    return Film(h, k, screening_length(h * 2 * radius / k, radius))


@dataclass
class Region:
    """A material in the plan, in one layer."""

    across: float
    along: float
    heat: float
    sink: float = 0.0


@dataclass
class Layer:
    """A slice of the height, m, and what is in it."""

    thickness: float
    elements: int
    air: Region
    wall: Region
    core: Region
    """Within the smallest spring's circle."""
    ring: Region
    """From there to the largest's, where layers differ."""
    holds: int | None = None
    """Whose springs, 0 elongation, 1 stiffness."""
    graded: int = 0
    """1: the elements are small at the lower end, -1 at the upper."""


@dataclass
class Field:
    """The assembled problem: conductances (W/K), heat capacities (J/K), springs, streams."""

    conductance: sparse.csc_matrix
    capacity: sparse.csc_matrix
    spring: np.ndarray
    """(unknowns, springs): mean temperature of a spring is spring.T @ T; 1 W into it is spring @ 1."""
    taken: np.ndarray
    """(unknowns, springs): heat that a cell's air gives its stream is taken.T @ (T - stream)."""
    radiated: np.ndarray
    """(springs, springs), W/K: what springs radiate to each other and to the room, linear in their mean temperatures."""
    flow_w_per_k: list[float]
    """Heat that the stream carries per K, of each lane; empty where the air stands."""
    lanes: list[list[int]]
    """Springs in the order in which the stream meets them."""
    outer: np.ndarray
    """(unknowns,): W/K to the room through the plates' outer faces."""
    freed: np.ndarray
    """(unknowns,): W/K from the air to the room, where no cell's stream takes it up."""
    place: np.ndarray
    """(unknowns, 3): where each unknown is, m: east, north, up from the lower face."""
    levels: int
    """Heights at each place of the plan: unknown k is at height k % levels."""
    unknowns: int = field(init=False)

    def __post_init__(self) -> None:
        self.unknowns = self.conductance.shape[0]


def _layers(geometry: Geometry, films: list[Film], mesh: Mesh) -> tuple[list[Layer], bool]:
    """Return slices from the lower face up, and whether they are one half of the height, the other being its mirror."""
    spring, cooling = geometry.spring, geometry.cooling
    heat = by.air_heat_per_m3k(0.5 * (cooling.surface_c + geometry.ambient_c))
    airs = [Region(one.air_w_per_mk, one.air_w_per_mk, heat, one.sink_w_per_m3k) for one in films]
    coils = [Region(RADIAL_W_PER_MK, one.along_w_per_mk, one.heat_per_m3k) for one in geometry.springs]
    air, coil = airs[0], coils[0]
    solid = None
    if cooling.baffle != "none":
        made = MATERIALS[cooling.baffle]
        solid = Region(made.conductivity, made.conductivity, made.heat_per_m3k)
    half = spring.length_mm * MM / 2.0
    height = (cooling.baffle_height_mm or spring.length_mm) * MM
    plates: list[Layer] = []
    if cooling.plate != "none":
        made = MATERIALS[cooling.plate]
        one = Region(made.conductivity, made.conductivity, made.heat_per_m3k)
        plates = [Layer(cooling.plate_thickness_mm * MM, mesh.plate, one, one, one, one)]
    if geometry.below is not None:
        below, smallest = geometry.below, geometry.radii_mm[0]
        share = (below.joint_diameter_mm / (2 * smallest)) ** 2
        made = below.joint
        crimp = Region(made.conductivity, share * made.conductivity, share * made.heat_per_m3k)
        stack = []
        for layer in (1, 0):  # from below
            spring = geometry.springs[layer]
            ring = coils[layer] if spring.radius_mm == geometry.radii_mm[-1] else airs[layer]
            for graded in (1, -1):
                stack.append(
                    Layer(
                        spring.length_mm * MM / 2.0,
                        mesh.along,
                        airs[layer],
                        solid or airs[layer],
                        coils[layer],
                        ring,
                        layer,
                        graded,
                    )
                )
        stack.insert(2, Layer(below.gap_mm * MM, 1, air, solid or air, crimp, air))
        return [*plates, *stack, *plates], False
    if solid is None or height >= 2 * half * (1 - 1e-9):
        return [*plates, Layer(half, mesh.along, air, solid or air, coil, coil, 0, 1)], True
    low = max(1, round(2 * mesh.along * height / (2 * half)))
    gap = [
        Layer(height, low, air, solid, coil, coil, 0, 1),
        Layer(2 * half - height, max(2, 2 * mesh.along - low), air, air, coil, coil, 0, -1),
    ]
    return [*plates, *gap, *plates], False


def _heights(layers: list[Layer]) -> np.ndarray:
    at, out = 0.0, [0.0]
    for one in layers:
        share = np.linspace(0.0, 1.0, one.elements + 1)[1:]
        if one.graded > 0:
            share = share**GRADING
        elif one.graded < 0:
            share = 1.0 - (1.0 - share) ** GRADING
        out += list(at + one.thickness * share)
        at += one.thickness
    return np.array(out)


def _line(layers: list[Layer]) -> tuple[np.ndarray, list[tuple[sparse.csr_matrix, sparse.csr_matrix]]]:
    """Return the unknowns' heights, and stiffness and mass along the axis of each layer."""
    from skfem import Basis, ElementLineP2, MeshLine
    from skfem.models.poisson import laplace, mass

    line = MeshLine(_heights(layers))
    middles = line.p[0][line.t].mean(axis=0)
    edges = np.cumsum([0.0, *(one.thickness for one in layers)])
    out = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        basis = Basis(line, ElementLineP2(), elements=np.flatnonzero((middles > low) & (middles < high)))
        out.append((laplace.assemble(basis), mass.assemble(basis)))
    return Basis(line, ElementLineP2()).doflocs[0], out


def centres_of(geometry: Geometry) -> np.ndarray:
    """Return the springs' axes, (springs, 2), m: x to the east, y to the north, row 1 in the north."""
    pitch = geometry.pitch_mm * MM
    return np.array([(c * pitch, -r * pitch) for r in range(geometry.rows) for c in range(geometry.cols)])


def walls_of(geometry: Geometry) -> list[Box]:
    """Return the walls half-way between the springs: along the fan's air where there is a fan, else both ways."""
    cooling = geometry.cooling
    if cooling.baffle == "none":
        return []
    pitch, half = geometry.pitch_mm * MM, cooling.baffle_thickness_mm * MM / 2.0
    upright = [(c + 0.5) * pitch for c in range(geometry.cols - 1)]
    level = [-(r + 0.5) * pitch for r in range(geometry.rows - 1)]
    south, north = -(geometry.rows - 0.5) * pitch, 0.5 * pitch
    west, east = -0.5 * pitch, (geometry.cols - 0.5) * pitch
    blown = cooling.fan_m_per_s > 0
    out: list[Box] = []
    if not blown or cooling.fan_direction in ("south", "north"):
        out += [(x - half, south, x + half, north) for x in upright]
    if not blown or cooling.fan_direction in ("east", "west"):
        out += [(west, y - half, east, y + half) for y in level]
    return out


def lanes_of(rows: int, cols: int, direction: str) -> list[list[int]]:
    """Return the springs of each row or column, upstream first."""
    number = np.arange(rows * cols).reshape(rows, cols)
    lanes = (number if direction in ("east", "west") else number.T).tolist()
    return [lane[::-1] if direction in ("west", "north") else lane for lane in lanes]


def radiation_of(geometry: Geometry) -> np.ndarray:
    """Return what the springs' smooth cylinders radiate, W/K: to the nearest in a row or column, the rest to the room.

    Grey and weakly coupled (emissivity times view, no second reflections); a wall between counts as the room.
    """
    n = geometry.rows * geometry.cols
    out = np.zeros((geometry.count, geometry.count))
    row, col = np.divmod(np.arange(n), geometry.cols)
    beside = np.abs(row[:, None] - row) + np.abs(col[:, None] - col) == 1
    for layer, spring in enumerate(geometry.springs):
        area = 2 * math.pi * spring.radius_mm * spring.length_mm * MM**2
        whole = area * by.radiation(spring.emissivity, geometry.cooling.surface_c, geometry.ambient_c)
        view = spring.emissivity * by.view_of_neighbour(2 * spring.radius_mm, geometry.pitch_mm)
        seen = view if geometry.cooling.baffle == "none" else 0.0
        out[layer * n : (layer + 1) * n, layer * n : (layer + 1) * n] = whole * (np.eye(n) - seen * beside)
    return out


@dataclass
class _Section:
    """The array seen along its springs: its parts, and what of each belongs to which spring."""

    doflocs: np.ndarray
    """Where the unknowns are, (2, unknowns), m."""
    side_m: float
    """Of a square as large as the plates."""
    regions: dict[str, tuple[sparse.csr_matrix, sparse.csr_matrix]]
    """Laplacian and mass of core, ring, air and wall."""
    ones: np.ndarray
    in_core: np.ndarray
    in_ring: np.ndarray
    in_cell: np.ndarray
    """Integrals over a spring's core, its ring and the air of its cell, (unknowns, springs of a layer)."""


def _section(geometry: Geometry, mesh: Mesh) -> _Section:
    """Mesh an array's cross-section and assemble its parts."""
    from skfem import Basis, ElementTriP2
    from skfem.models.poisson import laplace, mass

    radius, inner = geometry.radii_mm[-1] * MM, geometry.radii_mm[0] * MM
    centres, margin = centres_of(geometry), geometry.cooling.margin_mm * MM + radius
    (x0, y0), (x1, y1) = centres.min(axis=0) - margin, centres.max(axis=0) + margin
    walls = walls_of(geometry)
    plan = plan_mesh(
        (x0, y0, x1, y1),
        [tuple(one) for one in centres],
        radius,
        walls,
        mesh.corners,
        inner if inner < radius else None,
    )
    at = plan.p[:, plan.t].mean(axis=1)  # (2, triangles)
    owner = np.hypot(at[0, :, None] - centres[:, 0], at[1, :, None] - centres[:, 1]).argmin(axis=1)
    east, north = at - centres[owner].T
    inside, core = (within(east, north, one, mesh.corners) for one in (radius, inner))
    wall = np.zeros(at.shape[1], dtype=bool)
    for left, low, right, high in walls:
        wall |= (at[0] > left) & (at[0] < right) & (at[1] > low) & (at[1] < high)
    wall &= ~inside
    cell = (np.abs(at.T - centres[owner]) < geometry.pitch_mm * MM / 2.0).all(axis=1) & ~inside & ~wall

    def parts(elements: np.ndarray) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        basis = Basis(plan, ElementTriP2(), elements=np.flatnonzero(elements))
        return laplace.assemble(basis), mass.assemble(basis)

    places = {"core": core, "ring": inside & ~core, "air": ~inside & ~wall, "wall": wall}
    regions = {name: parts(where) for name, where in places.items() if where.any()}
    ones = np.ones(regions["air"][1].shape[0])

    def of_each(where: np.ndarray) -> np.ndarray:
        return np.array([parts(where & (owner == j))[1] @ ones for j in range(len(centres))]).T

    in_core, in_cell = of_each(core), of_each(cell)
    in_ring = of_each(inside & ~core) if "ring" in regions else np.zeros_like(in_core)
    side = math.sqrt((x1 - x0) * (y1 - y0))
    return _Section(Basis(plan, ElementTriP2()).doflocs, side, regions, ones, in_core, in_ring, in_cell)


def _plates(
    geometry: Geometry, section: _Section, heights: np.ndarray, mirrored: bool
) -> tuple[sparse.csr_matrix | None, np.ndarray]:
    """Return what the plates' outer faces add to the stiffness, and the heat that they give to the room, per K."""
    levels = len(heights)
    outer = np.zeros(len(section.ones) * levels)
    if geometry.cooling.plate == "none":
        return None, outer
    hot = geometry.ambient_c + PLATE_RISE_K
    h = by.natural_plate(section.side_m, hot, geometry.ambient_c)
    h += by.radiation(PLATE_EMISSIVITY, hot, geometry.ambient_c)
    plan_mass = sum(one[1] for one in section.regions.values())
    order = np.argsort(heights)
    ends = (order[0],) if mirrored else (order[0], order[-1])
    face = sparse.csr_matrix((np.ones(len(ends)), (ends, ends)), shape=(levels, levels))
    outer += h * np.kron(np.asarray(plan_mass.sum(axis=1)).ravel(), face.diagonal())
    return h * sparse.kron(plan_mass, face), outer


def build(geometry: Geometry, fan: bool, mesh: Mesh, film: Film | None = None) -> Field:
    """Assemble an array's field, the air still or blown; `film`: another than the correlations'."""
    cooling, pitch = geometry.cooling, geometry.pitch_mm * MM
    films = [film or film_of(geometry, fan, layer) for layer in range(len(geometry.springs))]
    section = _section(geometry, mesh)
    regions, ones, n = section.regions, section.ones, section.in_core.shape[1]
    in_core, in_ring, in_cell = section.in_core, section.in_ring, section.in_cell
    layers, mirrored = _layers(geometry, films, mesh)
    times = 2.0 if mirrored else 1.0
    heights, lines = _line(layers)
    levels = len(heights)
    stiff = capacity = None
    spring, taken = (np.zeros((len(ones) * levels, geometry.count)) for _ in range(2))
    freed = np.zeros(len(spring))
    for layer, (k1, m1) in zip(layers, lines, strict=True):
        parts_of = {"core": layer.core, "ring": layer.ring, "air": layer.air, "wall": layer.wall}
        across = sum(parts_of[name].across * regions[name][0] for name in regions)
        sink = sum(parts_of[name].sink * regions[name][1] for name in regions)
        along = sum(parts_of[name].along * regions[name][1] for name in regions)
        heat = sum(parts_of[name].heat * regions[name][1] for name in regions)
        here = sparse.kron(across + sink, m1) + sparse.kron(along, k1)
        stiff = here if stiff is None else stiff + here
        here = sparse.kron(heat, m1)
        capacity = here if capacity is None else capacity + here
        weight = np.asarray(m1.sum(axis=1)).ravel()
        # air between a small spring's circle and a large one's is its cell's, too
        airs, coil = (in_cell + in_ring, in_core) if layer.ring.sink else (in_cell, in_core + in_ring)
        free = regions["air"][1] @ ones + (in_ring.sum(axis=1) if layer.ring.sink else 0.0)
        if layer.holds is not None:
            its = slice(layer.holds * n, (layer.holds + 1) * n)
            spring[:, its] += np.kron(coil, weight[:, None])
            taken[:, its] += layer.air.sink * np.kron(airs, weight[:, None])
            free = free - (airs.sum(axis=1) if fan else 0.0)
        freed += layer.air.sink * np.kron(free, weight)
    faces, outer = _plates(geometry, section, heights, mirrored)
    if faces is not None:
        stiff = stiff + faces
    stiff, capacity = times * sparse.csc_matrix(stiff), times * sparse.csc_matrix(capacity)
    lanes, flows = [], []
    for floor, one in enumerate(geometry.springs):
        heat = by.air_heat_per_m3k(geometry.ambient_c)
        for lane in lanes_of(geometry.rows, geometry.cols, cooling.fan_direction):
            lanes.append([floor * n + j for j in lane])
            flows.append(heat * cooling.fan_m_per_s * pitch * one.length_mm * MM)
    return Field(
        stiff,
        capacity,
        spring / spring.sum(axis=0),
        times * taken,
        radiation_of(geometry),
        flows if fan else [],
        lanes,
        times * outer,
        times * freed,
        np.hstack([np.repeat(section.doflocs.T, levels, axis=0), np.tile(heights, len(ones))[:, None]]),
        levels,
    )
