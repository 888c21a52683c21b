"""Drives a car in asynchronous mode, as programs do that never ask for settings; prints what came as JSON."""

from __future__ import annotations

import json

import carla

from tests.carla_bridge.server.programs.session import PATIENCE, Listener, connect, run, spawned, straight

TICKS = 30


def main() -> None:
    world = connect().get_world()
    heard: list[int] = []
    callback = world.on_tick(lambda snapshot: heard.append(snapshot.frame))
    car = spawned(world, "vehicle.tesla.model3", straight(world)[0])
    mount, size = carla.Transform(carla.Location(x=1.5, z=2.4)), {"image_size_x": "64", "image_size_y": "32"}
    camera = Listener(spawned(world, "sensor.camera.rgb", mount, car, **size))
    world.wait_for_tick(PATIENCE)
    car.apply_control(carla.VehicleControl(throttle=1.0))
    snapshots = [world.wait_for_tick(PATIENCE) for _ in range(TICKS)]
    frames = [one.frame for one in snapshots]
    first, last = snapshots[TICKS // 2], snapshots[-1]  # at the beginning a frame need not be a step
    step = (last.timestamp.elapsed_seconds - first.timestamp.elapsed_seconds) / (last.frame - first.frame)
    image = camera.at(frames[-1])
    found = {
        "in_order": frames == sorted(set(frames)), "step": step, "speed": car.get_velocity().length(),
        "heard": heard == sorted(set(heard)) and len(heard) >= TICKS, "image": [image.width, image.height],
        "ticks": world.tick() > frames[-1],
    }  # fmt: skip
    world.remove_on_tick(callback)
    camera.sensor.stop()
    camera.sensor.destroy()
    car.destroy()
    world.wait_for_tick(PATIENCE)
    world.wait_for_tick(PATIENCE)
    print(json.dumps({**found, "left": len(world.get_actors().filter("vehicle.*"))}), flush=True)


if __name__ == "__main__":
    run(main)
