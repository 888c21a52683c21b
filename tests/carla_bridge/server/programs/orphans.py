"""Listens to sensors that end without a word to those who listen, and waits."""

from __future__ import annotations

import time

import carla

from tests.carla_bridge.server.programs.session import Listener, connect, run, spawned, synchronous


def main() -> None:
    client = connect()
    world = client.get_world()
    synchronous(world)
    sensors = [Listener(spawned(world, "sensor.other.gnss", carla.Transform())) for _ in range(3)]
    frame = world.tick()
    assert all(one.at(frame) for one in sensors)
    client.apply_batch_sync([carla.command.DestroyActor(one.sensor.id) for one in sensors], False)
    print("ended", flush=True)
    time.sleep(1.0)
    world.tick()


if __name__ == "__main__":
    run(main)
