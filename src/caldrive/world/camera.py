"""The camera: pictures of a town, its traffic and its weather, drawn with OpenGL and no display."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.config import CameraConfig
from caldrive.datatypes import Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.world import actors
from caldrive.world.batches import Crowd, TownBatch, vertex_array
from caldrive.world.buildings import building_mesh
from caldrive.world.cars import SHAPES, car_mesh, far_car_mesh
from caldrive.world.furniture import LAMP_FACE, LAMPS, furniture_meshes
from caldrive.world.gl import Target, gl_context, programs, smooth_texture
from caldrive.world.ground import KERB_HEIGHT, ground_mesh, road_mesh, yard_mesh
from caldrive.world.optics import Lens, mounted
from caldrive.world.people import far_person_mesh, person_mesh
from caldrive.world.roads import RoadNetwork
from caldrive.world.scenery import Prop
from caldrive.world.shadows import shadow_heights, town_bounds
from caldrive.world.sight import Cells, Sight
from caldrive.world.sky import dome_mesh, panorama
from caldrive.world.tiles import DETAIL, Level, Tiles, View
from caldrive.world.weather import Look, look, weather

GLOW_FAR = 150.0  # m
TOWN_FAR = 260.0  # m beyond which no more of the town is drawn
ROOF_LEVEL = 5.0  # m of eye height from which houses no longer hide what lies behind them
PLACE = 8.0  # m, the size of the squares within which one decision holds on what is in sight
GLOWS = {LightState.RED: (1.0, 0.10, 0.06), LightState.YELLOW: (1.0, 0.74, 0.10), LightState.GREEN: (0.12, 1.0, 0.42)}
SUN_AZIMUTH = {"town01": 0.95, "town02": 2.5}  # rad
PAINT = {  # colours of centre lines, edge lines and asphalt, and the widths that the road shader wants
    "town01": ((0.93, 0.70, 0.20), (0.92, 0.92, 0.90), (0.50, 0.50, 0.51), (0.10, 0.075, 0.28, 0.5)),
    "town02": ((0.95, 0.82, 0.42), (0.88, 0.88, 0.86), (0.58, 0.56, 0.54), (0.09, 0.06, 0.18, 0.42)),
}
Indices = NDArray[np.int_]


class Camera:
    """Draws one town."""

    def __init__(self, roads: RoadNetwork, scenery: tuple[Prop, ...]) -> None:
        gl, made = gl_context(), programs()
        self.roads, self.scenery, self.azimuth = roads, scenery, SUN_AZIMUTH[roads.style]
        details = furniture_meshes(scenery, roads.style, KERB_HEIGHT)
        standing = [
            (building_mesh(scenery, roads.style), Level.ALWAYS), (ground_mesh(roads), Level.ALWAYS), (details.always, Level.ALWAYS),
            (details.near, Level.NEAR), (details.far, Level.FAR), (yard_mesh(roads), Level.ALWAYS),
        ]  # fmt: skip
        self._static = TownBatch(Tiles(standing), made.static, ("position", "uv", "normal", "color"))
        self._road = TownBatch(Tiles([(road_mesh(roads), Level.ALWAYS)]), made.road, ("position", "uv", "color"))
        self._cars = [(Crowd(car_mesh(s)), Crowd(far_car_mesh(s))) for s in SHAPES]
        self._people = Crowd(person_mesh()), Crowd(far_person_mesh())
        dome = dome_mesh()
        self._dome = vertex_array(
            made.sky, gl.buffer(dome.vertices.tobytes()), ("position", "uv"), gl.buffer(dome.triangles.tobytes())
        )
        self._thrown, self._lamps = (gl.buffer(reserve=32 * 1024, dynamic=True) for _ in range(2))
        self._shadow_array = gl.vertex_array(
            made.shadow, [(made.corners, "2f", "corner"), (self._thrown, "4f 4f/i", "stands", "extent")]
        )
        self._glow_array = gl.vertex_array(made.glow, [(made.corners, "2f", "corner"), (self._lamps, "4f 4f/i", "lamp", "tint")])
        self._rain_array = gl.vertex_array(made.rain, [(made.corners, "2f", "corner")])
        self._sight = Sight(scenery)
        at = [(p.pose.x, p.pose.y, p.pose.heading) for p in roads.posts]
        self._posts = np.array(at).reshape(-1, 3)
        self._targets: dict[tuple[int, int], Target] = {}
        self._skies: dict[int, moderngl.Texture] = {}
        self._shadows: dict[float, moderngl.Texture] = {}

    def render(
        self, weather: int, ego: VehicleState, vehicles: Sequence[VehicleState], pedestrians: Sequence[PedestrianState],
        lights: Mapping[str, LightState], mounts: Sequence[CameraConfig], time: float,
    ) -> list[Image]:  # fmt: skip
        """One picture (H, W, 3) for each mount on the ego. lights: by LightPost.id. Raises ValueError for an unknown weather."""
        lenses = [mounted(ego, mount) for mount in mounts]
        return self.render_through(lenses, weather, vehicles, pedestrians, lights, time)

    def render_from(
        self, weather: int, pose: Pose, height: float, pitch: float = 0.0, fov: float = 90.0,
        size: tuple[int, int] = (960, 432), vehicles: Sequence[VehicleState] = (),
        pedestrians: Sequence[PedestrianState] = (), lights: Mapping[str, LightState] | None = None, time: float = 0.0,
    ) -> Image:  # fmt: skip
        """A picture from anywhere: height in m, pitch in rad (+ up), fov in degrees, size in pixels."""
        return self.render_through([Lens(pose, height, pitch, fov, size)], weather, vehicles, pedestrians, lights or {}, time)[0]

    def render_through(
        self, lenses: Sequence[Lens], weather: int, vehicles: Sequence[VehicleState],
        pedestrians: Sequence[PedestrianState], lights: Mapping[str, LightState], time: float,
    ) -> list[Image]:  # fmt: skip
        """One picture (H, W, 3) for each lens."""
        sky = self._enter(weather)
        cars, shapes = actors.car_instances(vehicles)
        people = actors.person_instances(pedestrians)
        images = []
        for lens in lenses:
            target = self._open(lens, time)
            view = lens.view()
            self._draw_actors(view, lens, cars, shapes, people)
            self._draw_town(lens, view)
            self._draw_shadows(view, cars, shapes, people)
            self._draw_lamps(view, lights, sky.wetness > 0)
            if sky.rain > 0:
                gl_context().disable(moderngl.DEPTH_TEST)
                gl_context().blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
                self._rain_array.render(moderngl.TRIANGLE_STRIP)
            images.append(target.read())
        return images

    def _enter(self, id: int) -> Look:
        """Makes a weather's sky, light and shadows the current ones."""
        w = weather(id)
        sky = look(w, self.azimuth)
        if w.sun_altitude not in self._shadows:
            heights = shadow_heights(self.scenery, town_bounds(self.roads.bounds), sky.sun_direction)
            self._shadows[w.sun_altitude] = smooth_texture(heights)
        if id not in self._skies:
            self._skies[id] = smooth_texture(panorama(w, sky, zlib.crc32(self.roads.name.encode())), wraps=True)
        made = programs()
        made.look.write(self._look_block(sky))
        made.look.bind_to_uniform_block(1)
        for unit, texture in enumerate((made.layers, self._shadows[w.sun_altitude], self._skies[id], made.drops)):
            texture.use(unit)
        for name, value in zip(("center_color", "edge_color", "asphalt", "widths"), PAINT[self.roads.style], strict=True):
            made.road[name] = value
        return sky

    def _look_block(self, sky: Look) -> bytes:
        x0, y0, x1, y1 = town_bounds(self.roads.bounds)
        rows = [
            (*sky.sun_direction, 0), (*sky.sun, 0), (*sky.sky_ambient, 0), (*sky.ground_ambient, 0), (*sky.horizon, sky.fog_density),
            (*sky.zenith, 0), (sky.wetness, sky.puddles, sky.rain, 0), (x0, y0, 1 / (x1 - x0), 1 / (y1 - y0)),
        ]  # fmt: skip
        return np.array(rows, dtype="f4").tobytes()

    def _open(self, lens: Lens, time: float) -> Target:
        if lens.size not in self._targets:
            self._targets[lens.size] = Target(*lens.size)
        target, gl, made = self._targets[lens.size], gl_context(), programs()
        target.drawn.use()
        gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        gl.front_face, gl.depth_func = "cw", "<="
        target.drawn.clear(0.5, 0.5, 0.5, 1.0)
        eye = (lens.pose.x, lens.pose.y, lens.height, time % 64.0)
        block = np.concatenate((lens.matrix().T.ravel(), eye, (*lens.size, lens.focal, (time * 7.3) % 1.0)))
        made.frame.write(block.astype("f4").tobytes())
        made.frame.bind_to_uniform_block(0)
        return target

    def _draw_actors(self, view: View, lens: Lens, cars: actors.Instances, shapes: Indices, people: actors.Instances) -> None:
        sharp = lens.focal / 100
        seen, distance = actors.in_view(cars, view, actors.CAR_FAR * max(1.0, sharp))
        near = distance < actors.CAR_DETAIL * sharp
        for k in set(shapes[seen].tolist()):
            fine, coarse = self._cars[k]
            fine.draw(cars[seen & near & (shapes == k)])
            coarse.draw(cars[seen & ~near & (shapes == k)])
        seen, distance = actors.in_view(people, view, actors.PERSON_FAR * max(1.0, sharp))
        near = distance < actors.PERSON_DETAIL * sharp
        self._people[0].draw(people[seen & near])
        self._people[1].draw(people[seen & ~near])

    def _draw_town(self, lens: Lens, view: View) -> None:
        above = lens.height > ROOF_LEVEL
        square = np.floor(view.eye[:2] / PLACE)
        low = square * PLACE
        detail = DETAIL * max(1.0, lens.focal / 160)
        place = (*square.tolist(), above, detail)

        def seen() -> Cells | None:
            return None if above else self._sight.seen_from(low, low + PLACE, TOWN_FAR)

        for batch in (self._road, self._static):
            far = 2 * TOWN_FAR if above else TOWN_FAR
            batch.draw(batch.tiles.visible(view, place, seen, low + PLACE / 2, detail, far))
        gl_context().disable(moderngl.CULL_FACE)
        self._dome.render()

    def _draw_shadows(self, view: View, cars: actors.Instances, shapes: Indices, people: actors.Instances) -> None:
        gl = gl_context()
        gl.enable(moderngl.BLEND)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        thrown = np.concatenate((actors.car_shadows(cars, shapes), actors.person_shadows(people)))
        thrown = thrown[view.sees(thrown[:, :2], 6.0)][:1024]
        if len(thrown):
            self._thrown.write(thrown.astype("f4").tobytes())
            self._shadow_array.render(moderngl.TRIANGLE_STRIP, instances=len(thrown))

    def _draw_lamps(self, view: View, lights: Mapping[str, LightState], wet: bool) -> None:
        """The lit lamps, and on a wet road their streaks."""
        seen = view.sees(self._posts[:, :2], 1.0) & (np.hypot(*(self._posts[:, :2] - view.eye[:2]).T) < GLOW_FAR)
        rows = []
        for k in np.flatnonzero(seen):
            state = lights.get(self.roads.posts[k].id)
            if state is not None:
                x, y, heading = self._posts[k]
                face = (LAMP_FACE - 0.03) * np.array((np.cos(heading), np.sin(heading)))
                row = (x + face[0], y + face[1], LAMPS[state.value] + KERB_HEIGHT, heading, *GLOWS[state])
                rows += [(*row, 0.0), (*row, 1.0)] if wet else [(*row, 0.0)]
        if rows:
            gl_context().blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            self._lamps.write(np.array(rows[:1024], dtype="f4").tobytes())
            self._glow_array.render(moderngl.TRIANGLE_STRIP, instances=len(rows))

    def close(self) -> None:
        """Frees what the town holds on the graphics side."""
        for batch in (self._static, self._road):
            batch.release()
        for thing in (*self._targets.values(), *self._skies.values(), *self._shadows.values()):
            thing.release()
        self._targets.clear()
        self._skies.clear()
        self._shadows.clear()
