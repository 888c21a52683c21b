"""Who else is in CARLA's town: cars that its traffic manager drives, and people who walk by themselves."""

from __future__ import annotations

from typing import Any

import numpy as np

from caldrive.carla_bridge.client.connection import Connection
from caldrive.scenarios import Scenario

CROSSING = 0.1  # share of the people who may cross the road, where a scenario has them cross as often as usual
WALKING = 1  # which of a walker's recommended speeds; the others stand and run
TRIES = 3  # places for each person, as somebody may stand there
CONTROLLER = "controller.ai.walker"


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
    library = connection.world.get_blueprint_library().filter("vehicle.*")
    names = sorted(one.id for one in library if int(one.get_attribute("number_of_wheels")) == 4)
    manager = connection.traffic_manager(seed=int(rng.integers(2**31)))
    places = connection.world.get_map().get_spawn_points()
    for k in rng.permutation(len(places)).tolist():
        car = connection.spawn(connection.blueprint(str(rng.choice(names))), places[k])
        if car is not None:
            car.set_autopilot(True, manager.get_port())
            n -= 1
        if n == 0:
            break


def _add_people(connection: Connection, n: int, crossing: float, rng: np.random.Generator) -> None:
    """People on the sidewalks, who walk where they like."""
    world, nowhere = connection.world, connection.carla.Transform()
    names = sorted(one.id for one in world.get_blueprint_library().filter("walker.pedestrian.*"))
    world.set_pedestrians_seed(int(rng.integers(2**31)))
    world.set_pedestrians_cross_factor(min(1.0, CROSSING * crossing))
    walkers = list[tuple[Any, float]]()
    for _ in range(TRIES * n):
        place = world.get_random_location_from_navigation()
        if place is None or len(walkers) == n:  # without a mesh nobody can walk
            break
        blueprint = connection.blueprint(str(rng.choice(names)), is_invincible=False)
        if (walker := connection.spawn(blueprint, connection.carla.Transform(place))) is not None:
            walkers.append((walker, float(blueprint.get_attribute("speed").recommended_values[WALKING])))
    connection.tick()  # before it a walker is nowhere
    controllers = [connection.spawn(connection.blueprint(CONTROLLER), nowhere, walker) for walker, _ in walkers]
    connection.tick()
    for controller, (_, speed) in zip(controllers, walkers, strict=True):
        controller.start()
        controller.go_to_location(world.get_random_location_from_navigation())
        controller.set_max_speed(speed)
