"""Streets and ground: markings of every lane, asphalt without gaps, kerbs beside it."""

from __future__ import annotations

import pytest

from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.scene.ground import KERB_HEIGHT, kerb_mesh, road_mesh
from caldrive.world.scene.streets import Border, lane_chains
from caldrive.world.scene.town_appearances import TOWN01
from tests.world.scene.measures import area_vectors


def test_every_metre_of_street_lies_between_centre_line_and_edge(town: RoadNetwork) -> None:
    chains = lane_chains(town)
    assert {(chain.left, chain.right) for chain in chains} == {(Border.CENTER, Border.EDGE)}
    assert sum(chain.stop for chain in chains) == len(town.posts)


def test_the_asphalt_covers_the_roadway_and_kerbs_stand_beside_it(town: RoadNetwork) -> None:
    asphalt = area_vectors(road_mesh(town, TOWN01.ground))
    assert (asphalt[:, 2] > 0).all()
    assert 1.0 < asphalt[:, 2].sum() / town.roadway.area < 1.09  # a little lies under kerbs and strips
    kerbs = kerb_mesh(town, TOWN01.ground)
    assert kerbs.vertices["position"][:, 2].max() == pytest.approx(KERB_HEIGHT)
    flat = area_vectors(kerbs)[:, 2]
    assert flat[flat > 0].sum() == pytest.approx(town.roadway.length * SIDEWALK_WIDTH, rel=0.05)
