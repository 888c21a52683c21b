"""The camera rig: pictures of a town, its traffic and its weather, drawn by compiled code on one core."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import Floats, f32
from caldrive.datatypes import CameraConfig, Image, LightState, PedestrianState, VehicleState
from caldrive.world.rendering.actor_meshes import actor_meshes
from caldrive.world.rendering.actors import seen_actors
from caldrive.world.rendering.atmosphere import Atmosphere
from caldrive.world.rendering.fragments import SAMPLES
from caldrive.world.rendering.occlusion import Cells, OcclusionMap
from caldrive.world.rendering.overlays import Lamps
from caldrive.world.rendering.picture import Canvas, Drawn, Overlays
from caldrive.world.rendering.pinhole import PinholeCamera, camera_on
from caldrive.world.rendering.repainting import Repainting
from caldrive.world.rendering.spots import Scene
from caldrive.world.rendering.tiles import Faces, ViewCell
from caldrive.world.rendering.town_mesh import town_grid, town_vertices
from caldrive.world.scene.people import Shown
from caldrive.world.scene.sky import dome_triangles, rain_streaks
from caldrive.world.scene.weather import Weather
from caldrive.world.town import Town

TOWN_FAR = 230.0  # m beyond which no more of the town is drawn
TOWN_DETAIL = 32.0  # m within which details of the town are drawn, for a small picture
VIEW_CELL = 8.0  # m; from the next one up, houses no longer hide what lies behind them
MOST_CANVASES = 12  # sizes of pictures for which room is kept
SMALL_FOCAL = 100.0  # px, the focal length of a small picture (200 x 88 at 90 degrees)


@dataclass(frozen=True)
class SceneState:
    """What a picture shows beside the town."""

    weather: int | Weather
    """1 to 14, or one of one's own."""
    ego: VehicleState
    """It is not drawn: cameras are mounted on it."""
    vehicles: Sequence[VehicleState] = ()
    pedestrians: Sequence[PedestrianState] = ()
    lights: Mapping[str, LightState] = field(default_factory=dict)
    """What the traffic lights show, by LightPost.id; others are dark."""
    time: float = 0.0
    """s, moves the rain."""
    shown: Mapping[str, Shown] = field(default_factory=dict)
    """What is drawn of people, by PedestrianState.id; others are drawn whole."""


class CameraRig:
    """Draws one town, through any number of cameras on the ego."""

    def __init__(self, town: Town) -> None:
        self.town, roads, scenery, appearance = town, town.roads, town.scenery, town.appearance
        self._grid = town_grid(roads, scenery, appearance)
        self._vertices = town_vertices(self._grid.vertices)
        self._meshes = actor_meshes()
        self._atmosphere, self._lamps = Atmosphere(roads, scenery, appearance), Lamps(roads.posts)
        self._occlusion, self._dome = OcclusionMap(scenery), dome_triangles()
        self._drops = (rain_streaks() / 255).astype(np.float32)
        self._canvases: dict[tuple[int, int, int], Canvas] = {}

    def repainted(self, paint: Repainting) -> CameraRig:
        """Draws the same town, painted otherwise. It shares all else with this one, and closes with it."""
        other = copy.copy(self)
        other._vertices = paint.surfaces(self._vertices)
        other._atmosphere = self._atmosphere.with_paint(paint.lines(self.town.appearance.paint))
        return other

    def render(self, state: SceneState, mounts: Sequence[CameraConfig]) -> list[Image]:
        """One picture (H, W, 3) for each mount on the ego. Raises ValueError for an unknown weather."""
        return self.render_from([camera_on(state.ego, mount) for mount in mounts], state)

    def render_from(self, cameras: Sequence[PinholeCamera], state: SceneState) -> list[Image]:
        """One picture (H, W, 3) for each camera; all of them are near each other."""
        here = cameras[0].pose if cameras else state.ego.pose
        light, materials = self._atmosphere.in_weather(state.weather, here.x, here.y)
        over = Overlays(self._lamps.lit(state.lights, float(light.wetness)), self._drops, f32(state.time % 64))
        return [
            self._canvas(camera.size, SAMPLES).image(
                self._drawn(camera, state), Scene(materials, light, camera.view()), over
            )
            for camera in cameras
        ]

    def render_semantics(self, state: SceneState, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `render`'s pictures shows, (H, W) for each mount, as numbers of `Semantic`."""
        cameras = [camera_on(state.ego, mount) for mount in mounts]
        return [self.semantics_from(camera, state) for camera in cameras]

    def semantics_from(self, camera: PinholeCamera, state: SceneState) -> NDArray[np.uint8]:
        """What each pixel (H, W) of a camera's picture shows, as numbers of `Semantic`."""
        return self._canvas(camera.size, 1).classes(self._drawn(camera, state), self._in_light(camera, state))

    def distances_from(self, camera: PinholeCamera, state: SceneState) -> Floats:
        """How far away (H, W) along its optical axis lies what a camera's picture shows, m."""
        return self._canvas(camera.size, 1).distances(self._drawn(camera, state), self._in_light(camera, state))

    def _in_light(self, camera: PinholeCamera, state: SceneState) -> Scene:
        light, materials = self._atmosphere.in_weather(state.weather, camera.pose.x, camera.pose.y)
        return Scene(materials, light, camera.view())

    def _canvas(self, size: tuple[int, int], samples: int) -> Canvas:
        key = *size, samples
        if key not in self._canvases:
            if len(self._canvases) >= MOST_CANVASES:
                del self._canvases[next(iter(self._canvases))]
            self._canvases[key] = Canvas(size, samples)
        return self._canvases[key]

    def _drawn(self, camera: PinholeCamera, state: SceneState) -> Drawn:
        """All that a camera may see."""
        actors = seen_actors(camera.frustum(), _zoom(camera), state.vehicles, state.pedestrians, state.shown)
        return Drawn(self._meshes, actors, self._faces(camera), self._vertices, self._dome)

    def _faces(self, camera: PinholeCamera) -> Faces:
        """Road and scenery as far as they may be seen from around here."""
        eye = camera.pose.x, camera.pose.y, camera.height
        view_cell = ViewCell.around(eye, size=VIEW_CELL, detail=TOWN_DETAIL * _zoom(camera))
        is_above = view_cell.low[2] >= VIEW_CELL

        def cells_in_sight() -> Cells | None:
            low = np.array(view_cell.low[:2])
            return None if is_above else self._occlusion.visible_cells(low, low + VIEW_CELL, TOWN_FAR)

        return self._grid.seen_from(view_cell, cells_in_sight, 2 * TOWN_FAR if is_above else TOWN_FAR)

    def close(self) -> None:
        """Frees what the town holds."""
        self._canvases.clear()
        self._atmosphere.close()


def _zoom(camera: PinholeCamera) -> float:
    """How many times as far a camera sees details as that of a small picture."""
    return max(1.0, camera.focal / SMALL_FOCAL)
