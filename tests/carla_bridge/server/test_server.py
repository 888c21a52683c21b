"""The server over its sockets, without CARLA's client."""

from __future__ import annotations

import math
import re
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import msgpack
import numpy as np
import pytest

from caldrive.carla_bridge.axes import compose
from caldrive.carla_bridge.server import clients
from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.layouts import Transform, placement
from caldrive.carla_bridge.server.maps import Maps
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.vehicles import Vehicle
from caldrive.carla_bridge.server.wire import Request
from caldrive.commands.serve_carla import make_server
from caldrive.datatypes import LightState
from caldrive.geometry import moved
from caldrive.world.roads.towns import load_roads
from caldrive.world.traffic.sidewalks import room
from tests.carla_bridge.server.wire_client import Reader, RefusedError, WireClient, free_port, positions

PORT = free_port()
SETTINGS = ServerSettings(town="town01", port=PORT)
WORLD = 1


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    made = make_server(SETTINGS)
    yield made
    made.close()


@pytest.fixture
def client(server: Server) -> Iterator[WireClient]:
    """In synchronous mode, alone in a fresh episode."""
    made = WireClient(server)
    made.synchronous()
    yield made
    made.leave()


def place(client: WireClient, k: int) -> tuple[float, float, float]:
    """The k-th of spawn points on a straight street, each before the next: x, y, yaw."""
    _, points = client.call("get_map_info")
    flat = [(x, y, yaw) for (x, y, _), (_, yaw, _) in points]
    first = next(k for k in range(len(flat)) if is_straight(flat[k : k + 4]))
    return flat[first + k]


def is_straight(points: list[tuple[float, float, float]]) -> bool:
    (x, y, yaw), *others = points
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    return all(abs((there[0] - x) * c + (there[1] - y) * s - 12.0 * k) < 0.5 for k, there in enumerate(others, 1))


def control(throttle: float = 0.0, brake: float = 0.0) -> list[object]:
    return [throttle, 0.0, brake, False, False, False, 0]


def test_a_vehicle_under_throttle_moves_from_tick_to_tick(client: WireClient) -> None:
    car, reader = client.spawn("vehicle.tesla.model3", place(client, 0)), Reader(client, WORLD)
    reader.message()
    client.call("apply_control_to_vehicle", car, control(throttle=1.0))
    before = after = (0.0, 0.0)
    for k in range(21):
        client.call("tick_cue")
        after = positions(reader.message())[car]
        before = after if k == 0 else before
    assert 3.0 < abs(after[0] - before[0]) + abs(after[1] - before[1]) < 10.0


def test_two_vehicles_do_not_stand_in_one_place(client: WireClient) -> None:
    client.spawn("vehicle.tesla.model3", place(client, 0))
    with pytest.raises(RefusedError, match="Spawn failed because of collision at spawn position"):
        client.spawn("vehicle.audi.tt", place(client, 0))


def test_what_a_client_spawned_and_set_goes_with_it(server: Server, client: WireClient) -> None:
    other = WireClient(server)
    car = other.spawn("vehicle.tesla.model3", place(client, 0))
    other.synchronous(0.05)
    assert client.call("get_episode_settings")[2] == [True, 0.05]
    other.leave()
    assert client.call("get_actors_by_id", [car]) == []
    assert client.call("get_episode_settings")[:3] == [True, False, [True, 0.1]]  # its own


def run_of_20_ticks(server: Server) -> list[bytes]:
    client = WireClient(server)
    client.synchronous()
    client.spawn("vehicle.tesla.model3", place(client, 0))
    client.spawn("walker.pedestrian.0002", place(client, 3))
    reader = Reader(client, WORLD)
    snapshots = [reader.message()]
    for _ in range(20):
        client.call("tick_cue")
        snapshots.append(reader.message())
    client.leave()
    return snapshots


def test_whoever_comes_alone_finds_the_same_world_byte_for_byte(server: Server) -> None:
    assert run_of_20_ticks(server) == run_of_20_ticks(server)


def test_the_first_program_after_the_start_finds_the_same_world_as_the_second() -> None:
    fresh = make_server(ServerSettings(town="town01", port=free_port(), cars=2, people=3))
    fresh.warm_up()
    first, second = run_of_20_ticks(fresh), run_of_20_ticks(fresh)
    fresh.close()
    assert first == second


def test_who_subscribes_already_hears_of_a_new_episode_with_its_first_step(client: WireClient) -> None:
    reader = Reader(client, WORLD)
    old = episode_of(reader.message())
    client.call("load_new_episode", "", False, 0)
    client.server.turn(0.1)
    with pytest.raises(BlockingIOError):  # a client of 0.9.16 that is leaving this stream could not bear it
        reader.socket.recv(1)
    assert episode_of(Reader(client, WORLD).message()) == old + 1
    client.call("tick_cue")
    told = reader.message()
    assert episode_of(told) == old + 1
    assert struct.unpack_from("<I", told, 48 + 32) == (0,)  # no flag that makes it ask back at once


def episode_of(snapshot: bytes) -> int:
    number: int = struct.unpack_from("<Q", snapshot, 48)[0]
    return number


def test_a_world_that_cannot_be_loaded_costs_nobody_anything(
    server: Server, client: WireClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "Odd.xodr").write_text("<OpenDRIVE/>")
    other = WireClient(server)
    car, episode = other.spawn("vehicle.tesla.model3", place(client, 0)), server.episode
    reader = Reader(other, attached(other, "sensor.other.gnss", car) + 1)
    monkeypatch.setattr(server, "maps", Maps(tmp_path))
    for name in ("Nowhere", "Carla/Maps/Odd", "random:x", "random:-1", "random:" + 40 * "9"):
        with pytest.raises(RefusedError, match=r"^found .*wanted"):
            client.call("load_new_episode", name, True, 0)
    assert client.call("get_episode_settings")[0] is True
    client.call("tick_cue")
    assert struct.unpack_from("<8xQ", reader.message()) == (server.frame,)
    assert server.episode is episode
    assert client.call("get_actors_by_id", [car])
    other.leave()


def test_a_town_without_room_for_all_who_live_there_costs_nobody_anything() -> None:
    full = make_server(ServerSettings(town="town01", port=free_port(), people=room(load_roads("town02")) + 1))
    client = WireClient(full)
    episode = full.episode
    with pytest.raises(RefusedError, match=r"town02 has room for \d+: ask for fewer with --people"):
        client.call("load_new_episode", "town02", False, 0)
    assert full.episode is episode
    client.leave()
    full.close()


@pytest.mark.parametrize("bytes_", [b"\xc1", b"\x91" * 5000, msgpack.packb([7]), msgpack.packb({}), bytes(range(256))])
def test_broken_messages_cost_their_own_connection_only(server: Server, client: WireClient, bytes_: bytes) -> None:
    with socket.create_connection(("127.0.0.1", PORT)) as broken:
        broken.send(bytes_)
        broken.settimeout(5)
        for _ in range(3):
            server.turn(0.05)
        assert broken.recv(10) == b""
    assert client.call("version") == "0.9.16"


def test_a_call_that_nobody_knows_is_refused_and_the_next_one_served(client: WireClient) -> None:
    with pytest.raises(RefusedError, match="fly"):
        client.call("fly", 1, 2)
    assert client.call("version") == "0.9.16"


def test_what_is_refused_to_a_client_that_does_not_listen_is_said_once(
    server: Server, client: WireClient, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(3):
        client.tell("apply_control_to_vehicle", 10**6, control())
        client.tell("apply_batch", [[[1, [10**6]]], [[2, [10**6, control()]]]], False)
        client.tell("set_actor_location", client.server.episode.spectator.id, [1.0, 2.0, 3.0])
    with pytest.raises(RefusedError):
        client.call("apply_ackermann_control_to_vehicle", 10**6, [0.0, 0.0, 3.0, 0.0, 0.0])  # it hears it itself
    said = capsys.readouterr().err
    assert said.count("was refused") == 2
    assert "apply_control_to_vehicle of a client was refused" in said
    assert "caldrive: apply_batch of a client was refused" in said


def test_a_light_shows_what_a_client_wants_until_its_time_is_over(server: Server, client: WireClient) -> None:
    light = server.episode.lights.actors[0]
    client.call("set_traffic_light_green_time", light.id, 1.0)
    client.call("set_traffic_light_state", light.id, 2)
    assert light.state.value == "green"
    assert light.held is not None
    for _ in range(15):
        client.call("tick_cue")
    assert light.held is None


def test_a_light_that_is_given_a_time_after_its_state_keeps_it_for_so_long(server: Server, client: WireClient) -> None:
    light = server.episode.lights.actors[0]
    client.call("set_traffic_light_state", light.id, 2)
    client.call("set_traffic_light_green_time", light.id, 30.0)
    for _ in range(200):
        client.call("tick_cue")
    assert light.state is LightState.GREEN


@pytest.mark.parametrize("state", [3, 4, -1])
def test_a_light_is_not_switched_off_and_shows_what_it_showed(server: Server, client: WireClient, state: int) -> None:
    light = server.episode.lights.actors[0]
    client.call("set_traffic_light_state", light.id, 2)
    with pytest.raises(RefusedError, match="wanted Red, Yellow or Green"):
        client.call("set_traffic_light_state", light.id, state)
    assert light.state is LightState.GREEN
    assert light.held is not None


def test_every_sign_and_light_has_its_id_on_the_map(server: Server, client: WireClient) -> None:
    on_map = set(re.findall(r'<signal [^>]*id="(\d+)"', client.call("get_map_data")))
    signs = [one for one in server.episode.all(Actor) if one.kind.startswith("traffic.speed_limit")]
    assert {one.sign for one in (*signs, *server.episode.lights.actors)} == on_map
    for sign in signs:
        middle = compose(sign.place, placement(Transform(sign.box.location)))
        lane, s = server.episode.town.roads.lane_at(middle.pose)
        assert math.hypot(lane.line.pose_at(s).x - middle.x, lane.line.pose_at(s).y - middle.y) < 2.5


def test_all_lights_can_be_frozen_on_green(server: Server, client: WireClient) -> None:
    for light in server.episode.lights.actors:
        client.call("set_traffic_light_state", light.id, 2)
        client.call("freeze_traffic_light", light.id, True)
    for _ in range(150):
        client.call("tick_cue")
    assert {light.state.value for light in server.episode.lights.actors} == {"green"}


def test_a_batch_spawns_and_what_follows_means_the_new_actor(client: WireClient) -> None:
    x, y, yaw = place(client, 0)
    then = [[[2, [0, control(throttle=1.0)]]]]
    spawn = [[0, [[1, "vehicle.audi.tt", []], [[x, y, 0.3], [0.0, yaw, 0.0]], [False], 0, "", then]]]
    results = client.call("apply_batch", [spawn, spawn, [[1, [999_999]]], [[99, []]]], False)
    assert [result[0][0] for result in results] == [1, 0, 1, 0]
    further = place(client, 2)
    somewhere = [[further[0], further[1], 1.0], [0.0, 0.0, 0.0]]
    walker = [[0, [[1, "walker.pedestrian.0001", []], somewhere, [False], 0, "", then]]]
    ((done, who),) = client.call("apply_batch", [walker], False)[0]
    assert done == 1  # it is there, though it does not drive
    assert client.call("get_actors_by_id", [who])
    reader, car = Reader(client, WORLD), results[0][0][1]
    assert car not in positions(reader.message())  # it has not been told yet
    seen = []
    for _ in range(10):
        client.call("tick_cue")
        seen.append(positions(reader.message())[car])
    assert seen[0] != seen[-1]


def test_what_follows_a_spawn_is_attached_to_it(server: Server, client: WireClient) -> None:
    x, y, yaw = place(client, 0)

    def spawn(kind: str, parent: list[object], at: object, *then: object) -> list[object]:
        return [[0, [[1, kind, []], at, parent, 0, "", [*then]]]]

    camera = spawn("sensor.other.gnss", [True, 0], [[1.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    car = spawn("vehicle.audi.tt", [False], [[x, y, 0.3], [0.0, yaw, 0.0]], camera)
    [[[done, number]], [[failed, [text]]]] = client.call("apply_batch", [car, camera], False)
    [sensor] = server.sensors()
    assert sensor.parent is not None
    assert (done, sensor.parent.id) == (1, number)
    assert failed == 0
    assert "FutureActor" in text


@pytest.mark.parametrize("fixed_delta", [[], [True], [True, 20.0], [True, -0.1], [2, -5.0], [True, float("nan")]])
def test_settings_that_cannot_be_are_refused(client: WireClient, fixed_delta: list[object]) -> None:
    with pytest.raises(RefusedError, match="fixed_delta"):
        client.call("set_episode_settings", [True, False, fixed_delta])
    client.call("tick_cue")


def test_a_step_of_0_s_is_one_by_the_clock(client: WireClient) -> None:
    client.call("set_episode_settings", [False, False, [True, 0.0]])
    assert client.server.rules.delta is None


def test_no_number_is_given_twice(client: WireClient) -> None:
    first = client.spawn("vehicle.tesla.model3", place(client, 0))
    client.call("load_new_episode", "", False, 0)
    assert client.spawn("vehicle.tesla.model3", place(client, 0)) > first
    assert not client.call("destroy_actor", first)


def attached(client: WireClient, id: str, parent: int, **attributes: str) -> int:
    """The number of a new actor 1 m ahead of another."""
    rows = [[name, 4, value] for name, value in attributes.items()]
    made = client.call("spawn_actor_with_parent", [1, id, rows], [[1, 0, 0], [0, 0, 0]], parent, 0, "")
    return int(made[0])


def test_a_long_row_of_attached_actors_is_refused(client: WireClient) -> None:
    last = client.spawn("static.prop.box01", place(client, 0))
    for _ in range(8):
        last = attached(client, "static.prop.box01", last)
    with pytest.raises(RefusedError, match="in a row"):
        attached(client, "static.prop.box01", last)
    client.call("tick_cue")


def test_a_sensor_whose_attributes_cannot_be_is_refused_when_it_is_spawned(client: WireClient) -> None:
    car = client.spawn("vehicle.tesla.model3", place(client, 0))
    with pytest.raises(RefusedError, match="found distance '1000'"):
        attached(client, "sensor.other.obstacle", car, distance="1000")


def test_a_walker_that_is_attached_to_something_walks_where_it_is(server: Server, client: WireClient) -> None:
    x, y, yaw = place(client, 0)
    box = client.spawn("static.prop.box01", (x, y, yaw))
    walker = server.episode.get(attached(client, "walker.pedestrian.0001", box))
    assert walker is not None
    assert math.hypot(walker.place.x - x, walker.place.y + y) == pytest.approx(1.0)


def test_a_fault_of_a_sensor_is_told_once_and_silences_it(
    server: Server, client: WireClient, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    car = client.spawn("vehicle.tesla.model3", place(client, 0))
    sensor = attached(client, "sensor.other.imu", car)
    Reader(client, sensor + 1)
    monkeypatch.setitem(server._senses._say, "sensor.other.imu", lambda sensor, episode: iter([1 / 0]))
    for _ in range(3):
        client.call("tick_cue")
    assert capsys.readouterr().err.count("found a fault in sensor.other.imu") == 1


def test_a_client_that_reads_no_answers_is_cut_off_before_they_pile_up(
    server: Server, client: WireClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, serve = [], server.clients._serve

    def counted(caller: int, request: Request) -> object:
        served.append(request)
        return serve(caller, request)

    monkeypatch.setattr(clients, "MOST_UNREAD", 1_000_000)
    monkeypatch.setattr(server.clients, "_serve", counted)
    deaf = WireClient(server)
    deaf.socket.send(b"".join(msgpack.packb([0, k, "get_actor_definitions", [[False]]]) for k in range(300)))
    for _ in range(5):
        server.turn(0.05)
    assert 0 < len(served) < 300
    deaf.leave()
    assert client.call("version") == "0.9.16"


def test_places_and_controls_that_are_no_numbers_do_no_harm(client: WireClient) -> None:
    with pytest.raises(RefusedError, match="finite"):
        client.spawn("vehicle.tesla.model3", (float("nan"), 0.0, 0.0))
    car = client.spawn("vehicle.tesla.model3", place(client, 0))
    client.call("apply_control_to_vehicle", car, [float("nan"), 1e300, -1e300, False, False, False, 10**9])
    client.call("tick_cue")
    client.call("tick_cue")


def test_a_taken_port_is_told(server: Server) -> None:
    with pytest.raises(OSError, match="--port"):
        make_server(SETTINGS)


def test_a_vehicle_that_hits_a_standing_one_says_so(client: WireClient) -> None:
    car = client.spawn("vehicle.tesla.model3", place(client, 0))
    sensor = client.call("spawn_actor_with_parent", [1, "sensor.other.collision", []],
                         [[0, 0, 0], [0, 0, 0]], car, 0, "")[0]  # fmt: skip
    x, y, yaw = place(client, 1)
    client.spawn("vehicle.carlamotors.firetruck", (x, y, yaw))
    reader = Reader(client, sensor + 1)
    client.call("apply_control_to_vehicle", car, control(throttle=1.0))
    for _ in range(40):
        client.call("tick_cue")
    hit = client.server.episode.get(car)
    assert isinstance(hit, Vehicle)
    assert math.hypot(*hit.motion[0]) == pytest.approx(abs(hit.state.speed), abs=1e-6)  # as it is after the contact
    own, other, impulse = msgpack.unpackb(reader.message()[48:])
    assert (own[0], other[2][1]) == (car, "vehicle.carlamotors.firetruck")
    assert sum(part**2 for part in impulse) > 1000.0**2


def test_somebody_who_is_run_into_says_so_too(server: Server, client: WireClient) -> None:
    x, y, yaw = place(client, 0)
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    car = client.spawn("vehicle.tesla.model3", (x, y, yaw))
    walker = client.spawn("walker.pedestrian.0001", (x + 5 * c, y + 5 * s, yaw))
    readers = [Reader(client, attached(client, "sensor.other.collision", one) + 1) for one in (car, walker)]
    client.call("set_actor_target_velocity", car, [10.0 * c, 10.0 * s, 0.0])
    while not server.episode.hits:
        client.call("tick_cue")
    (own, other, back), (struck, by, forth) = (msgpack.unpackb(reader.message()[48:]) for reader in readers)
    assert (own[0], other[0], struck[0], by[0]) == (car, walker, walker, car)
    assert back[0] * c + back[1] * s < -100.0  # N s
    assert forth == pytest.approx([-part for part in back])


def test_who_is_spawned_before_the_first_step_is_in_the_next_frame(server: Server) -> None:
    free = WireClient(server)
    reader = Reader(free, WORLD)
    frame, time = struct.unpack_from("<8xQd", reader.message())
    car = free.spawn("vehicle.tesla.model3", place(free, 0))
    snapshot = reader.message()
    assert struct.unpack_from("<8xQd", snapshot) == (frame + 1, time)
    assert positions(snapshot)[car] == pytest.approx(place(free, 0)[:2])
    free.leave()


@pytest.mark.parametrize("has_physics", [True, False])
def test_what_is_put_aside_far_below_the_ground_is_nowhere_until_it_is_needed(
    server: Server, client: WireClient, has_physics: bool
) -> None:
    x, y, yaw = place(client, 0)
    client.spawn("vehicle.tesla.model3", (x, y, yaw))
    aside = [[x, y, -500.0], [0.0, yaw, 0.0]]
    parked, *_ = client.call("spawn_actor", [1, "vehicle.audi.tt", []], aside)
    client.call("set_actor_simulate_physics", parked, has_physics)
    client.call("apply_control_to_vehicle", parked, control(throttle=1.0))
    walker, *_ = client.call("spawn_actor", [1, "walker.pedestrian.0001", []], aside)
    client.call("spawn_actor", [1, "static.prop.container", []], aside)
    for _ in range(5):
        client.call("tick_cue")
    assert not server.episode.hits
    assert (len(server.episode.bodies()), server.episode.props()) == (1, [])
    for number in (parked, walker):
        actor = server.episode.get(number)
        assert actor is not None
        assert (actor.place.x, actor.place.y, actor.place.z) == pytest.approx((x, -y, -500.0))
    x, y, yaw = place(client, 2)
    client.call("set_actor_transform", parked, [[x, y, 0.3], [0.0, yaw, 0.0]])
    client.call("set_actor_transform", walker, [[x, y + 5.0, 1.0], [0.0, yaw, 0.0]])
    client.call("tick_cue")
    assert len(server.episode.bodies()) == 3


def test_a_sensor_that_speaks_now_and_then_keeps_its_distance(server: Server, client: WireClient) -> None:
    for _ in range(3):
        client.call("tick_cue")
    gnss = client.spawn("sensor.other.gnss", place(client, 0), sensor_tick="0.5")
    token = server.episode.get(gnss)
    assert token is not None
    reader, spoken = Reader(client, token.stream), []
    for _ in range(14):
        client.call("tick_cue")
    for _ in range(3):
        spoken.append(struct.unpack_from("<16xd", reader.message())[0])
    assert np.diff(spoken) == pytest.approx([0.5, 0.5])


def test_gravity_is_what_imus_feel(client: WireClient) -> None:
    car = client.spawn("vehicle.tesla.model3", place(client, 0))
    reader = Reader(client, attached(client, "sensor.other.imu", car) + 1)
    client.call("set_imui_gravity", 1.62)
    assert client.call("get_imui_gravity") == 1.62
    client.call("tick_cue")
    acceleration, *_ = msgpack.unpackb(reader.message()[48:])
    assert acceleration[2] == pytest.approx(1.62)


def test_cars_of_the_town_are_told_the_limit_of_their_lane() -> None:
    served = make_server(ServerSettings(town="town01", port=free_port(), cars=20))
    roads, lawful = served.episode.town.roads, {}
    for car in served.episode.cars:
        actor = served.episode.actor_of(car.id)
        assert actor is not None
        lawful[actor.id] = roads.lane_at(car.pose)[0].limit
    rows = served._latest[48 + 36 :]
    told = {
        struct.unpack_from("<I", rows, k)[0]: struct.unpack_from("<f", rows, k + 65 + 19)[0]
        for k in range(0, len(rows), 119)
    }
    served.close()
    assert len(set(lawful.values())) > 1
    assert {number: told[number] for number in lawful} == pytest.approx(lawful)


def test_a_ray_tells_the_road_from_the_sidewalk_and_what_is_beyond(server: Server, client: WireClient) -> None:
    lane = max(server.episode.town.roads.driveable, key=lambda lane: lane.line.length)
    beside = [moved(lane.line.pose_at(lane.line.length / 2), left=left) for left in (0.0, -4.0, -8.0)]
    rays = [([pose.x, -pose.y, 1.0], [pose.x, -pose.y, -1.0]) for pose in beside]
    assert [client.call("cast_ray", *ray)[0][1] for ray in rays] == [1, 2, 10]


def test_a_refused_batch_has_the_form_of_a_list(client: WireClient) -> None:
    (((flag, (text,)),),) = client.call("apply_batch", [[[1, [1]]]] * 10_001, False)
    assert flag == 0
    assert "found" in text
