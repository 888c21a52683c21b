"""The calls about what stands in the town, those that change nothing here, and those that are refused."""

from __future__ import annotations

import math
from typing import Any

import shapely

from caldrive.carla_bridge.server.actors import Label
from caldrive.carla_bridge.server.calls import Call, call
from caldrive.carla_bridge.server.episode import NATIVE_HEIGHT
from caldrive.carla_bridge.server.layouts import BoundingBox, Rotation, Transform, Vector
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.datatypes import Pose, VehicleState
from caldrive.world.roads.network import SIDEWALK_WIDTH
from caldrive.world.scene.scenery import Prop

ANY = 255  # the label of everything
FARTHEST = 1e7  # m from the origin where there is still ground
PROP_LABELS = {
    "building": Label.BUILDING, "wall": Label.WALL, "fence": Label.FENCE, "lamp": Label.POLE, "light_post": Label.LIGHT,
    "sign_post": Label.SIGN, "tree": Label.VEGETATION, "hedge": Label.VEGETATION,
}  # fmt: skip
IGNORED: dict[str, Any] = {  # what they give; clients wait for some of them
    **dict.fromkeys((
        "draw_debug_shape", "clear_debug_shape", "clear_debug_string", "update_lights_state",
        "update_day_night_cycle", "set_annotations_traverse_translucency", "apply_color_texture_to_objects",
        "apply_float_color_texture_to_objects", "enable_sensor_for_ros", "disable_sensor_for_ros", "send",
        "set_ignored_vehicles", "enable_gbuffers", "stop_recorder", "stop_replayer", "set_replayer_time_factor",
        "set_replayer_ignore_hero", "set_replayer_ignore_spectator", "enable_environment_objects",
    )),
    "is_sensor_enabled_for_ros": False,
    **dict.fromkeys((
        "get_actor_component_names", "get_actor_bone_names", "get_actor_socket_names",
        "get_actor_bone_world_transforms", "get_actor_bone_relative_transforms", "get_actor_socket_world_transforms",
        "get_actor_socket_relative_transforms", "get_vehicle_bone_world_transforms",
    ), ()),
}  # fmt: skip
REFUSED = {
    **dict.fromkeys((
        "start_recorder", "replay_file", "show_recorder_file_info", "show_recorder_collisions",
        "show_recorder_actors_blocked",
    ), "CARLA's recorder, which caldrive does not have, wanted a recording of your own: keep what your sensors say"),
    "get_gbuffer_token": "a G-buffer, which caldrive does not draw, wanted an RGB, depth or semantic camera",
    **dict.fromkeys(("get_actor_component_world_transform", "get_actor_component_relative_transform"),
                    "a component of an actor, which caldrive's actors do not have, wanted the actor's own transform"),
}  # fmt: skip


class WorldCalls:
    """They answer from one server."""

    def __init__(self, server: Server) -> None:
        self._server = server

    @call("get_all_level_BBs")
    def boxes(self, caller: int, label: int) -> list[BoundingBox]:
        """Boxes in the world of what has a semantic label."""
        episode = self._server.episode
        found = [_box(prop) for prop in episode.town.scenery if label in (ANY, _label(prop))]
        if label in (ANY, Label.CAR):
            found += [_vehicle_box(car) for car in episode.cars]
        return found

    @call("get_environment_objects")
    def objects(self, caller: int, label: int) -> list[Any]:
        """The same with names and numbers."""
        scenery = enumerate(self._server.episode.town.scenery, 1)
        return [
            (Transform(box.location, box.rotation), box, k, f"{prop.kind}{k}", _label(prop))
            for k, prop in scenery
            if label in (ANY, _label(prop)) and (box := _box(prop))
        ]

    @call("get_names_of_all_objects")
    def names(self, caller: int) -> list[str]:
        """The names of what stands in the town."""
        return [f"{prop.kind}{k}" for k, prop in enumerate(self._server.episode.town.scenery, 1)]

    @call("project_point")
    def project(self, caller: int, at: Vector, direction: Vector, distance: float) -> tuple[bool, Any]:
        """Where a ray meets the ground, which is flat and the only thing that it can meet."""
        along = -at.z / direction.z if direction.z else math.inf
        x, y = at.x + along * direction.x, at.y + along * direction.y
        meets = 0.0 <= along <= distance and abs(x) < FARTHEST and abs(y) < FARTHEST
        x, y = (x, y) if meets else (0.0, 0.0)
        return meets, (Vector(x, y, 0.0), self._ground(x, y))

    @call("cast_ray")
    def cast(self, caller: int, start: Vector, end: Vector) -> list[Any]:
        """Likewise between two places."""
        way = Vector(end.x - start.x, end.y - start.y, end.z - start.z)
        meets, point = self.project(caller, start, way, 1.0)
        return [point] if meets else []

    def _ground(self, x: float, y: float) -> int:
        away = shapely.distance(self._server.episode.town.roads.roadway, shapely.Point(x, -y))
        return Label.ROAD if away == 0.0 else Label.SIDEWALK if away <= SIDEWALK_WIDTH else Label.TERRAIN


def _label(prop: Prop) -> int:
    return PROP_LABELS.get(prop.kind, Label.STATIC)


def _in_world(pose: Pose, length: float, width: float, height: float) -> BoundingBox:
    extent = Vector(length / 2, width / 2, height / 2)
    return BoundingBox(Vector(pose.x, -pose.y, height / 2), extent, Rotation(0.0, -math.degrees(pose.heading), 0.0))


def _box(prop: Prop) -> BoundingBox:
    return _in_world(prop.pose, prop.length, prop.width, prop.height)


def _vehicle_box(car: VehicleState) -> BoundingBox:
    return _in_world(car.pose, car.length, car.width, NATIVE_HEIGHT)


def other_calls() -> dict[str, Call]:
    """Calls that change nothing here, and those that are refused; they take any arguments."""
    found = {}
    for name, result in IGNORED.items():
        found[name] = Call(_always(result), None, 0, is_void=result is None, is_bare=False)
    for name, what in REFUSED.items():
        found[name] = Call(_never(name, what), None, 0, is_void=False, is_bare=False)
    return found


def _always(result: Any) -> Any:
    return lambda caller, *given: result


def _never(name: str, what: str) -> Any:
    def refuse(caller: int, *given: Any) -> None:
        raise Refusal(f"found a call {name} of {what}")

    return refuse
