"""One call of each kind through CARLA's client; every line asserts what programs rely on."""

from __future__ import annotations

import math

import carla
import numpy as np
import pytest

from tests.carla_bridge.server.programs.session import Listener, connect, run, spawned, straight, synchronous


def main() -> None:
    client = connect()
    world = client.get_world()
    synchronous(world)
    town = world.get_map()
    points = straight(world)
    look_at_the_map(world, town)
    car = spawned(world, "vehicle.lincoln.mkz_2020", points[0])
    imu = Listener(spawned(world, "sensor.other.imu", carla.Transform(), car))
    assert world.try_spawn_actor(world.get_blueprint_library().find("vehicle.audi.tt"), points[0]) is None
    frame = world.tick()
    assert abs(imu.at(frame).accelerometer.z - 9.81) < 0.01
    assert imu.at(world.tick()).compass == imu.at(world.tick()).compass
    assert car.bounding_box.extent.x > car.bounding_box.extent.y > 0.5
    drive(world, car)
    physics(world, car)
    lights(world, car)
    weather(world)
    walker = spawned(world, "walker.pedestrian.0004", points[3])
    world.tick()
    walker.apply_control(carla.WalkerControl(carla.Vector3D(1.0, 0.0, 0.0), 1.5))
    before = walker.get_location()
    for _ in range(10):
        world.tick()
    assert abs(walker.get_location().distance(before) - 1.5) < 0.1
    measure_distances(world, car)
    tell_actors_apart(world, car, points)
    refuse(world, car)
    imu.sensor.destroy()
    assert walker.destroy()
    assert car.destroy()
    world.tick()
    assert not world.get_actors().filter("vehicle.*")
    assert client.get_world().id == world.id
    assert client.reload_world().id != world.id


def look_at_the_map(world: carla.World, town: carla.Map) -> None:
    assert len(town.get_topology()) > 20
    points = town.get_spawn_points()
    for point in points[::17]:
        waypoint = town.get_waypoint(point.location)
        assert waypoint.transform.location.distance(point.location) < 1.0
        turned = math.radians(waypoint.transform.rotation.yaw - point.rotation.yaw)
        assert math.cos(turned) > 0.9
    assert world.get_actors().filter("traffic.speed_limit*")
    signs = town.get_all_landmarks_of_type("274")
    assert signs
    assert all(world.get_traffic_sign(sign) is not None for sign in signs)
    assert all(world.get_traffic_light(light) is not None for light in town.get_all_landmarks_of_type("1000001"))


def drive(world: carla.World, car: carla.Vehicle) -> None:
    car.apply_control(carla.VehicleControl(throttle=1.0))
    start, ahead = car.get_location(), car.get_transform().get_forward_vector()
    for _ in range(20):
        world.tick()
    moved = car.get_location() - start
    assert moved.x * ahead.x + moved.y * ahead.y > 3.0
    assert car.get_control().throttle == 1.0
    assert car.get_velocity().length() > 3.0
    car.set_target_velocity(carla.Vector3D(0.0, 0.0, 0.0))
    car.apply_control(carla.VehicleControl(brake=1.0))
    for _ in range(10):
        world.tick()
    assert car.get_velocity().length() < 0.1
    car.apply_ackermann_control(carla.VehicleAckermannControl(speed=4.0))
    for _ in range(60):
        world.tick()
    assert abs(car.get_velocity().length() - 4.0) < 0.7


def physics(world: carla.World, car: carla.Vehicle) -> None:
    control = car.get_physics_control()
    assert len(control.wheels) == 4
    control.mass = 2000.0
    car.apply_physics_control(control)
    assert car.get_physics_control().mass == 2000.0
    car.set_simulate_physics(False)
    there = world.get_map().get_spawn_points()[9]
    car.set_transform(there)
    world.tick()
    assert car.get_location().distance(there.location) < 0.1
    car.set_simulate_physics(True)


def lights(world: carla.World, car: carla.Vehicle) -> None:
    found = world.get_actors().filter("traffic.traffic_light*")
    assert len(found) > 3
    light = found[0]
    assert light.id in [one.id for one in light.get_group_traffic_lights()]
    light.set_state(carla.TrafficLightState.Yellow)
    light.freeze(True)
    world.tick()
    assert light.get_state() == carla.TrafficLightState.Yellow
    assert light.is_frozen()
    light.freeze(False)
    ways = light.get_affected_lane_waypoints()
    assert ways
    stop = ways[0].transform
    stop.location.z = 0.3
    car.set_target_velocity(carla.Vector3D())
    car.set_transform(stop)
    light.set_state(carla.TrafficLightState.Red)
    light.freeze(True)
    world.tick()
    world.tick()
    assert car.is_at_traffic_light()
    assert car.get_traffic_light().id == light.id
    assert car.get_traffic_light_state() == carla.TrafficLightState.Red
    world.reset_all_traffic_lights()


def weather(world: carla.World) -> None:
    world.set_weather(carla.WeatherParameters.HardRainSunset)
    world.tick()
    assert world.get_weather().precipitation == 100.0


def refuse(world: carla.World, car: carla.Vehicle) -> None:
    with pytest.raises(RuntimeError, match=r"found sensor\.camera\.dvs"):
        spawned(world, "sensor.camera.dvs", carla.Transform(), car)


def measure_distances(world: carla.World, car: carla.Vehicle) -> None:
    on_top, ahead = carla.Transform(carla.Location(z=2.4)), carla.Transform(carla.Location(x=2.5, z=1.0))
    lidar = Listener(spawned(world, "sensor.lidar.ray_cast", on_top, car, channels="16"))
    radar = Listener(spawned(world, "sensor.other.radar", ahead, car, horizontal_fov="20"))
    frame = world.tick()
    cloud, found = lidar.at(frame), radar.at(frame)
    points = np.frombuffer(cloud.raw_data, np.float32).reshape(-1, 4)
    assert cloud.channels == 16
    assert sum(cloud.get_point_count(k) for k in range(16)) == len(points) > 500
    assert abs(points[:, 2].min() + 2.4) < 0.1  # the road
    assert np.linalg.norm(points[:, :3], axis=1).max() < 10.0
    assert 0 < len(found) <= 150
    assert all(one.depth < 100.0 and abs(one.azimuth) < 0.18 for one in found)
    for one in (lidar, radar):
        one.sensor.destroy()


def tell_actors_apart(world: carla.World, car: carla.Vehicle, points: list[carla.Transform]) -> None:
    """Another car, 12 m ahead, is seen by its number."""
    car.set_transform(points[0])
    other = spawned(world, "vehicle.audi.tt", points[1])
    on_top = carla.Transform(carla.Location(z=2.4))
    camera = Listener(spawned(world, "sensor.camera.instance_segmentation", on_top, car, image_size_x="200"))
    lidar = Listener(spawned(world, "sensor.lidar.ray_cast_semantic", on_top, car, range="30"))
    frame = world.tick()
    image, cloud = camera.at(frame), lidar.at(frame)
    picture = np.frombuffer(image.raw_data, np.uint8).reshape(image.height, image.width, 4)
    blue, green, red = np.moveaxis(picture, 2, 0)[:3]
    numbers = green.astype(int) + 256 * blue.astype(int)
    assert (numbers == other.id).sum() > 50
    assert set(red[numbers == other.id]) == {14}  # a car
    points = [one for one in cloud if one.object_idx == other.id]
    assert len(points) > 5
    assert {one.object_tag for one in points} == {14}
    assert all(8.0 < one.point.x < 15.0 and abs(one.point.y) < 1.5 for one in points)
    assert all(0.0 <= one.cos_inc_angle <= 1.0 for one in cloud)
    for one in (camera.sensor, lidar.sensor, other):
        one.destroy()


if __name__ == "__main__":
    run(main)
