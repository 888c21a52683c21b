"""The ground: lane strips with their markings, junctions, kerbs, sidewalks and the yards behind them.

The markings themselves are drawn by the road's shader; a strip carries what it needs: uv = (metres left of the lane's
middle, dashes from the start along its left line, metres to the stop line), color = (`Border` to the left, `Border` to
the right, half width in units of 2 cm).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.datatypes import Points
from caldrive.geometry import Polyline, mitres
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork, lane_area, rings
from caldrive.world.scene.appearance import GroundCover
from caldrive.world.scene.meshes import VERTEX, Mesh, Surface, merge, mesh_of_quads, packed, quads
from caldrive.world.scene.streets import Border, LaneChain, lane_chains

KERB_HEIGHT = 0.12  # m
KERB_WIDTH = 0.2  # m
SOLID_NEAR_JUNCTION = 18.0  # m in which centre lines are solid
YARD_LEVEL = -0.05  # m
YARD_MARGIN = 600.0  # m of ground around the roads
FAR_AWAY = 900.0  # m to a stop line where there is none
LONGEST = 24.0  # m of one piece of ground, so that what lies out of sight is left out
UNITS_PER_METRE = 50  # of the half width in a vertex's colour
JUNCTION_HALF_WIDTH = 5.0  # m, which tells the shader that no lane runs here
UP = packed((0, 0, 1))


def _resampled(line: Polyline, cuts: tuple[float, ...] = ()) -> tuple[NDArray[np.float64], Points]:
    """Arc lengths and points of a line, with more points at the cuts and wherever they lie too far apart."""
    s = np.unique(np.round(np.concatenate((line.s, [c for c in cuts if 0.5 < c < line.length - 0.5])), 3))
    pieces = [np.linspace(a, b, math.ceil((b - a) / LONGEST), endpoint=False) for a, b in pairwise(s)]
    at = np.append(np.concatenate(pieces), s[-1])
    return at, line.points_at(at)


def _strip(chain: LaneChain, dash: float) -> Mesh:
    """One lane from junction to junction; at the road's edge it reaches a little under the kerb. dash: m of a dash and
    a gap."""
    length = chain.line.length
    zone = min(SOLID_NEAR_JUNCTION, length / 2)
    s, points = _resampled(chain.line, (zone, length - zone))
    under_kerb = 0.1 * np.array([chain.left == Border.EDGE, chain.right == Border.EDGE])
    across = np.array([1, -1]) * (chain.width / 2 + under_kerb)
    xy = points[:, None] + across[:, None] * mitres(points)[:, None]
    left_s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(xy[:, 0], axis=0), axis=1))))
    phase = left_s / left_s[-1] * max(1, round(left_s[-1] / dash))
    to_stop = length - s if chain.stop else np.full(len(s), FAR_AWAY)
    rows = np.zeros((len(s), 2), VERTEX)
    rows["position"][..., :2] = xy
    rows["uv"] = np.stack(np.broadcast_arrays(across, phase[:, None], to_stop[:, None]), axis=-1)
    rows["normal"] = UP
    vertices = np.stack((rows[:-1, 1], rows[1:, 1], rows[1:, 0], rows[:-1, 0]), axis=1)
    middle = (s[:-1] + s[1:]) / 2
    near_junction = (middle < zone) | (middle > length - zone)
    left = np.where(near_junction & (chain.left == Border.CENTER), Border.SOLID_CENTER, chain.left)
    half_width = round(chain.width / 2 * UNITS_PER_METRE)
    vertices["color"] = np.stack(np.broadcast_arrays(left, chain.right, half_width), axis=-1)[:, None]
    return mesh_of_quads(vertices)


def _junctions(roads: RoadNetwork, streets: Sequence[LaneChain]) -> Mesh:
    """The asphalt that no strip covers; it reaches a little under the strips, so that no gap shows."""
    strips = [lane_area(lane.line, lane.width) for lane in streets]
    left_over = roads.roadway.difference(shapely.union_all(strips).buffer(-0.25)).buffer(-0.02).simplify(0.01)
    parts = [part for part in shapely.get_parts(left_over) if part.area > 0.05]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.MultiPolygon(parts)))
    ring = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    vertices = np.zeros(len(ring), VERTEX)
    vertices["position"] = np.column_stack((ring, np.full(len(ring), -0.01)))
    vertices["uv"] = (0, 0, FAR_AWAY)
    vertices["normal"] = UP
    vertices["color"][:, 2] = round(JUNCTION_HALF_WIDTH * UNITS_PER_METRE)
    return Mesh(vertices, np.arange(len(ring), dtype=np.uint32).reshape(-1, 3))


def road_mesh(roads: RoadNetwork, ground: GroundCover) -> Mesh:
    """All asphalt, for the road's shader."""
    streets = lane_chains(roads)
    return merge((*(_strip(street, ground.dash) for street in streets), _junctions(roads, streets)))


def _bands(ring: shapely.LinearRing, lines: Sequence[tuple[float, float]], surfaces: Sequence[Surface]) -> Mesh:
    """Strips along an edge of the roadway, which lies to the ring's left: one of each surface between lines, which are
    (m from the edge, height in m)."""
    s, points = _resampled(Polyline(shapely.get_coordinates(ring)))
    away = -mitres(points)
    rows = [np.column_stack((points + d * away, np.full(len(points), z))) for d, z in lines]
    parts = []
    for (low, high), ((near, _), (far, _)), surface in zip(pairwise(rows), pairwise(lines), surfaces, strict=True):
        uv = np.zeros((len(s) - 1, 4, 3))
        uv[..., 0] = np.stack((s[:-1], s[1:], s[1:], s[:-1]), axis=1) / surface.tile
        uv[..., 1] = np.array((far, far, near, near)) / surface.tile
        uv[..., 2] = surface.layer
        parts.append(quads(np.stack((high[:-1], high[1:], low[1:], low[:-1]), axis=1), surface.color, uv))
    return merge(parts)


def _edges(roads: RoadNetwork, tolerance: float) -> list[shapely.LinearRing]:
    """The roadway's borders, up to a tolerance in m, with the road on their left."""
    return rings(shapely.orient_polygons(roads.roadway.simplify(tolerance)))


def kerb_mesh(roads: RoadNetwork, ground: GroundCover) -> Mesh:
    """Kerbs and sidewalks as seen from near."""
    kerb = Surface(ground.kerb, tile=ground.pavement.tile)
    lines = ((0.0, -0.02), (0.0, KERB_HEIGHT), (KERB_WIDTH, KERB_HEIGHT), (SIDEWALK_WIDTH, KERB_HEIGHT))
    return merge([_bands(ring, lines, (kerb, kerb, ground.pavement)) for ring in _edges(roads, 0.02)])


def far_kerb_mesh(roads: RoadNetwork, ground: GroundCover) -> Mesh:
    """The same as seen from afar: one slope, so low that kerbs and sidewalks lie on it where they are drawn."""
    lines = ((0.0, -0.015), (SIDEWALK_WIDTH, KERB_HEIGHT - 0.03))
    return merge([_bands(ring, lines, (ground.pavement,)) for ring in _edges(roads, 0.2)])


def yard_mesh(roads: RoadNetwork, ground: GroundCover) -> Mesh:
    """One wide plane a little below the road."""
    yard = ground.yard
    x0, y0, x1, y1 = np.add(roads.bounds, (-YARD_MARGIN, -YARD_MARGIN, YARD_MARGIN, YARD_MARGIN))
    corners = np.array([[(x0, y0), (x1, y0), (x1, y1), (x0, y1)]])
    uv = np.concatenate((corners / yard.tile, np.full((1, 4, 1), float(yard.layer))), axis=2)
    return quads(np.concatenate((corners, np.full((1, 4, 1), YARD_LEVEL)), axis=2), yard.color, uv)
