"""Drives a car with three cameras and a GNSS in synchronous mode; prints what came as JSON."""

from __future__ import annotations

import hashlib
import json
import sys

import carla
import numpy as np

from tests.carla_bridge.server.programs.session import Listener, connect, run, spawned, straight, synchronous

SIZE = {"image_size_x": "96", "image_size_y": "64"}
TICKS = int(sys.argv[2]) if len(sys.argv) > 2 else 12


def main() -> None:
    client = connect()
    synchronous(client.get_world())
    world = client.reload_world(False)  # from here on nothing depends on how fast this process is
    first = world.tick()
    start = straight(world)[0]
    car = spawned(world, "vehicle.tesla.model3", start)
    mount = carla.Transform(carla.Location(x=1.5, z=2.4), carla.Rotation(pitch=-5.0))
    kinds = ("rgb", "semantic_segmentation", "depth")
    cameras = [Listener(spawned(world, f"sensor.camera.{kind}", mount, car, **SIZE)) for kind in kinds]
    gnss = Listener(spawned(world, "sensor.other.gnss", carla.Transform(), car))
    images = b""
    for k in range(TICKS):
        car.apply_control(carla.VehicleControl(throttle=0.8, steer=0.1 if k > TICKS // 2 else 0.0))
        frame = world.tick()
        seen = [camera.at(frame) for camera in cameras]
        images += b"".join(bytes(image.raw_data) for image in seen)
        place = gnss.at(frame)
    rgb, semantic, depth = (np.frombuffer(image.raw_data, np.uint8).reshape(64, 96, 4) for image in seen)
    metres = 1000 / (256**3 - 1) * (depth[..., :3].astype(float) @ (65536, 256, 1))
    at, expected = car.get_location(), world.get_map().transform_to_geolocation(car.get_location())
    print(json.dumps({
        "images": hashlib.sha256(images).hexdigest(), "speed": car.get_velocity().length(), "moved":
        at.distance(start.location), "spread": float(rgb[..., :3].std()),
        "labels": sorted(set(semantic[..., 2].ravel().tolist())), "below": float(metres[-1].mean()),
        "sky": float(metres[0].max()), "latitude_error": abs(place.latitude - expected.latitude),
        "longitude_error": abs(place.longitude - expected.longitude), "frames": frame - first, "fov": seen[0].fov,
    }), flush=True)  # fmt: skip
    for one in (*cameras, gnss):
        one.sensor.destroy()
    car.destroy()


if __name__ == "__main__":
    run(main)
