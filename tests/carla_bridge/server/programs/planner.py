"""A route planner and an agent as CARLA's own have them: a graph of the map's topology, and a car that follows
waypoints and stops at red lights; prints what it found as JSON."""

from __future__ import annotations

import json
import math
from typing import Any

import carla
import networkx as nx

from tests.carla_bridge.server.programs.session import Listener, connect, run, spawned, synchronous

STEP, FARTHEST = 2.0, 400  # m from waypoint to waypoint, and how many of them an edge may have
TICKS, SPEED = 300, 6.0  # m/s


def main() -> None:
    world = connect().get_world()
    synchronous(world)
    town = world.get_map()
    graph, broken = planned(town)
    reached = max(map(len, nx.strongly_connected_components(graph)))
    start = next(point for point in town.get_spawn_points() if not town.get_waypoint(point.location).is_junction)
    car = spawned(world, "vehicle.tesla.model3", start)
    bumps = Listener(spawned(world, "sensor.other.collision", carla.Transform(), car))
    world.tick()
    driven, off, red = drive(world, town, car)
    print(json.dumps({
        "edges": graph.number_of_edges(), "broken": broken, "reached": reached / graph.number_of_nodes(), "driven":
        driven, "off": off, "red": red, "bumps": bumps.waiting(), "lights": lights_know_their_lanes(world, town),
    }))  # fmt: skip


def planned(town: Any) -> tuple[Any, int]:
    """The graph of lanes from junction to junction, and how many of them do not lead where they should."""
    graph, broken = nx.DiGraph(), 0
    for entry, exit in town.get_topology():
        place = exit.transform.location
        here, n = entry, 0
        while here.transform.location.distance(place) > STEP and n < FARTHEST:
            ahead = here.next(STEP)
            if not ahead:
                break
            here, n = ahead[0], n + 1
        broken += here.transform.location.distance(place) > STEP
        graph.add_edge(node(entry), node(exit), length=n * STEP)
    return graph, broken


def node(waypoint: Any) -> tuple[int, int]:
    place = waypoint.transform.location
    return round(place.x), round(place.y)


def drive(world: Any, town: Any, car: Any) -> tuple[float, float, int]:
    """Metres that the car drove, how far (m) it ever was from its lane's middle, and ticks before red lights."""
    driven, off, red = 0.0, 0.0, 0
    for k in range(TICKS):
        place = car.get_transform()
        here = town.get_waypoint(place.location)
        off = max(off, here.transform.location.distance(place.location))
        ways = here.next(4.0)
        angle = math.radians(bearing(place, ways[k // 150 % len(ways)].transform.location))
        is_red = car.is_at_traffic_light() and car.get_traffic_light_state() == carla.TrafficLightState.Red
        if is_red:
            assert car.get_traffic_light().get_location().distance(place.location) < 60.0
        goes = car.get_velocity().length() < min(SPEED, car.get_speed_limit() / 3.6) and not is_red
        car.apply_control(carla.VehicleControl(0.6 if goes else 0.0, max(-1.0, min(1.0, 1.2 * angle)), 0.8 * is_red))
        world.tick()
        driven += car.get_location().distance(place.location)
        red += is_red
    return driven, off, red


def bearing(place: Any, target: Any) -> float:
    """Degrees to the right of where something looks."""
    to = target - place.location
    return math.remainder(math.degrees(math.atan2(to.y, to.x)) - place.rotation.yaw, 360.0)


def lights_know_their_lanes(world: Any, town: Any) -> int:
    """How many lights of the map name the lanes that they are for, and stand before where these end."""
    known = 0
    for light in world.get_actors().filter("traffic.traffic_light*"):
        lanes, stops = light.get_affected_lane_waypoints(), light.get_stop_waypoints()
        near = [one for one in (*lanes, *stops) if one.transform.location.distance(light.get_location()) < 40.0]
        known += bool(lanes) and bool(stops) and len(near) == len(lanes) + len(stops)
    return known


if __name__ == "__main__":
    run(main)
