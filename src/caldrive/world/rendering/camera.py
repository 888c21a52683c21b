"""The camera: pictures of a town, its traffic and its weather, drawn with OpenGL and no display."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import CameraConfig, Image, LightState, PedestrianState, Semantic, VehicleState
from caldrive.world.rendering.actors import Actors, car_actors, person_actors
from caldrive.world.rendering.atmosphere import Atmosphere
from caldrive.world.rendering.batches import Crowd, TownBatch, town_batches, vertex_array
from caldrive.world.rendering.gl import RenderTarget, gl_context
from caldrive.world.rendering.lens import Lens, View, mounted
from caldrive.world.rendering.overlays import Overlays
from caldrive.world.rendering.programs import programs, semantic_programs
from caldrive.world.rendering.visibility import DETAIL, Cells, Place, Sight
from caldrive.world.scene.cars import SHAPES, car_mesh, far_car_mesh
from caldrive.world.scene.people import far_person_mesh, person_mesh
from caldrive.world.scene.sky import dome_mesh
from caldrive.world.town import Town

TOWN_FAR = 230.0  # m beyond which no more of the town is drawn
PLACE = 8.0  # m, size of a place; from its next storey up, houses no longer hide what lies behind them
CAR_DETAIL, PERSON_DETAIL = 22.0, 14.0  # m within which the fine meshes are drawn, for a small picture
CAR_FAR, PERSON_FAR = 160.0, 80.0  # m beyond which nobody is drawn
FINE = 2  # drawn so many times as large: drawn as they are, edges jump from pixel to pixel and thin things flicker
SHARP = 100.0  # px, the focal length of a small picture (200 x 88 at 90 degrees)


@dataclass(frozen=True)
class Shot:
    """What a picture shows beside the town. lights: by LightPost.id. time: s, moves the rain."""

    weather: int
    ego: VehicleState
    vehicles: Sequence[VehicleState] = ()
    pedestrians: Sequence[PedestrianState] = ()
    lights: Mapping[str, LightState] = field(default_factory=dict)
    time: float = 0.0


class CameraRig:
    """Draws one town, through any number of cameras on the ego."""

    def __init__(self, town: Town) -> None:
        self.town, roads, scenery, decor = town, town.roads, town.scenery, town.decor
        gl, made, dome = gl_context(), programs(), dome_mesh()
        self._batches: tuple[TownBatch, ...] = town_batches(roads, scenery, decor)
        self._cars = [Crowd(make(shape)) for shape in SHAPES for make in (car_mesh, far_car_mesh)]
        self._people = [Crowd(person_mesh()), Crowd(far_person_mesh())]
        data, index = gl.buffer(dome.vertices.tobytes()), gl.buffer(dome.triangles.tobytes())
        self._dome = vertex_array(made.sky, data, index)
        self._atmosphere, self._overlays = Atmosphere(roads, scenery, decor), Overlays(roads.posts)
        self._sight = Sight(scenery)
        self._targets: dict[tuple[tuple[int, int], int], RenderTarget] = {}

    def render(self, shot: Shot, mounts: Sequence[CameraConfig]) -> list[Image]:
        """One picture (H, W, 3) for each mount on the ego. Raises ValueError for an unknown weather."""
        return self.render_through([mounted(shot.ego, mount) for mount in mounts], shot)

    def render_through(self, lenses: Sequence[Lens], shot: Shot) -> list[Image]:
        """One picture (H, W, 3) for each lens: near things first, so that they hide the others cheaply."""
        sky, lit = self._atmosphere.enter(shot.weather), self._overlays.lit(shot.lights)
        cars, people = car_actors(shot.vehicles), person_actors(shot.pedestrians)
        thrown = np.concatenate((cars.shadows, people.shadows))
        images = []
        for lens in lenses:
            target, view = self._open(lens, FINE, shot.time), lens.view()
            self._draw_solid(view, lens, cars, people)
            gl_context().disable(moderngl.CULL_FACE)
            self._dome.render()
            self._overlays.shadows(view, thrown)
            self._overlays.lamps(view, lit, sky.wetness > 0)
            if sky.rain > 0:
                self._overlays.rain()
            images.append(target.read())
        return images

    def render_semantics(self, shot: Shot, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `render`'s pictures shows, (H, W) for each mount, as numbers of `Semantic`."""
        made = semantic_programs()
        made.road["widths"] = self._atmosphere.decor.paint.stripes
        cars, people = car_actors(shot.vehicles), person_actors(shot.pedestrians)
        images = []
        for lens in (mounted(shot.ego, mount) for mount in mounts):
            target = self._open(lens, 1, 0.0)
            target.framebuffer.clear()  # sky is where nothing is drawn
            self._draw_solid(lens.view(), lens, cars, people, semantic=True)
            images.append(target.read()[..., 0])
        return images

    def _open(self, lens: Lens, fine: int, time: float) -> RenderTarget:
        """An empty target that is drawn into from now on."""
        if (lens.size, fine) not in self._targets:
            self._targets[lens.size, fine] = RenderTarget(lens.size, fine)
        target, gl, made = self._targets[lens.size, fine], gl_context(), programs()
        target.framebuffer.use()
        gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        gl.front_face, gl.depth_func = "cw", "<="  # pictures are drawn upside down
        target.framebuffer.clear(0.5, 0.5, 0.5, 1.0)
        eye = (lens.pose.x, lens.pose.y, lens.height, time % 64.0)
        block = np.concatenate((lens.matrix().T.ravel(), eye, (*lens.size, lens.focal, (time * 7.3) % 1.0)))
        made.frame.write(block.astype("f4").tobytes())
        made.frame.bind_to_uniform_block(0)
        return target

    def _draw_solid(self, view: View, lens: Lens, cars: Actors, people: Actors, semantic: bool = False) -> None:
        """Everything but the sky and what lies over it."""
        if semantic:
            semantic_programs().actor["kind"] = Semantic.VEHICLE
        self._draw_actors(view, lens, cars, self._cars, (CAR_DETAIL, CAR_FAR), semantic)
        if semantic:
            semantic_programs().actor["kind"] = Semantic.PERSON
        self._draw_actors(view, lens, people, self._people, (PERSON_DETAIL, PERSON_FAR), semantic)
        self._draw_town(view, lens, semantic)

    def _draw_actors(
        self, view: View, lens: Lens, group: Actors, crowds: Sequence[Crowd], reach: tuple[float, float], semantic: bool
    ) -> None:
        """Cars or people; crowds: for each shape its fine and its coarse mesh. reach: m of fine meshes, and of all."""
        sharp = max(1.0, lens.focal / SHARP)
        detail, far = reach
        distance = np.hypot(*(group.at - view.eye[:2]).T)
        seen = view.sees(group.at, 3.0) & (distance < far * sharp)
        kind = 2 * group.shapes + (distance > detail * sharp)
        for k in sorted(set(kind[seen].tolist())):
            crowds[k].draw(group.instances[seen & (kind == k)], semantic)

    def _draw_town(self, view: View, lens: Lens, semantic: bool) -> None:
        """Road and scenery as far as they can be seen from here."""
        place = Place.around(view.eye, PLACE, DETAIL * max(1.0, lens.focal / SHARP))
        above = place.low[2] >= PLACE
        low = np.array(place.low[:2])

        def seen() -> Cells | None:
            return None if above else self._sight.seen_from(low, low + PLACE, TOWN_FAR)

        for batch in self._batches:
            batch.draw(batch.tiles.visible(view, place, seen, 2 * TOWN_FAR if above else TOWN_FAR), semantic)

    def close(self) -> None:
        """Frees what the town holds on the graphics side."""
        programs().current = None
        self._batches, self._targets = (), {}
        self._atmosphere.close()
