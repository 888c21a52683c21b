"""Meshes: primitives, cars, people, ground, and what of them is drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.datatypes import PedestrianState, Pose, VehicleState
from caldrive.world.rendering.actors import car_actors, person_actors
from caldrive.world.rendering.lens import View
from caldrive.world.rendering.visibility import Level, Place, Tiles
from caldrive.world.roads.network import SIDEWALK_WIDTH
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.cars import LENGTH, SHAPES, WIDTH, car_mesh, far_car_mesh
from caldrive.world.scene.decor import TOWNS
from caldrive.world.scene.ground import KERB_HEIGHT, kerb_mesh, road_mesh
from caldrive.world.scene.meshes import Mesh, box, disc, lathe, merge
from caldrive.world.scene.people import HEIGHT, far_person_mesh, person_mesh
from caldrive.world.scene.streets import Border, chains


def area_vectors(mesh: Mesh) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.vertices["position"][mesh.triangles].astype(float), 1, 0)
    return np.cross(b - a, c - a) / 2


def volume(mesh: Mesh) -> float:
    """Enclosed volume; positive where triangles are counter-clockwise from outside."""
    return float((mesh.vertices["position"][mesh.triangles[:, 0]] * area_vectors(mesh)).sum() / 3)


def test_a_box_looks_outwards_and_has_its_size() -> None:
    made = box((1, 2, 0.5), (2, 4, 1), (255, 0, 0))
    assert np.ptp(made.vertices["position"], axis=0) == pytest.approx((2, 4, 1))
    assert volume(made) == pytest.approx(8)  # the missing underside lies at z = 0


def test_normals_agree_with_the_order_of_corners() -> None:
    made = merge((box((0, 0, 1), (1, 2, 2), (9, 9, 9)), lathe(((0.5, 0.0), (0.4, 1.0)), 6, (9, 9, 9))))
    normals = (made.vertices["normal"][made.triangles[:, 0]].astype(float) - 128) / 127
    assert ((normals * area_vectors(made)).sum(axis=1) > 0).all()


@pytest.mark.parametrize(
    ("facing", "axis", "side"), [(1, "x", (1, 0)), (-1, "x", (-1, 0)), (1, "y", (0, 1)), (-1, "y", (0, -1))]
)
def test_a_disc_looks_where_it_is_told_to(facing: int, axis: str, side: tuple[int, int]) -> None:
    total = area_vectors(disc((0, 0, 1), 1.0, 32, (0, 0, 0), facing, axis=axis)).sum(axis=0)
    assert total[:2] == pytest.approx(math.pi * np.array(side), rel=0.02, abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("make", [car_mesh, far_car_mesh])
def test_cars_have_their_size_and_look_outwards(shape: object, make: object) -> None:
    made = make(shape)  # type: ignore[operator]
    low, high = made.vertices["position"].min(axis=0), made.vertices["position"].max(axis=0)
    assert high[0] - low[0] == pytest.approx(LENGTH, abs=0.05)
    assert WIDTH <= high[1] - low[1] < WIDTH + 0.4
    assert 0 <= low[2] < 0.1
    assert volume(made) > 0
    assert len(made.triangles) < 300


def test_people_are_as_tall_as_they_say() -> None:
    for made in (person_mesh(), far_person_mesh()):
        assert made.vertices["position"][:, 2].max() == pytest.approx(HEIGHT, abs=0.03)
        assert made.vertices["position"][:, 2].min() == pytest.approx(0, abs=0.02)


def test_the_same_id_looks_the_same_and_people_differ() -> None:
    people = [PedestrianState(Pose(float(i), 0, 0), 1.0, id=f"p{i}") for i in range(40)]
    first, again = person_actors(people), person_actors(people[::-1])
    assert (first.instances["colors"] == again.instances["colors"][::-1]).all()
    assert len(np.unique(first.instances["colors"].reshape(40, -1), axis=0)) > 20
    heights = first.instances["scale"][:, 2] * HEIGHT
    assert heights.min() >= 1.59
    assert heights.max() <= 1.91


def test_brake_lamps_are_lit_while_a_car_stands() -> None:
    made = car_actors([VehicleState(Pose(0, 0, 0), speed, id="a") for speed in (0.0, 8.0)]).instances["colors"]
    assert made[0, 1, 0] > made[1, 1, 0] + 50


def test_a_standing_person_does_not_swing() -> None:
    made = person_actors([PedestrianState(Pose(3, 2, 1), speed, id="a") for speed in (0.0, 1.4)]).instances
    assert made["scale"][0, 3] == 0
    assert made["scale"][1, 3] > 0.2


@pytest.mark.parametrize("name", ["town01", "town02"])
def test_every_metre_of_street_lies_between_centre_line_and_edge(name: str) -> None:
    roads = load_roads(name)
    found = chains(roads)
    assert {(c.left, c.right) for c in found} == {(Border.CENTER, Border.EDGE)}
    assert sum(c.stop for c in found) == len(roads.posts)


@pytest.mark.parametrize("name", ["town01", "town02"])
def test_the_asphalt_covers_the_roadway_and_kerbs_stand_beside_it(name: str) -> None:
    roads = load_roads(name)
    asphalt = area_vectors(road_mesh(roads, TOWNS["town01"].ground))
    assert (asphalt[:, 2] > 0).all()
    assert 1.0 < asphalt[:, 2].sum() / roads.roadway.area < 1.09  # a little lies under kerbs and strips
    kerbs = kerb_mesh(roads, TOWNS["town01"].ground)
    assert kerbs.vertices["position"][:, 2].max() == pytest.approx(KERB_HEIGHT)
    flat = area_vectors(kerbs)[:, 2]
    assert flat[flat > 0].sum() == pytest.approx(roads.roadway.length * SIDEWALK_WIDTH, rel=0.05)


def test_only_what_faces_the_eye_in_view_is_drawn() -> None:
    near, behind, far = (box((x, 0, 0.5), (1, 1, 1), (0, 0, 0)) for x in (10.0, -10.0, 500.0))
    tiles = Tiles([(merge((near, behind, far)), Level.ALWAYS)])
    eye = np.array([0.0, 0.0, 0.5])
    view = View(eye, np.array([1.0, 0.0]), np.array([0.0, 1.0]), 1.0)
    drawn = tiles.visible(view, Place.around(eye, 1.0, 30.0), lambda: None, 100.0)
    at = tiles.vertices["position"][drawn]
    assert len(drawn) == 2
    assert at[..., 0] == pytest.approx(9.5)


def test_details_are_drawn_near_and_their_stand_ins_far() -> None:
    parts = [(box((20, 0, 0.5), (1, 1, 1), (k, 0, 0)), level) for k, level in ((1, Level.NEAR), (2, Level.FAR))]
    tiles = Tiles(parts)
    for x, wanted in ((0.0, 1), (-40.0, 2)):
        eye = np.array([x, 0.0, 0.5])
        view = View(eye, np.array([1.0, 0.0]), np.array([0.0, 1.0]), 1.0)
        drawn = tiles.visible(view, Place.around(eye, 1.0, 40.0), lambda: None, 100.0)
        assert set(tiles.vertices["color"][drawn][..., 0].ravel()) == {wanted}
