"""Meshes, by Gmsh: the plan of an array (circles and walls in a rectangle), and one ring of a coil.

Circles are polygons of the same area: a conductor's outside depends on that, and the corners' error is of higher order.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

Point = tuple[float, float]
Box = tuple[float, float, float, float]
"""x and y from, x and y to."""


@contextmanager
def _gmsh() -> Iterator[Any]:
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Verbosity", 1)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    gmsh.option.setNumber("General.NumThreads", 1)
    try:
        gmsh.model.add("plan")
        yield gmsh
    finally:
        gmsh.finalize()


def _triangles(gmsh: Any) -> Any:
    from skfem import MeshTri

    gmsh.model.mesh.generate(2)
    tags, where, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    kept, corners = gmsh.model.mesh.getElementsByType(2)
    assert len(kept)
    used = np.unique(corners)
    number[used] = np.arange(len(used))
    place = np.zeros((int(tags.max()) + 1, 2))
    place[tags.astype(int)] = where.reshape(-1, 3)[:, :2]
    return MeshTri(np.ascontiguousarray(place[used].T), np.ascontiguousarray(number[corners].reshape(-1, 3).T))


def same_area(radius: float, corners: int) -> float:
    """Return how far the corners of a polygon are from its centre that has a circle's area."""
    return radius * math.sqrt(2 * math.pi / corners / math.sin(2 * math.pi / corners))


def within(east: np.ndarray, north: np.ndarray, radius: float, corners: int) -> np.ndarray:
    """Tell which places, from its centre, are in the polygon that stands for a circle in `plan_mesh`."""
    half = math.pi / corners
    edge = same_area(radius, corners) * math.cos(half) / np.cos(np.arctan2(north, east) % (2 * half) - half)
    return np.hypot(east, north) < edge


def _size(gmsh: Any, centres: Sequence[Point], near: float, far: float, from_m: float, to_m: float) -> None:
    points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in centres]
    gmsh.model.occ.synchronize()
    distance = gmsh.model.mesh.field.add("Distance")
    gmsh.model.mesh.field.setNumbers(distance, "PointsList", points)
    size = gmsh.model.mesh.field.add("Threshold")
    for name, value in {
        "InField": distance,
        "SizeMin": near,
        "SizeMax": far,
        "DistMin": from_m,
        "DistMax": to_m,
    }.items():
        gmsh.model.mesh.field.setNumber(size, name, value)
    gmsh.model.mesh.field.setAsBackgroundMesh(size)


def plan_mesh(
    box: Box, centres: Sequence[Point], radius: float, walls: Sequence[Box], corners: int, inner: float | None = None
) -> Any:
    """Return triangles that follow circles of so many corners, and walls, in a box; `inner`: of a smaller circle in each."""
    with _gmsh() as gmsh:
        occ = gmsh.model.occ
        body = [(2, occ.addRectangle(box[0], box[1], 0.0, box[2] - box[0], box[3] - box[1]))]
        parts = []
        reaches = [same_area(one, corners) for one in (radius, inner) if one is not None]
        for (x, y), reach in itertools.product(centres, reaches):
            points = [
                occ.addPoint(
                    x + reach * math.cos(2 * math.pi * k / corners),
                    y + reach * math.sin(2 * math.pi * k / corners),
                    0.0,
                )
                for k in range(corners)
            ]
            edges = [occ.addLine(points[k], points[(k + 1) % corners]) for k in range(corners)]
            parts.append((2, occ.addPlaneSurface([occ.addCurveLoop(edges)])))
        parts += [(2, occ.addRectangle(x0, y0, 0.0, x1 - x0, y1 - y0)) for x0, y0, x1, y1 in walls]
        if parts:
            occ.fragment(body, parts)
        near = 2 * math.pi * (inner or radius) / corners * 1.2
        far = (box[2] - box[0] + box[3] - box[1]) / 20.0
        _size(gmsh, centres, near, max(far, near), 1.2 * radius, 1.2 * radius + 12 * (max(far, near) - near))
        return _triangles(gmsh)


def ring_mesh(wire: float, coil: float, half: float, far: float, elements: int) -> tuple[Any, Any]:
    """Return triangles around half a ring (in r and z), and which places are on its wire.

    The wire's centre is at (coil, 0); the mesh reaches from the axis to `far` and from 0 to `half`.
    """
    with _gmsh() as gmsh:
        occ = gmsh.model.occ
        corners = 4 * elements
        reach = same_area(wire, corners)
        body = [(2, occ.addRectangle(0.0, 0.0, 0.0, far, half))]
        if reach >= half:
            reach = wire  # turns that touch: the corners must not stand out
        points = [
            occ.addPoint(
                coil + reach * math.cos(2 * math.pi * k / corners), reach * math.sin(2 * math.pi * k / corners), 0.0
            )
            for k in range(corners)
        ]
        edges = [occ.addLine(points[k], points[(k + 1) % corners]) for k in range(corners)]
        hole = [(2, occ.addPlaneSurface([occ.addCurveLoop(edges)]))]
        occ.cut(body, hole)
        near = 2 * math.pi * wire / corners
        _size(gmsh, [(coil, 0.0)], near, far / elements, 1.1 * wire, far)
        mesh = _triangles(gmsh)

    def on_wire(x: Any) -> Any:
        return np.hypot(x[0] - coil, x[1]) < reach * (1 + 1e-6)

    return mesh, on_wire
