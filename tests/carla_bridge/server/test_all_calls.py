"""Every call of CARLA 0.9.16's client is served, changes nothing, or is refused in a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.commands.serve_carla import make_server
from tests.carla_bridge.server.wire_client import RefusedError, WireClient, free_port

V, T = [1.0, 2.0, 3.0], [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]
SERVED: dict[str, list[Any]] = {
    "version": [], "get_episode_info": [], "get_sensor_token": [1], "get_episode_settings": [], "tick_cue": [],
    "get_map_info": [], "get_map_data": [], "get_required_files": ["Nav"], "get_available_maps": [],
    "load_map_layer": [1], "unload_map_layer": [1], "get_weather_parameters": [],
    "set_weather_parameters": [[5.0, 0.0, 0.0, 10.0, 0.0, 45.0, 2.0, 0.75, 0.1, 0.0, 1.0, 0.03, 0.03, 0.0]],
    "get_imui_gravity": [], "set_imui_gravity": [9.8], "query_lights_state": ["x"], "get_navigation_mesh": [],
    "get_actor_definitions": [], "get_spectator": [], "get_actors_by_id": [[1, 10**9]],
    "get_actor_bounding_box": ["car"], "set_actor_location": ["car", V], "set_actor_transform": ["car", T],
    "set_actor_target_velocity": ["car", V], "set_actor_target_angular_velocity": ["car", V],
    "enable_actor_constant_velocity": ["car", V], "disable_actor_constant_velocity": ["car"],
    "set_actor_simulate_physics": ["car", True], "set_actor_collisions": ["car", True],
    "set_actor_enable_gravity": ["car", True], "set_actor_dead": ["car"], "add_actor_impulse": ["car", V],
    "add_actor_force": ["car", V], "add_actor_angular_impulse": ["car", V], "add_actor_torque": ["car", V],
    "add_actor_impulse_at_location": ["car", V, V], "add_actor_force_at_location": ["car", V, V],
    "apply_control_to_vehicle": ["car", [0.1, 0.0, 0.0, False, False, False, 0]],
    "set_actor_autopilot": ["car", True], "get_physics_control": ["car"], "get_vehicle_light_state": ["car"],
    "set_vehicle_light_state": ["car", [3]], "get_vehicle_light_states": [], "get_telemetry_data": ["car"],
    "get_wheel_steer_angle": ["car", 0], "set_wheel_steer_direction": ["car", 0, 1.0],
    "get_wheel_pitch_angle": ["car", 0], "set_wheel_pitch_angle": ["car", 0, 1.0],
    "apply_ackermann_control_to_vehicle": ["car", [0.1, 0.0, 3.0, 0.0, 0.0]],
    "get_ackermann_controller_settings": ["car"],
    "apply_ackermann_controller_settings": ["car", [0.1, 0.0, 0.1, 0.1, 0.0, 0.1]],
    "open_vehicle_door": ["car", 0], "close_vehicle_door": ["car", 0], "show_vehicle_debug_telemetry": ["car", True],
    "apply_control_to_walker": ["walker", [V, 1.0, False]], "get_bones_transform": ["walker"],
    "set_bones_transform": ["walker", [[]]], "blend_pose": ["walker", 0.5], "get_pose_from_animation": ["walker"],
    "set_traffic_light_state": ["light", 2], "set_traffic_light_green_time": ["light", 3.0],
    "set_traffic_light_yellow_time": ["light", 3.0], "set_traffic_light_red_time": ["light", 3.0],
    "freeze_traffic_light": ["light", False], "reset_traffic_light_group": ["light"], "reset_all_traffic_lights": [],
    "freeze_all_traffic_lights": [False], "restore_physx_physics": ["car"],
    "get_group_traffic_lights": ["light"], "get_light_boxes": ["light"],
    "apply_batch": [[[[1, [10**9]]]], False], "is_traffic_manager_running": [8000],
    "get_traffic_manager_running": [8000], "add_traffic_manager_running": [["127.0.0.1", 8000]],
    "destroy_traffic_manager": [8000], "get_all_level_BBs": [3], "get_environment_objects": [255],
    "enable_environment_objects": [[1], True], "project_point": [V, [0.0, 0.0, -1.0], 10.0],
    "cast_ray": [V, [1.0, 2.0, -3.0]], "get_names_of_all_objects": [], "draw_debug_shape": [[[0, [V]], [0, 0, 0], 1]],
    "clear_debug_shape": [], "clear_debug_string": [], "update_lights_state": ["x", [], True],
    "update_day_night_cycle": ["x", True], "set_annotations_traverse_translucency": [True],
    "apply_color_texture_to_objects": [[], 0, 0], "apply_float_color_texture_to_objects": [[], 0, 0],
    "enable_sensor_for_ros": [2], "disable_sensor_for_ros": [2], "is_sensor_enabled_for_ros": [2],
    "get_actor_component_names": ["car"], "get_actor_bone_names": ["car"], "get_actor_socket_names": ["car"],
    "get_actor_bone_world_transforms": ["car"], "get_actor_bone_relative_transforms": ["car"],
    "get_actor_socket_world_transforms": ["car"], "get_actor_socket_relative_transforms": ["car"],
    "get_vehicle_bone_world_transforms": ["car"], "send": ["car"], "set_ignored_vehicles": [[1]],
    "enable_gbuffers": ["car", True], "stop_recorder": [], "stop_replayer": [True], "set_replayer_time_factor": [1.0],
    "set_replayer_ignore_hero": [True], "set_replayer_ignore_spectator": [True], "destroy_actor": ["walker"],
}  # fmt: skip
REFUSED: dict[str, list[Any]] = {
    "start_recorder": ["x", False], "replay_file": ["x", 0.0, 1.0, 0, False, T], "show_recorder_file_info": ["x", True],
    "show_recorder_collisions": ["x", 1, 1], "show_recorder_actors_blocked": ["x", 1.0, 1.0],
    "get_gbuffer_token": ["car", 1], "get_actor_component_world_transform": ["car", "x"],
    "get_actor_component_relative_transform": ["car", "x"], "copy_opendrive_to_file": ["<x/>", []],
    "request_file": ["no"], "enable_carsim": ["car", "x"], "use_carsim_road": ["car", True],
    "enable_chrono_physics": ["car", 1, 0.1, "", "", "", ""],
    "load_new_episode": ["Town99", True, 0],
}  # fmt: skip


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    made = make_server(ServerSettings(town="town01", port=free_port()))
    yield made
    made.close()


@pytest.fixture(scope="module")
def client(server: Server) -> Iterator[WireClient]:
    made = WireClient(server)
    made.synchronous()
    yield made
    made.leave()


@pytest.fixture(scope="module")
def numbers(server: Server, client: WireClient) -> dict[str, int]:
    """Of a car, a walker and a light."""
    points = [(x, y, yaw) for (x, y, _), (_, yaw, _) in client.call("get_map_info")[1]]
    walker = client.spawn("walker.pedestrian.0001", points[8])
    return {
        "car": client.spawn("vehicle.tesla.model3", points[3]), "walker": walker,
        "light": server.episode.lights.actors[0].id,
    }  # fmt: skip


@pytest.mark.parametrize("method", SERVED)
def test_a_call_is_served(client: WireClient, numbers: dict[str, int], method: str) -> None:
    arguments = [numbers.get(one, one) if isinstance(one, str) else one for one in SERVED[method]]
    client.call(method, *arguments)


@pytest.mark.parametrize("method", REFUSED)
def test_a_call_is_refused_in_a_sentence(client: WireClient, numbers: dict[str, int], method: str) -> None:
    arguments = [numbers.get(one, one) if isinstance(one, str) else one for one in REFUSED[method]]
    with pytest.raises(RefusedError, match=r"^found (?!a fault).*wanted"):
        client.call(method, *arguments)


NOT_SIMULATED = [
    *(f"sensor.camera.{kind}" for kind in ("dvs", "optical_flow", "normals", "cosmos_visualization")),
    *(f"sensor.other.{kind}" for kind in ("rss", "v2x", "v2x_custom")),
]  # fmt: skip


@pytest.mark.parametrize("kind", NOT_SIMULATED)
def test_a_sensor_that_is_not_simulated_is_refused_when_it_is_spawned(client: WireClient, kind: str) -> None:
    with pytest.raises(RefusedError, match=r"docs/carla\.md"):
        client.spawn(kind, (0.0, 0.0, 0.0))


def test_every_walker_and_thing_in_the_library_can_be_spawned(client: WireClient) -> None:
    ids = [id for _, id, *_ in client.call("get_actor_definitions") if id.startswith(("walker.", "static.prop."))]
    assert {"walker.pedestrian.0050", "static.prop.trafficcone02", "static.prop.busstop"} <= set(ids)
    made = [client.spawn(id, (-500.0 + 10.0 * k, -500.0, 0.0)) for k, id in enumerate(ids)]
    client.call("tick_cue")
    boxes = [client.call("get_actor_bounding_box", number)[1] for number in made]
    assert all(min(half_sizes) > 0.0 for half_sizes in boxes)
    for number in made:
        client.call("destroy_actor", number)


def test_no_call_that_the_server_knows_is_untested(server: Server) -> None:
    elsewhere = {"set_episode_settings", "spawn_actor", "spawn_actor_with_parent", "apply_physics_control"}
    assert {*SERVED, *REFUSED, *elsewhere} == set(server.calls)
