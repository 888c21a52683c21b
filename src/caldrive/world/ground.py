"""The ground: lane strips with markings, junctions, kerbs, sidewalks and the yards behind them."""

from __future__ import annotations

import numpy as np
import shapely

from caldrive.world.meshes import Mesh, Vertices, merge, quads, vertices
from caldrive.world.roads import RoadNetwork

KERB_HEIGHT = 0.12


def _flat(area: shapely.Geometry, z: float, color: tuple[int, int, int]) -> Mesh:
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    ring = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    made: Vertices = vertices(np.column_stack((ring, np.full(len(ring), z))), (0, 0, 1), color)
    return Mesh(made, np.arange(len(ring), dtype=np.uint32).reshape(-1, 3))


def ground_mesh(roads: RoadNetwork) -> Mesh:
    x0, y0, x1, y1 = roads.bounds
    m = 400.0
    corners = [[(x0 - m, y0 - m, -0.05), (x1 + m, y0 - m, -0.05), (x1 + m, y1 + m, -0.05), (x0 - m, y1 + m, -0.05)]]
    return merge((
        _flat(roads.roadway.simplify(0.01), 0.0, (96, 96, 98)),
        _flat(roads.sidewalk.simplify(0.02), KERB_HEIGHT, (176, 172, 165)),
        quads(corners, (110, 135, 80)),
    ))  # fmt: skip
