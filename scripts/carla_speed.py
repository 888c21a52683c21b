"""How many steps a second CARLA's client gets of `serve-carla`, beside the embedded world itself.

    python -m scripts.carla_speed --cars 20 --size 200 88

The same town, as many cars and as large a picture, in turns, so that a busy machine is as busy for both. A step is a
control, a tick, and the picture that belongs to it. Each turn begins at the same place: a car that has run into
something costs more.
"""

from __future__ import annotations

import os
import queue
import sys
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, NamedTuple

import tyro

from caldrive.datatypes import CameraConfig, Control
from caldrive.driving.tasks import task_scenarios
from caldrive.provenance import machine_name
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from scripts.carla_peer import served

PATIENCE = 60.0  # s for a picture


@dataclass(frozen=True)
class Options:
    """What is measured."""

    cars: int = 20
    """Cars that SUMO drives."""
    size: tuple[int, int] = (200, 88)
    """Of the picture, pixels."""
    steps: int = 40
    """In a turn."""
    turns: int = 15
    """Of each side."""
    port: int = 2000
    """Of the server that is started."""


class Side(NamedTuple):
    """One of the two."""

    begin: Callable[[], Any]
    """Puts the car where it starts."""
    step: Callable[[], Any]


def embedded(world: EmbeddedWorld, scenario: Scenario) -> Side:
    """The embedded world."""
    return Side(lambda: world.reset(scenario), lambda: world.step(Control(throttle=0.4)))


def through_client(options: Options) -> Side:
    """CARLA's client."""
    import carla

    world = carla.Client("127.0.0.1", options.port).get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.1
    world.apply_settings(settings)
    library, pictures = world.get_blueprint_library(), queue.Queue[Any]()
    model = library.find("vehicle.seat.leon")
    spawned = ((world.try_spawn_actor(model, point), point) for point in world.get_map().get_spawn_points())
    car, start = next((actor, point) for actor, point in spawned if actor is not None)
    blueprint = library.find("sensor.camera.rgb")
    for name, value in zip(("image_size_x", "image_size_y"), options.size, strict=True):
        blueprint.set_attribute(name, str(value))
    camera = world.spawn_actor(blueprint, carla.Transform(carla.Location(x=1.44, z=1.2)), car)
    camera.listen(pictures.put)

    def begin() -> None:
        car.set_transform(start)
        car.set_target_velocity(carla.Vector3D())

    def step() -> None:
        car.apply_control(carla.VehicleControl(throttle=0.4))
        frame = world.tick()
        while pictures.get(timeout=PATIENCE).frame != frame:
            assert camera.is_listening  # it would fall silent without a name

    return Side(begin, step)


def steps_a_second(side: Side, steps: int) -> float:
    """By the clock on the wall."""
    side.begin()
    side.step()
    begin = time.perf_counter()
    for _ in range(steps):
        side.step()
    return steps / (time.perf_counter() - begin)


def main() -> None:
    """Measures, and prints medians."""
    options = tyro.cli(Options, description=__doc__)
    width, height = options.size
    scenario = replace(task_scenarios("town01", "navigation", weather=1)[0], n_vehicles=options.cars, n_pedestrians=0)
    with (
        served(options.port, scenario, "--cars", str(options.cars)),
        closing(EmbeddedWorld(CameraConfig(width=width, height=height))) as world,
    ):
        sides = embedded(world, scenario), through_client(options)
        for side in sides:
            steps_a_second(side, 20)
        turns = [[steps_a_second(side, options.steps) for side in sides] for _ in range(options.turns)]
    here, client = (median(turn[k] for turn in turns) for k in (0, 1))
    share = median(second / first for first, second in turns)
    print(f"{machine_name()}, {width} x {height}, {options.cars} cars, medians of {options.turns} turns:")
    print(f"embedded {here:.0f} steps/s, through the client {client:.0f} steps/s, share {share:.2f}")
    sys.stdout.flush()
    os._exit(0)  # the wheel may crash where Python takes it down while its threads still run


if __name__ == "__main__":
    main()
