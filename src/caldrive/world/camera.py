"""The camera: pictures of a town, its traffic and its weather, drawn with OpenGL and no display."""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Mapping, Sequence
from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.config import CameraConfig
from caldrive.datatypes import Image, LightState, PedestrianState, Pose, VehicleState
from caldrive.geometry import moved
from caldrive.world import actors
from caldrive.world.actors import Actors
from caldrive.world.batches import Crowd, TownBatch, vertex_array
from caldrive.world.buildings import building_meshes
from caldrive.world.cars import SHAPES, car_mesh, far_car_mesh
from caldrive.world.furniture import LAMP_FACE, LAMPS, furniture_meshes
from caldrive.world.gl import Target, gl_context, programs, smooth_texture
from caldrive.world.ground import KERB_HEIGHT, far_kerb_mesh, kerb_mesh, road_mesh, yard_mesh
from caldrive.world.optics import Lens, mounted
from caldrive.world.people import far_person_mesh, person_mesh
from caldrive.world.roads import RoadNetwork
from caldrive.world.scenery import Prop
from caldrive.world.shadows import shadow_heights, town_bounds
from caldrive.world.sight import Cells, Sight
from caldrive.world.sky import dome_mesh, panorama
from caldrive.world.tiles import DETAIL, Level, Place, Tiles, View
from caldrive.world.weather import Look, Weather, look, weather

GLOW_FAR = 150.0  # m
TOWN_FAR = 230.0  # m beyond which no more of the town is drawn
PLACE = 8.0  # m, size of a place; from its next storey up, houses no longer hide what lies behind them
GLOWS = {LightState.RED: (1.0, 0.10, 0.06), LightState.YELLOW: (1.0, 0.74, 0.10), LightState.GREEN: (0.12, 1.0, 0.42)}
SUN_AZIMUTH = {"town01": 0.95, "town02": 2.5}  # rad
PAINT = {  # colours of centre lines, edge lines and asphalt, and the widths that the road shader wants
    "town01": ((0.93, 0.70, 0.20), (0.92, 0.92, 0.90), (0.50, 0.50, 0.51), (0.10, 0.075, 0.28, 0.5)),
    "town02": ((0.95, 0.82, 0.42), (0.88, 0.88, 0.86), (0.58, 0.56, 0.54), (0.09, 0.06, 0.18, 0.42)),
}
CAR_DETAIL, PERSON_DETAIL = 22.0, 14.0  # m within which the fine meshes are drawn
CAR_FAR, PERSON_FAR = 160.0, 80.0  # m beyond which nobody is drawn
MOST = 1024  # shadows or lamps in one picture
_NUMBERS = itertools.count()


@lru_cache(maxsize=4096)
def _lens_of(post: Pose, state: LightState) -> tuple[float, float, float, float]:
    """Position of a post's lit lamp, and the heading of the traffic it faces."""
    at = moved(post, LAMP_FACE - 0.03)
    return at.x, at.y, LAMPS[state.value] + KERB_HEIGHT, post.heading


class Camera:
    """Draws one town. samples: of antialiasing for pictures that people look at; it more than doubles the time."""

    def __init__(self, roads: RoadNetwork, scenery: tuple[Prop, ...], samples: int = 0) -> None:
        gl, made = gl_context(), programs()
        self._number, self.samples = next(_NUMBERS), samples
        self.roads, self.scenery, self.azimuth = roads, scenery, SUN_AZIMUTH[roads.style]
        details = furniture_meshes(scenery, roads.style, KERB_HEIGHT)
        houses = building_meshes(scenery, roads.style)
        standing = [
            (houses.always, Level.ALWAYS), (houses.near, Level.NEAR), (houses.far, Level.FAR),
            (details.always, Level.ALWAYS), (details.near, Level.NEAR), (details.far, Level.FAR),
            (kerb_mesh(roads), Level.NEAR), (far_kerb_mesh(roads), Level.ALWAYS), (yard_mesh(roads), Level.ALWAYS),
        ]  # fmt: skip
        self._static = TownBatch(Tiles(standing), made.static, ("position", "uv", "normal", "color"))
        self._road = TownBatch(Tiles([(road_mesh(roads), Level.ALWAYS)]), made.road, ("position", "uv", "color"))
        self._cars = [Crowd(make(shape)) for shape in SHAPES for make in (car_mesh, far_car_mesh)]
        self._people = [Crowd(person_mesh()), Crowd(far_person_mesh())]
        dome = dome_mesh()
        self._dome = vertex_array(
            made.sky, gl.buffer(dome.vertices.tobytes()), ("position", "uv"), gl.buffer(dome.triangles.tobytes())
        )
        self._thrown, self._lamps = (gl.buffer(reserve=32 * MOST, dynamic=True) for _ in range(2))
        self._shadow_array = gl.vertex_array(
            made.shadow, [(made.corners, "2f", "corner"), (self._thrown, "4f 4f/i", "stands", "extent")]
        )
        self._glow_array = gl.vertex_array(
            made.glow, [(made.corners, "2f", "corner"), (self._lamps, "4f 4f/i", "lamp", "tint")]
        )
        self._rain_array = gl.vertex_array(made.rain, [(made.corners, "2f", "corner")])
        self._sight = Sight(scenery)
        self._targets: dict[tuple[int, int], Target] = {}
        self._skies: dict[int, moderngl.Texture] = {}
        self._looks: dict[int, Look] = {}
        self._last_lights: Mapping[str, LightState] = {}
        self._last_lit = np.zeros((0, 8), np.float32)
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
        return self.render_through(
            [Lens(pose, height, pitch, fov, size)], weather, vehicles, pedestrians, lights or {}, time
        )[0]

    def render_through(
        self, lenses: Sequence[Lens], weather: int, vehicles: Sequence[VehicleState],
        pedestrians: Sequence[PedestrianState], lights: Mapping[str, LightState], time: float,
    ) -> list[Image]:  # fmt: skip
        """One picture (H, W, 3) for each lens."""
        sky = self._enter(weather)
        cars, people = actors.car_actors(vehicles), actors.person_actors(pedestrians)
        lamps = self._lit(lights)
        images = []
        for lens in lenses:
            target, view = self._open(lens, time), lens.view()
            self._draw_actors(view, lens, cars, people)
            self._draw_town(lens, view)
            self._draw_shadows(view, np.concatenate((cars.shadows, people.shadows)))
            self._draw_lamps(view, lamps, sky.wetness > 0)
            if sky.rain > 0:
                self._draw_rain()
            images.append(target.read())
        return images

    def _enter(self, id: int) -> Look:
        """Makes a weather's sky, light and shadows the current ones."""
        w, made = weather(id), programs()
        if id not in self._skies:
            self._prepare(w)
        sky = self._looks[id]
        if made.current == (self._number, id):
            return sky
        made.current = (self._number, id)
        made.look.write(self._look_block(sky))
        made.look.bind_to_uniform_block(1)
        for unit, texture in enumerate((made.layers, self._shadows[w.sun_altitude], self._skies[id], made.drops)):
            texture.use(unit)
        for name, value in zip(
            ("center_color", "edge_color", "asphalt", "widths"), PAINT[self.roads.style], strict=True
        ):
            made.road[name] = value
        return sky

    def _prepare(self, w: Weather) -> None:
        """Computes a weather's look, sky and shadows."""
        sky = self._looks[w.id] = look(w, self.azimuth)
        self._skies[w.id] = smooth_texture(panorama(w, sky, zlib.crc32(self.roads.name.encode())), wraps=True)
        if w.sun_altitude not in self._shadows:
            heights = shadow_heights(self.scenery, town_bounds(self.roads.bounds), sky.sun_direction)
            self._shadows[w.sun_altitude] = smooth_texture(heights)

    def _look_block(self, sky: Look) -> bytes:
        x0, y0, x1, y1 = town_bounds(self.roads.bounds)
        rows = [
            (*sky.sun_direction, 0), (*sky.sun, 0), (*sky.sky_ambient, 0), (*sky.ground_ambient, 0), (*sky.horizon, sky.fog_density),
            (*sky.zenith, 0), (sky.wetness, sky.puddles, sky.rain, 0), (x0, y0, 1 / (x1 - x0), 1 / (y1 - y0)),
        ]  # fmt: skip
        return np.array(rows, dtype="f4").tobytes()

    def _open(self, lens: Lens, time: float) -> Target:
        if lens.size not in self._targets:
            self._targets[lens.size] = Target(lens.size, self.samples)
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

    def _draw_actors(self, view: View, lens: Lens, cars: Actors, people: Actors) -> None:
        sharp = max(1.0, lens.focal / 100)
        for group, crowds, detail, far in (
            (cars, self._cars, CAR_DETAIL, CAR_FAR),
            (people, self._people, PERSON_DETAIL, PERSON_FAR),
        ):
            distance = np.hypot(*(group.at - view.eye[:2]).T)
            seen = view.sees(group.at, 3.0) & (distance < far * sharp)
            kind = 2 * group.shapes + (distance > detail * sharp)
            for k in sorted(set(kind[seen].tolist())):
                crowds[k].draw(group.instances[seen & (kind == k)])

    def _draw_town(self, lens: Lens, view: View) -> None:
        place = Place.around(view.eye, PLACE, DETAIL * max(1.0, lens.focal / 120))
        above = place.low[2] >= PLACE
        low = np.array(place.low)[:2]

        def seen() -> Cells | None:
            return None if above else self._sight.seen_from(low, low + PLACE, TOWN_FAR)

        for batch in (self._road, self._static):
            batch.draw(batch.tiles.visible(view, place, seen, 2 * TOWN_FAR if above else TOWN_FAR))
        gl_context().disable(moderngl.CULL_FACE)
        self._dome.render()

    def _draw_shadows(self, view: View, thrown: NDArray[np.float32]) -> None:
        gl = gl_context()
        gl.enable(moderngl.BLEND)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        thrown = thrown[view.sees(thrown[:, :2], 6.0)][:MOST]
        if len(thrown):
            self._thrown.write(thrown)
            self._shadow_array.render(moderngl.TRIANGLE_STRIP, instances=len(thrown))

    def _lit(self, lights: Mapping[str, LightState]) -> NDArray[np.float32]:
        """The lit lamps (N, 8): position, heading, colour and 0."""
        if lights == self._last_lights:
            return self._last_lit
        shown = [(post.pose, lights[post.id]) for post in self.roads.posts if post.id in lights]
        rows = [(*_lens_of(pose, state), *GLOWS[state], 0.0) for pose, state in shown]
        self._last_lights, self._last_lit = dict(lights), np.array(rows, dtype=np.float32).reshape(-1, 8)
        return self._last_lit

    def _draw_lamps(self, view: View, lamps: NDArray[np.float32], wet: bool) -> None:
        """The lit lamps, and on a wet road their streaks."""
        near = np.hypot(*(lamps[:, :2] - view.eye[:2]).T) < GLOW_FAR
        lamps = lamps[near & view.sees(lamps[:, :2], 1.0)][: MOST // 2]
        if not len(lamps):
            return
        if wet:
            lamps = np.concatenate((lamps, lamps + np.eye(8, dtype=np.float32)[7]))
        gl_context().blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._lamps.write(lamps)
        self._glow_array.render(moderngl.TRIANGLE_STRIP, instances=len(lamps))

    def _draw_rain(self) -> None:
        gl = gl_context()
        gl.disable(moderngl.DEPTH_TEST)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._rain_array.render(moderngl.TRIANGLE_STRIP)

    def close(self) -> None:
        """Frees what the town holds on the graphics side."""
        for batch in (self._static, self._road):
            batch.release()
        for thing in (*self._targets.values(), *self._skies.values(), *self._shadows.values()):
            thing.release()
        self._targets.clear()
        self._skies.clear()
        self._shadows.clear()
