"""The file by which the client's crowd walks."""

from __future__ import annotations

import struct

import numpy as np

from caldrive.carla_bridge.server.navigation import POLYGON, SET_HEAD, TILE_HEAD, navigation_mesh
from caldrive.world.roads.network import RoadNetwork


def test_quadrilaterals_lie_along_the_sidewalks_and_go_around_as_the_client_wants(town01: RoadNetwork) -> None:
    content = navigation_mesh(town01)
    head = SET_HEAD.unpack_from(content)
    assert head[0] == 0x4D534554
    assert head[-1] == len(content) - SET_HEAD.size
    tile = TILE_HEAD.unpack_from(content, SET_HEAD.size)
    n, corners = tile[6], tile[7]
    assert (n * 2, head[9]) == (corners, head[-2])
    start = SET_HEAD.size + TILE_HEAD.size
    points = np.frombuffer(content, "<f4", 3 * corners, start).reshape(-1, 3)[:, [0, 2]]
    areas = []
    for k in range(n):
        _, *numbers = POLYGON.unpack_from(content, start + 12 * corners + POLYGON.size * k)
        x, y = points[numbers[:4]].T
        areas.append(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
    assert max(areas) < 0  # in CARLA's axes
    assert 0.8 < -sum(areas) / (town01.sidewalk.area * 2.4 / 3.0) < 1.2


def test_every_quadrilateral_leads_to_the_next_and_back(town01: RoadNetwork) -> None:
    content = navigation_mesh(town01)
    n, corners = struct.unpack_from("<2i", content, SET_HEAD.size + 24)
    start = SET_HEAD.size + TILE_HEAD.size + 12 * corners
    rows = [POLYGON.unpack_from(content, start + POLYGON.size * k) for k in range(n)]
    for k, row in enumerate(rows):
        before, _, following = row[7:10]
        assert rows[following - 1][7] == k + 1
        assert rows[before - 1][9] == k + 1
