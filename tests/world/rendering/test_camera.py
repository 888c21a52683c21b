"""The camera's pictures, by what a person would look for in them."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from caldrive.datatypes import CameraConfig, Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.geometry import moved
from caldrive.world.rendering.camera import CameraRig, Shot
from caldrive.world.rendering.lens import Lens, mounted
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.textures import Tex, texture_layers
from caldrive.world.town import load_town
from caldrive.world.traffic.ego import VehicleConfig
from caldrive.world.truth.labels import IN_VIEW

MOUNT = CameraConfig()


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return load_roads("town02")


@pytest.fixture(scope="module")
def approach(roads: RoadNetwork) -> VehicleState:
    """12 m before a light."""
    lane = roads.lanes[roads.posts[0].lane]
    return VehicleState(lane.line.pose_at(lane.line.length - 12))


def shot(camera: CameraRig, ego: VehicleState, weather: int = 1, mount: CameraConfig = MOUNT, **scene: object) -> Image:
    cars, people, lights = scene.get("cars", ()), scene.get("people", ()), scene.get("lights", {})
    return camera.render(Shot(weather, ego, cars, people, lights, 0.0), [mount])[0]  # type: ignore[arg-type]


def difference(a: Image, b: Image) -> np.ndarray:
    return np.abs(a.astype(int) - b).max(axis=2)


def test_a_picture_has_the_mounts_size_and_is_its_own(camera: CameraRig, approach: VehicleState) -> None:
    mounts = [MOUNT, CameraConfig(width=64, height=48, left=-1.0, yaw=0.3)]
    first, second = camera.render(Shot(1, approach, (), (), {}, 0.0), mounts)
    assert (first.shape, second.shape, first.dtype) == ((88, 200, 3), (48, 64, 3), np.uint8)
    kept = first.copy()
    shot(camera, VehicleState(moved(approach.pose, turn=1.0)))
    assert (first == kept).all()


def test_the_sky_is_above_and_the_road_below(camera: CameraRig, roads: RoadNetwork) -> None:
    longest = max(roads.driveable, key=lambda lane: lane.line.length)
    picture = shot(camera, VehicleState(longest.line.pose_at(10.0))).astype(float)
    sky, road = picture[:8, 90:110].mean(axis=(0, 1)), picture[-8:, 90:120].mean(axis=(0, 1))
    assert sky[2] > sky[0] + 20
    assert np.ptp(road) < 25


def test_points_land_where_the_pinhole_puts_them() -> None:
    lens = mounted(VehicleState(Pose(10, 5, np.pi / 2)), MOUNT)
    clip = lens.matrix() @ np.array([10 - 2.0, 5 + 1.44 + 10.0, 1.2 + 1.0, 1.0])  # 10 m ahead, 2 m left, 1 m up
    x, y = clip[:2] / clip[3]
    assert (x * 100, y * 44) == pytest.approx((-20, -10))  # px from the middle, y down


def test_pictures_are_exposed_in_every_weather(camera: CameraRig, approach: VehicleState) -> None:
    for weather in range(1, 15):
        picture = shot(camera, approach, weather)
        assert 45 < picture.mean() < 190, weather
        assert (picture.max(axis=2) < 250).mean() > 0.9, weather


def test_every_weather_is_told_apart(camera: CameraRig, approach: VehicleState) -> None:
    pictures = [shot(camera, approach, weather) for weather in range(1, 15)]
    gaps = [difference(a, b).mean() for i, a in enumerate(pictures) for b in pictures[:i]]
    assert min(gaps) > 2.0


@pytest.mark.parametrize(("state", "channel"), [(LightState.RED, 0), (LightState.GREEN, 1)])
def test_a_lit_lamp_can_be_read_at_twenty_metres(
    camera: CameraRig, roads: RoadNetwork, state: LightState, channel: int
) -> None:
    post = roads.posts[0]
    ego = VehicleState(moved(post.pose, forward=-21.44, left=3.1))
    changed = difference(shot(camera, ego), shot(camera, ego, lights={post.id: state}))
    lit = shot(camera, ego, lights={post.id: state})[changed > 60].astype(int)
    assert len(lit) >= 3
    others = [c for c in range(2) if c != channel]
    assert (lit[:, channel] > lit[:, others].max(axis=1)).mean() > 0.6


@pytest.mark.parametrize("state", list(LightState))
def test_a_lamp_is_whole_in_the_picture_as_near_as_it_counts_and_a_little_nearer(
    camera: CameraRig, roads: RoadNetwork, state: LightState
) -> None:
    post = roads.posts[0]
    line, to_axle = roads.lanes[post.lane].line, VehicleConfig().front_axle
    ego = VehicleState(line.pose_at(line.length - IN_VIEW + 0.3 - to_axle))
    rows, columns = np.nonzero(difference(shot(camera, ego), shot(camera, ego, lights={post.id: state})) > 60)
    assert np.ptp(rows) >= np.ptp(columns) - 1 >= 4  # round, not cut off


def test_a_light_says_nothing_to_traffic_from_behind(camera: CameraRig, roads: RoadNetwork) -> None:
    post = roads.posts[0]
    behind = VehicleState(moved(post.pose, forward=15.0, left=2.0, turn=np.pi))
    assert not difference(shot(camera, behind), shot(camera, behind, lights={post.id: LightState.RED})).any()


def test_a_car_ahead_fills_its_part_of_the_picture(camera: CameraRig, approach: VehicleState) -> None:
    car = VehicleState(moved(approach.pose, forward=10 + 1.44 + 2.25), id="x")
    changed = difference(shot(camera, approach), shot(camera, approach, cars=[car])) > 12
    columns = np.flatnonzero(changed[44:60].sum(axis=0) > 4)
    assert 14 <= np.ptp(columns) <= 26  # 1.8 m in 10 m are 18 px
    assert abs(columns.mean() - 100) < 4


def test_cars_behind_the_camera_are_not_seen(camera: CameraRig, approach: VehicleState) -> None:
    car = VehicleState(moved(approach.pose, forward=-12), id="x")
    assert not difference(shot(camera, approach), shot(camera, approach, cars=[car]))[:, 20:-20].any()


def test_a_person_walks_with_moving_legs(camera: CameraRig, approach: VehicleState) -> None:
    mount = CameraConfig(320, 144)
    here, there = (
        PedestrianState(moved(approach.pose, forward=8, left=-0.2 * k, turn=-np.pi / 2), 1.4, on_road=True, id="p")
        for k in (0, 1)
    )
    a, b = (shot(camera, approach, mount=mount, people=[p]) for p in (here, there))
    assert (difference(a, shot(camera, approach, mount=mount)) > 25).sum() > 120
    assert (difference(a, b) > 25).any()


def test_crowds_beyond_the_room_for_them_do_no_harm(camera: CameraRig, approach: VehicleState) -> None:
    people = [PedestrianState(moved(approach.pose, forward=5 + 0.02 * k), 1.0, id=f"p{k}") for k in range(1500)]
    assert shot(camera, approach, people=people).shape == (88, 200, 3)


def test_an_unknown_weather_is_refused(camera: CameraRig, approach: VehicleState) -> None:
    with pytest.raises(ValueError, match="wanted 1 to 14"):
        shot(camera, approach, weather=0)


def test_rain_moves_and_dry_weather_stands_still(camera: CameraRig, approach: VehicleState) -> None:
    def at(weather: int, time: float) -> Image:
        return camera.render(Shot(weather, approach, (), (), {}, time), [MOUNT])[0]

    assert difference(at(6, 0.0), at(6, 0.1)).mean() > 0.5
    assert not difference(at(1, 0.0), at(1, 0.1)).any()


def test_two_towns_can_be_open_at_once(camera: CameraRig, approach: VehicleState) -> None:
    before = shot(camera, approach, 8)
    other_roads = load_roads("town01")
    other = CameraRig(load_town(other_roads.name))
    seen = shot(other, VehicleState(other_roads.driveable[0].line.pose_at(5.0)), 8)
    assert difference(seen, before).mean() > 10
    assert (shot(camera, approach, 8) == before).all()
    other.close()
    assert (shot(camera, approach, 8) == before).all()


def test_the_towns_look_different(camera: CameraRig) -> None:
    roads = load_roads("town01")
    other = CameraRig(load_town(roads.name))
    sidewalks = []
    for drawn, network in ((camera, load_roads("town02")), (other, roads)):
        lane = max(network.driveable, key=lambda lane: lane.line.length)
        pose = moved(lane.line.pose_at(lane.line.length / 2), left=-3.5)
        [seen] = drawn.render_through([Lens(pose, 1.2, -0.9, 90.0, (64, 64))], Shot(2, VehicleState(pose)))
        sidewalks.append(seen.reshape(-1, 3).mean(axis=0))
    assert np.abs(sidewalks[0] - sidewalks[1]).max() > 15
    other.close()


def test_from_above_the_whole_town_is_seen(camera: CameraRig, roads: RoadNetwork) -> None:
    x0, y0, x1, y1 = roads.bounds
    above = Lens(Pose((x0 + x1) / 2, (y0 + y1) / 2, 0.0), 220.0, -np.pi / 2, 90.0, (64, 64))
    [picture] = camera.render_through([above], Shot(1, VehicleState(above.pose)))
    assert picture.reshape(-1, 3).std(axis=0).min() > 10


_DIGEST = """
import hashlib
from caldrive.datatypes import CameraConfig, VehicleState
from caldrive.geometry import moved
from caldrive.world.rendering.camera import CameraRig, Shot
from caldrive.world.town import load_town
town = load_town("town02")
ego = VehicleState(town.roads.driveable[3].line.pose_at(8.0))
cars = [VehicleState(moved(ego.pose, forward=9.0, left=3.0), id="car")]
shot = Shot(weather=13, ego=ego, vehicles=cars, time=2.5)
pictures = CameraRig(town).render(shot, [CameraConfig(), CameraConfig(width=960, height=432)])
print(hashlib.sha256(b"".join(picture.tobytes() for picture in pictures)).hexdigest())
"""


def test_every_process_draws_the_same_bytes_whatever_lay_in_memory_before() -> None:
    digests = []
    for byte in ("0", "85"):  # glibc fills the memory that it hands out with a byte that follows from this one
        environment = {**os.environ, "MALLOC_PERTURB_": byte}
        command = [sys.executable, "-c", _DIGEST]
        digests.append(subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout)
    assert digests[0] == digests[1]
    assert len(digests[0].strip()) == 64


def test_a_lens_sees_what_lies_in_its_angle() -> None:
    view = Lens(Pose(0, 0, 0), 1.2, 0.0, 90.0, (200, 88)).view()
    seen = view.sees(np.array([(10.0, 9.0), (10.0, 11.5), (-5.0, 0.0)]), 0.5)
    assert seen.tolist() == [True, False, False]


def test_layers_stand_in_the_order_of_their_names() -> None:
    layers = texture_layers()
    assert layers.shape[0] == len(Tex)
    red = layers[Tex.SIGN_60].astype(int)
    assert red[2, 2, 0] > red[2, 2, 1] + 100  # the sign's corner is as red as its ring


def test_a_pixel_is_the_mean_of_what_lies_in_it(camera: CameraRig, approach: VehicleState) -> None:
    small, large = (shot(camera, approach, mount=CameraConfig(200 * k, 88 * k)).astype(float) for k in (1, 8))
    mean = large.reshape(88, 8, 200, 8, 3).mean(axis=(1, 3))
    points = large[4::8, 4::8]  # what a camera without antialiasing would see
    below = slice(54, None)  # kerbs and paint; further up, the large picture shows more detail
    errors = [np.sqrt(((seen - mean)[below] ** 2).mean()) for seen in (small, points)]
    assert errors[0] < 0.4 * errors[1]
