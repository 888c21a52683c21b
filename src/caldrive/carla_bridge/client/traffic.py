"""Who else is in CARLA's town: cars that its traffic manager drives, and people who walk by themselves."""

from __future__ import annotations

import socket
from typing import Any

import numpy as np

from caldrive.carla_bridge.client.connection import Connection
from caldrive.scenarios import Scenario

CROSSING = 0.1  # share of the people who may cross the road, where a scenario has them cross as often as usual
WALK = 1  # which of a walker's recommended speeds: 0 stands, 2 runs
TRIES = 3  # places for each person, as somebody may stand there


def populate(connection: Connection, scenario: Scenario) -> None:
    """Spawns the cars and people that a scenario has and the server has not, by the scenario's seed. Where a town has
    less room there are fewer."""
    actors = connection.world.get_actors()
    cars, people = (len(actors.filter(pattern)) for pattern in ("vehicle.*", "walker.*"))
    rng = np.random.default_rng(scenario.seed)
    if cars < scenario.n_vehicles:
        _add_cars(connection, scenario.n_vehicles - cars, rng)
    if people < scenario.n_pedestrians:
        _add_people(connection, scenario.n_pedestrians - people, scenario.crossing, rng)


def _add_cars(connection: Connection, n: int, rng: np.random.Generator) -> None:
    """Cars with four wheels at the map's own places."""
    blueprints = connection.world.get_blueprint_library().filter("vehicle.*")
    names = sorted(one.id for one in blueprints if int(one.get_attribute("number_of_wheels")) == 4)
    manager = connection.traffic_manager(seed=int(rng.integers(2**31)))
    for place in rng.permutation(np.array(connection.world.get_map().get_spawn_points(), dtype=object)):
        if n == 0:
            break
        car = connection.spawn(connection.blueprint(str(rng.choice(names))), place)
        if car is not None:
            car.set_autopilot(True, manager.get_port())
            n -= 1


def _add_people(connection: Connection, n: int, crossing: float, rng: np.random.Generator) -> None:
    """People on the sidewalks, who walk where they like."""
    world, names = connection.world, sorted(one.id for one in connection.world.get_blueprint_library().filter("walker.*"))
    world.set_pedestrians_seed(int(rng.integers(2**31)))
    world.set_pedestrians_cross_factor(min(1.0, CROSSING * crossing))
    walkers = list[tuple[Any, Any]]()
    for _ in range(TRIES * n):
        at = world.get_random_location_from_navigation()
        if at is None or len(walkers) == n:  # a map without a mesh has nobody on foot
            break
        blueprint = connection.blueprint(str(rng.choice(names)), is_invincible=False)
        walker = connection.spawn(blueprint, connection.carla.Transform(at))
        if walker is not None:
            walkers.append((walker, connection.spawn(connection.blueprint("controller.ai.walker"), connection.carla.Transform(), walker)))
    connection.tick()  # before it a walker is nowhere
    for walker, controller in walkers:
        controller.start()
        controller.go_to_location(world.get_random_location_from_navigation())
        speeds = walker.attributes
        controller.set_max_speed(1.4)
