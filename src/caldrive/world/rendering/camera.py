"""The camera rig: pictures of a town, its traffic and its weather, drawn with OpenGL and no display."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import CameraConfig, Image, LightState, PedestrianState, Semantic, VehicleState
from caldrive.world.rendering.actors import Actors, car_actors, person_actors
from caldrive.world.rendering.atmosphere import Atmosphere
from caldrive.world.rendering.gl import RenderTarget, gl_context
from caldrive.world.rendering.gpu_meshes import InstancedMesh, TownMesh, town_meshes, vertex_array
from caldrive.world.rendering.occlusion import Cells, OcclusionMap
from caldrive.world.rendering.overlays import Overlays
from caldrive.world.rendering.pinhole import PinholeCamera, camera_on
from caldrive.world.rendering.programs import BLOCKS, programs, semantic_programs
from caldrive.world.rendering.tiles import ViewCell
from caldrive.world.scene.cars import SHAPES, car_mesh, far_car_mesh
from caldrive.world.scene.people import far_person_mesh, person_mesh
from caldrive.world.scene.sky import dome_mesh
from caldrive.world.town import Town

TOWN_FAR = 230.0  # m beyond which no more of the town is drawn
TOWN_DETAIL = 32.0  # m within which details of the town are drawn, for a small picture
VIEW_CELL = 8.0  # m; from the next one up, houses no longer hide what lies behind them
CAR_DETAIL, PERSON_DETAIL = 22.0, 14.0  # m within which the fine meshes are drawn, for a small picture
CAR_FAR, PERSON_FAR = 160.0, 80.0  # m beyond which nobody is drawn
ACTOR_REACH = 3.0  # m around an actor that may be in view
SUPERSAMPLING = 2  # drawn as they are, edges jump from pixel to pixel and thin things flicker
SMALL_FOCAL = 100.0  # px, the focal length of a small picture (200 x 88 at 90 degrees)


@dataclass(frozen=True)
class SceneState:
    """What a picture shows beside the town."""

    weather: int
    """1 to 14."""
    ego: VehicleState
    """It is not drawn: cameras are mounted on it."""
    vehicles: Sequence[VehicleState] = ()
    pedestrians: Sequence[PedestrianState] = ()
    lights: Mapping[str, LightState] = field(default_factory=dict)
    """What the traffic lights show, by LightPost.id; others are dark."""
    time: float = 0.0
    """s, moves the rain."""


@dataclass(frozen=True)
class _ActorMeshes:
    """Fine and coarse meshes of one kind of actor, in the order of its shapes, and how far they are drawn (m)."""

    fine: tuple[InstancedMesh, ...]
    coarse: tuple[InstancedMesh, ...]
    detail: float
    far: float
    semantic: Semantic


class CameraRig:
    """Draws one town, through any number of cameras on the ego. Raises RuntimeError where the machine has no EGL."""

    def __init__(self, town: Town) -> None:
        self.town, roads, scenery, appearance = town, town.roads, town.scenery, town.appearance
        gl, dome = gl_context(), dome_mesh()
        self._meshes: tuple[TownMesh, ...] = town_meshes(roads, scenery, appearance)
        self._cars = _ActorMeshes(
            fine=tuple(InstancedMesh(car_mesh(shape)) for shape in SHAPES),
            coarse=tuple(InstancedMesh(far_car_mesh(shape)) for shape in SHAPES),
            detail=CAR_DETAIL,
            far=CAR_FAR,
            semantic=Semantic.VEHICLE,
        )
        self._people = _ActorMeshes(
            fine=(InstancedMesh(person_mesh()),),
            coarse=(InstancedMesh(far_person_mesh()),),
            detail=PERSON_DETAIL,
            far=PERSON_FAR,
            semantic=Semantic.PERSON,
        )
        data, index = gl.buffer(dome.vertices.tobytes()), gl.buffer(dome.triangles.tobytes())
        self._dome = vertex_array(programs().sky, data, index)
        self._atmosphere, self._overlays = Atmosphere(roads, scenery, appearance), Overlays(roads.posts)
        self._occlusion = OcclusionMap(scenery)
        self._targets: dict[tuple[tuple[int, int], int], RenderTarget] = {}

    def render(self, state: SceneState, mounts: Sequence[CameraConfig]) -> list[Image]:
        """One picture (H, W, 3) for each mount on the ego. Raises ValueError for an unknown weather."""
        return self.render_from([camera_on(state.ego, mount) for mount in mounts], state)

    def render_from(self, cameras: Sequence[PinholeCamera], state: SceneState) -> list[Image]:
        """One picture (H, W, 3) for each camera: near things first, so that they hide the others cheaply."""
        light, lamps = self._atmosphere.use_weather(state.weather), self._overlays.lit_lamps(state.lights)
        cars, people = car_actors(state.vehicles), person_actors(state.pedestrians)
        shadows = np.concatenate((cars.shadows, people.shadows))
        images = []
        for camera in cameras:
            target, frustum = self._begin(camera, SUPERSAMPLING, state.time), camera.frustum()
            self._draw_opaque(camera, cars, people)
            gl_context().disable(moderngl.CULL_FACE)
            self._dome.render()
            self._overlays.draw_shadows(frustum, shadows)
            self._overlays.draw_lamps(frustum, lamps, is_wet=light.wetness > 0)
            if light.rain > 0:
                self._overlays.draw_rain()
            images.append(target.read())
        return images

    def render_semantics(self, state: SceneState, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `render`'s pictures shows, (H, W) for each mount, as numbers of `Semantic`."""
        semantic_programs().road["widths"] = self._atmosphere.appearance.paint.widths
        cars, people = car_actors(state.vehicles), person_actors(state.pedestrians)
        images = []
        for camera in (camera_on(state.ego, mount) for mount in mounts):
            target = self._begin(camera, supersampling=1, time=0.0)
            target.framebuffer.clear()  # sky is where nothing is drawn
            self._draw_opaque(camera, cars, people, semantic=True)
            images.append(target.read()[..., 0])
        return images

    def _begin(self, camera: PinholeCamera, supersampling: int, time: float) -> RenderTarget:
        """An empty target that is drawn into from now on."""
        key = camera.size, supersampling
        if key not in self._targets:
            self._targets[key] = RenderTarget(*key)
        target, gl, shared = self._targets[key], gl_context(), programs()
        target.framebuffer.use()
        gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        gl.front_face, gl.depth_func = "cw", "<="  # pictures are drawn upside down
        target.framebuffer.clear(0.5, 0.5, 0.5, 1.0)
        eye = (camera.pose.x, camera.pose.y, camera.height, time % 64.0)
        lens = (*camera.size, camera.focal, (time * 7.3) % 1.0)
        block = np.concatenate((camera.matrix().T.ravel(), eye, lens))
        shared.frame.write(block.astype("f4").tobytes())
        shared.frame.bind_to_uniform_block(BLOCKS["Frame"])
        return target

    def _draw_opaque(self, camera: PinholeCamera, cars: Actors, people: Actors, semantic: bool = False) -> None:
        """Everything but the sky and what lies over it; semantic: classes instead of colours."""
        self._draw_actors(camera, cars, self._cars, semantic)
        self._draw_actors(camera, people, self._people, semantic)
        self._draw_town(camera, semantic)

    def _draw_actors(self, camera: PinholeCamera, actors: Actors, meshes: _ActorMeshes, semantic: bool) -> None:
        """Cars or people: each shape first with its fine, then with its coarse mesh."""
        if semantic:
            semantic_programs().actor["kind"] = meshes.semantic
        frustum, zoom = camera.frustum(), _zoom(camera)
        distance = np.hypot(*(actors.at - frustum.eye[:2]).T)
        seen = frustum.sees(actors.at, ACTOR_REACH) & (distance < meshes.far * zoom)
        is_far = distance > meshes.detail * zoom
        for shape in sorted(set(actors.shapes[seen].tolist())):
            of_shape = seen & (actors.shapes == shape)
            meshes.fine[shape].draw(actors.instances[of_shape & ~is_far], semantic)
            meshes.coarse[shape].draw(actors.instances[of_shape & is_far], semantic)

    def _draw_town(self, camera: PinholeCamera, semantic: bool) -> None:
        """Road and scenery as far as they can be seen from here."""
        frustum = camera.frustum()
        view_cell = ViewCell.around(frustum.eye, size=VIEW_CELL, detail=TOWN_DETAIL * _zoom(camera))
        is_above = view_cell.low[2] >= VIEW_CELL
        low = np.array(view_cell.low[:2])

        def cells_in_sight() -> Cells | None:
            return None if is_above else self._occlusion.visible_cells(low, low + VIEW_CELL, TOWN_FAR)

        far = 2 * TOWN_FAR if is_above else TOWN_FAR
        for mesh in self._meshes:
            mesh.draw(mesh.grid.visible(frustum, view_cell, cells_in_sight, far), semantic)

    def close(self) -> None:
        """Frees what the town holds on the graphics side."""
        programs().current = None
        self._meshes, self._targets = (), {}
        self._atmosphere.close()


def _zoom(camera: PinholeCamera) -> float:
    """How many times as far a camera sees details as that of a small picture."""
    return max(1.0, camera.focal / SMALL_FOCAL)
