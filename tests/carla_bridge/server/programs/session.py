"""What the programs share: a world in synchronous mode, and sensors whose messages come in step."""

from __future__ import annotations

import os
import queue
import sys
from collections.abc import Callable
from typing import Any

import carla

PATIENCE = 300.0  # s


def run(main: Callable[[], None]) -> None:
    """Runs a program, and ends it at once: the wheel may crash where Python takes it down while its threads still
    run."""
    main()
    sys.stdout.flush()
    os._exit(0)


def connect() -> Any:
    """A client of the server whose port is the first argument; says when it is connected."""
    client = carla.Client("127.0.0.1", int(sys.argv[1]), 8)
    client.set_timeout(PATIENCE)
    client.get_server_version()
    print("connected", flush=True)
    return client


def synchronous(world: Any, delta: float = 0.1) -> None:
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, delta
    world.apply_settings(settings)


def spawned(world: Any, id: str, at: Any, parent: Any = None, **attributes: str) -> Any:
    blueprint = world.get_blueprint_library().find(id)
    for name, value in attributes.items():
        blueprint.set_attribute(name, value)
    return world.spawn_actor(blueprint, at, attach_to=parent) if parent else world.spawn_actor(blueprint, at)


def straight(world: Any) -> list[Any]:
    """Four spawn points on a straight street, each before the next."""
    points = world.get_map().get_spawn_points()
    for k in range(len(points) - 3):
        here, ahead = points[k], points[k].get_forward_vector()
        ways = [there.location - here.location for there in points[k : k + 4]]
        if all(abs(way.x * ahead.x + way.y * ahead.y - 12.0 * i) < 0.5 for i, way in enumerate(ways)):
            return list(points[k : k + 4])
    raise AssertionError("no straight street")


class Listener:
    """A sensor and what it says."""

    def __init__(self, sensor: Any) -> None:
        self.sensor, self._queue = sensor, queue.Queue[Any]()
        sensor.listen(self._queue.put)

    def waiting(self) -> int:
        """How many messages nobody has asked for."""
        return self._queue.qsize()

    def at(self, frame: int) -> Any:
        """What it says at a frame."""
        while True:
            message = self._queue.get(timeout=PATIENCE)
            if message.frame == frame:
                return message
            assert message.frame < frame
