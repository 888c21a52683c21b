"""The camera: pictures of a town, its traffic and its weather, drawn with OpenGL and no display."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.config import CameraConfig
from caldrive.datatypes import Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.geometry import moved
from caldrive.world import shaders
from caldrive.world.ground import ground_mesh, road_mesh, yard_mesh
from caldrive.world.meshes import Mesh, box, merge, turned
from caldrive.world.roads import RoadNetwork
from caldrive.world.scenery import Prop
from caldrive.world.weather import look, weather

NEAR, FAR = 0.25, 900.0


@lru_cache(maxsize=1)
def gl_context() -> moderngl.Context:
    """The process's one OpenGL context. Raises RuntimeError where the machine has no EGL."""
    try:
        return moderngl.create_standalone_context(require=330, backend="egl")
    except Exception as error:
        raise RuntimeError(
            f"found no EGL with OpenGL 3.3 ({error}): type apt-get install libegl1 libgl1-mesa-dri"
        ) from error


def view_projection(eye: tuple[float, float, float], heading: float, pitch: float, fov: float, aspect: float) -> NDArray[np.float64]:
    """World to clip space (4, 4) for a pinhole camera; fov: horizontal, degrees; pitch: rad, + up."""
    c, s, cp, sp = math.cos(heading), math.sin(heading), math.cos(pitch), math.sin(pitch)
    forward, right = np.array([c * cp, s * cp, sp]), np.array([s, -c, 0.0])
    up = np.cross(right, forward)
    f = 1 / math.tan(math.radians(fov) / 2)
    depth = np.array([(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)])
    rows = np.stack((f * right, f * aspect * up, depth[0] * forward, forward))
    offset = np.array([0, 0, depth[1], 0])
    return np.column_stack((rows, offset - rows @ np.asarray(eye)))


class Camera:
    """Draws one town. lights: keyed by LightPost.id."""

    def __init__(self, roads: RoadNetwork, scenery: tuple[Prop, ...]) -> None:
        self.roads = roads
        self.context = gl_context()
        things = [turned(box((0, 0, p.height / 2), (p.length, p.width, p.height), (170, 140, 120)), p.pose) for p in scenery]
        mesh = merge((road_mesh(roads), ground_mesh(roads), yard_mesh(roads), *things))
        self._program = self.context.program(shaders.STATIC_VERTEX, shaders.STATIC_FRAGMENT)
        self._frame = self.context.buffer(reserve=80)
        self._look = self.context.buffer(reserve=112)
        for name, binding in (("Frame", 0), ("Look", 1)):
            self._program[name].binding = binding
        self._static = self._array(mesh)
        self._cube = box((0, 0, 0.5), (1, 1, 1), (60, 80, 170))
        self._targets: dict[tuple[int, int], moderngl.Framebuffer] = {}

    def _array(self, mesh: Mesh) -> moderngl.VertexArray:
        data = self.context.buffer(np.ascontiguousarray(mesh.vertices).tobytes())
        index = self.context.buffer(mesh.triangles.astype("u4").tobytes())
        return self.context.vertex_array(
            self._program, [(data, "3f 3x4 4f1 4f1", "position", "normal", "color")], index_buffer=index, index_element_size=4
        )

    def _target(self, width: int, height: int) -> moderngl.Framebuffer:
        if (width, height) not in self._targets:
            self._targets[width, height] = self.context.framebuffer(
                self.context.renderbuffer((width, height), 4), self.context.depth_renderbuffer((width, height))
            )
        return self._targets[width, height]

    def render(
        self, weather_id: int, ego: VehicleState, vehicles: Sequence[VehicleState], pedestrians: Sequence[PedestrianState],
        lights: Mapping[str, LightState], mounts: Sequence[CameraConfig], time: float,
    ) -> list[Image]:  # fmt: skip
        """One picture (H, W, 3) for each mount on the ego."""
        cars = [turned(box((0, 0, 0.75), (v.length, v.width, 1.5), (40, 60, 160)), v.pose) for v in vehicles]
        people = [turned(box((0, 0, 0.85), (0.35, 0.5, 1.7), (190, 90, 60)), p.pose) for p in pedestrians]
        moving = merge((*cars, *people))
        dynamic = self._array(moving) if len(moving.triangles) else None
        images = []
        for m in mounts:
            pose = moved(ego.pose, m.forward, m.left, m.yaw)
            images.append(self._draw(weather_id, pose, m.up, 0.0, m.fov, (m.width, m.height), dynamic))
        if dynamic is not None:
            dynamic.release()
        return images

    def _draw(
        self, weather_id: int, pose: Pose, up: float, pitch: float, fov: float, size: tuple[int, int],
        dynamic: moderngl.VertexArray | None,
    ) -> Image:  # fmt: skip
        sky = look(weather(weather_id), 0.9)
        target = self._target(*size)
        eye = (pose.x, pose.y, up)
        matrix = view_projection(eye, pose.heading, pitch, fov, size[0] / size[1])
        self._frame.write(np.concatenate((matrix.T.ravel(), eye, [0])).astype("f4").tobytes())
        rows = [(*sky.sun_direction, 0), (*sky.sun, 0), (*sky.sky_ambient, 0), (*sky.ground_ambient, 0),
                (*sky.horizon, sky.fog_density), (*sky.zenith, 0), (sky.wetness, sky.puddles, sky.rain, 0)]  # fmt: skip
        self._look.write(np.array(rows, dtype="f4").tobytes())
        self._frame.bind_to_uniform_block(0)
        self._look.bind_to_uniform_block(1)
        target.use()
        self.context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        target.clear(*(0.5 * (sky.horizon + sky.zenith)), 1.0)
        self._static.render()
        if dynamic is not None:
            dynamic.render()
        pixels = np.frombuffer(target.read(components=3), np.uint8).reshape(size[1], size[0], 3)
        return np.ascontiguousarray(pixels[::-1])

    def render_from(
        self, weather_id: int, pose: Pose, height: float, pitch: float = 0.0, fov: float = 90.0, size: tuple[int, int] = (960, 432)
    ) -> Image:
        """A picture from a free camera; height in metres, pitch in rad, + up."""
        return self._draw(weather_id, pose, height, pitch, fov, size, None)

    def close(self) -> None:
        for target in self._targets.values():
            target.release()
        self._targets.clear()
        self._static.release()
