"""Makes one call after the other, and kills itself in the midst of one of them: the second argument says which."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator
from typing import Any

import carla

from tests.carla_bridge.server.programs.session import Listener, connect, spawned, straight, synchronous


def calls() -> Generator[Callable[[], Any], Any, None]:
    """One after the other; whoever makes them sends what they give."""
    client = connect()
    world = yield client.get_world
    yield lambda: synchronous(world)
    world = yield lambda: client.reload_world(False)
    points = straight(world)
    yield lambda: spawned(world, "vehicle.audi.tt", points[3])
    car = yield lambda: spawned(world, "vehicle.tesla.model3", points[0])
    yield world.tick
    yield lambda: car.apply_control(carla.VehicleControl(throttle=1.0))
    yield lambda: car.set_transform(points[1])
    camera = yield lambda: spawned(world, "sensor.camera.rgb", carla.Transform(carla.Location(z=2.4)), car)
    seen = yield lambda: Listener(camera)
    bumper = yield lambda: spawned(world, "sensor.other.collision", carla.Transform(), car)
    yield lambda: bumper.listen(lambda _: None)
    frame = yield world.tick
    seen.at(frame)  # the client may crash where a sensor is stopped while it still reads
    yield camera.stop
    yield camera.destroy
    yield lambda: world.set_weather(carla.WeatherParameters.HardRainNoon)
    yield lambda: world.get_actors().filter("traffic.traffic_light*")[0].freeze(True)
    blueprint = world.get_blueprint_library().find("walker.pedestrian.0001")
    yield lambda: client.apply_batch_sync([carla.command.SpawnActor(blueprint, one) for one in points[2:]], True)
    yield lambda: client.apply_batch([carla.command.DestroyActor(bumper.id)])
    yield car.destroy


def main(last: int) -> None:
    making, given = calls(), None
    for k in range(1, last + 1):
        call = making.send(given)
        if k == last:
            threading.Thread(target=call, daemon=True).start()
            time.sleep(0.002 * (last % 3))  # before it is sent, or while the server is at it
            os.kill(os.getpid(), signal.SIGKILL)
        given = call()


if __name__ == "__main__":
    main(int(sys.argv[2]))
