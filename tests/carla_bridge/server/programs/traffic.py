"""Cars under the client's traffic manager and walkers under its crowd, as generate_traffic makes them; prints how far
they came."""

from __future__ import annotations

import json
import sys
from typing import Any

import carla

from tests.carla_bridge.server.programs.session import connect, run, synchronous

CARS, WALKERS, TICKS = 4, 3, 120
NOBODY = 0
Spawn, Destroy, Future = carla.command.SpawnActor, carla.command.DestroyActor, carla.command.FutureActor


def main() -> None:
    client = connect()
    world = client.get_world()
    manager = client.get_trafficmanager(int(sys.argv[2]))
    manager.set_synchronous_mode(True)
    synchronous(world, 0.05)
    cars = spawn_cars(client, world, manager)
    walkers, controllers = spawn_walkers(client, world)
    world.tick()
    for controller in controllers:
        controller.start()
        controller.go_to_location(world.get_random_location_from_navigation())
        controller.set_max_speed(1.4)
    start = {one.id: one.get_location() for one in (*cars, *walkers)}
    for _ in range(TICKS):
        world.tick()
    moved = {one.id: one.get_location().distance(start[one.id]) for one in (*cars, *walkers)}
    print(json.dumps({"cars": [moved[one.id] for one in cars], "walkers": [moved[one.id] for one in walkers]}))
    for controller in controllers:
        controller.stop()
    for car in cars:
        car.set_autopilot(False, int(sys.argv[2]))
    client.apply_batch([Destroy(one) for one in (*cars, *controllers, *walkers)])
    manager.shut_down()


def spawn_cars(client: Any, world: Any, manager: Any) -> list[Any]:
    library = world.get_blueprint_library().filter("vehicle.*")
    blueprints = [one for one in library if one.get_attribute("base_type") == "car"]
    points = world.get_map().get_spawn_points()
    batch = [
        Spawn(blueprints[k], points[12 * k]).then(carla.command.SetAutopilot(Future, True, manager.get_port()))
        for k in range(CARS)
    ]
    results = client.apply_batch_sync(batch, True)
    assert not [one.error for one in results if one.error]
    return list(world.get_actors([one.actor_id for one in results]))


def spawn_walkers(client: Any, world: Any) -> tuple[list[Any], list[Any]]:
    blueprints = world.get_blueprint_library().filter("walker.pedestrian.*")
    places = [world.get_random_location_from_navigation() for _ in range(WALKERS)]
    batch = [Spawn(blueprints[k], carla.Transform(place)) for k, place in enumerate(places)]
    ids = [one.actor_id for one in client.apply_batch_sync(batch, True) if not one.error]
    blueprint = world.get_blueprint_library().find("controller.ai.walker")
    batch = [Spawn(blueprint, carla.Transform(), id) for id in ids]
    controllers = [one.actor_id for one in client.apply_batch_sync(batch, True) if not one.error]
    return list(world.get_actors(ids)), list(world.get_actors(controllers))


if __name__ == "__main__":
    run(main)
