"""From triangles to a picture: what is drawn is projected, rasterised and shaded, and so are its classes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import Floats, Integers, compiled, f32, i32
from caldrive.datatypes import Image, Semantic
from caldrive.world.rendering.actor_meshes import ActorMeshes, actor_values, project_actors
from caldrive.world.rendering.actors import Actors
from caldrive.world.rendering.fragments import Fragments, make_planes, room_for, seen
from caldrive.world.rendering.overlays import Scratch, draw_lamps, draw_rain, draw_shadows, scratch_for
from caldrive.world.rendering.pinhole import View
from caldrive.world.rendering.rasteriser import rasterise
from caldrive.world.rendering.road_surface import WIDTHS, markings
from caldrive.world.rendering.spots import Scene, Spot, at
from caldrive.world.rendering.surfaces import (
    ACTOR,
    COUNTS,
    EVEN,
    FLATS,
    ROAD,
    ROWS,
    SKY,
    STANDING,
    VALUES,
    Surfaces,
    shade,
)
from caldrive.world.rendering.tiles import Faces
from caldrive.world.rendering.town_mesh import TownVertices, project_town, road_values, standing_values

OF_TOWN, OF_SKY = -1, -2  # in the place of an actor
ROAD_CLASS, LINE_CLASS = int(Semantic.ROAD), int(Semantic.LINE)
ZERO, HALF, ONE = f32(0.0), f32(0.5), f32(1.0)


class Drawn(NamedTuple):
    """All that a picture may show."""

    meshes: ActorMeshes
    actors: Actors
    faces: Faces
    vertices: TownVertices
    dome: Floats
    """(T, 3, 5): of the sky, a direction (3,), u, v for each corner of its triangles."""


class Overlays(NamedTuple):
    """What lies over a picture, beside the shadows of the actors."""

    lamps: Floats
    """(N, 8), see `overlays.draw_lamps`."""
    drops: Floats
    """(size, size) in [0, 1], see `overlays.draw_rain`."""
    time: np.float32
    """s."""


class Room(NamedTuple):
    """Room for a picture's triangles."""

    corners: Floats
    """(N, 3, 3): their clip coordinates."""
    sources: Integers
    """(N, 2): what each is part of, see `_surfaces`."""
    order: Integers
    """(N,)."""
    seen: Integers
    """(N,): those that are seen."""
    surfaces: Surfaces
    """Of those that are seen."""


class Sheet(NamedTuple):
    """Room for a picture's samples and pixels."""

    depths: Floats
    """(rows, columns) of samples: 1/w."""
    shown: Integers
    """Likewise: the triangle, as a number of the surfaces that are seen."""
    colors: Floats
    """(H, W, 3) in [0, 1]."""
    pixels: Floats
    """The same, (H W, 3)."""
    fragments: Fragments
    values: Floats
    """(3, VALUES)."""
    scratch: Scratch


class Canvas:
    """Room for pictures of one size, used again and again. samples: of a pixel along each side."""

    def __init__(self, size: tuple[int, int], samples: int) -> None:
        (width, height), self._room = size, _room_for(0)
        depths = np.empty((height * samples, width * samples), np.float32)
        colors = np.empty((height, width, 3), np.float32)
        self.sheet = Sheet(
            depths, np.empty(depths.shape, np.int32), colors, colors.reshape(-1, 3),
            room_for(width * ROWS), np.empty((3, VALUES), np.float32), scratch_for(size),
        )  # fmt: skip

    def image(self, drawn: Drawn, scene: Scene, over: Overlays) -> Image:
        """A picture (H, W, 3) of a town. The canvas has SAMPLES, see `fragments`."""
        image = np.empty(self.sheet.colors.shape, np.uint8)
        _image(self.sheet, self._room_of(drawn), drawn, scene, over, image)
        return image

    def classes(self, drawn: Drawn, scene: Scene) -> NDArray[np.uint8]:
        """What each pixel (H, W) of it shows, as numbers of `Semantic`. The canvas has one sample a pixel."""
        classes = np.zeros(self.sheet.shown.shape, np.uint8)
        _classes(self.sheet, self._room_of(drawn), drawn, scene, classes)
        return classes

    def distances(self, drawn: Drawn, scene: Scene) -> Floats:
        """How far away along the optical axis lies what each pixel (H, W) of it shows, m; the sky is kilometres away.
        The canvas has one sample a pixel."""
        _draw(self.sheet, self._room_of(drawn), drawn, scene)
        with np.errstate(divide="ignore"):
            return ONE / self.sheet.depths

    def _room_of(self, drawn: Drawn) -> Room:
        """Room for all triangles."""
        n = int(drawn.meshes.sizes[drawn.actors.meshes].sum()) + len(drawn.faces.triangles) + len(drawn.dome)
        if len(self._room.sources) < n:
            self._room = _room_for(2 * n)
        return self._room


def _room_for(n: int) -> Room:
    numbers = [np.empty(n, np.int32) for _ in range(4)]
    planes, flats = np.empty((n, 3 + 3 * VALUES), np.float32), np.empty((n, FLATS), np.float32)
    surfaces = Surfaces(numbers[0], planes, flats, numbers[1])
    return Room(np.empty((n, 3, 3), np.float32), np.empty((n, 2), np.int32), numbers[2], numbers[3], surfaces)


@compiled
def _image(sheet: Sheet, room: Room, drawn: Drawn, scene: Scene, over: Overlays, image: Image) -> None:
    """Draws an image (H, W, 3)."""
    _draw(sheet, room, drawn, scene)
    colors, light, view, scratch = sheet.colors, scene.light, scene.camera, sheet.scratch
    shade(sheet.shown, room.surfaces, scene, sheet.fragments, sheet.pixels)
    draw_shadows(colors, sheet.depths, drawn.actors.shadows, view.matrix, light, scratch)
    draw_lamps(colors, sheet.depths, over.lamps, view, scratch)
    if light.rain > ZERO:
        draw_rain(colors, over.drops, view.focal, over.time, light)
    for row in range(len(colors)):
        for column in range(colors.shape[1]):
            for c in range(3):
                image[row, column, c] = np.uint8(min(max(colors[row, column, c], ZERO), ONE) * f32(255) + HALF)


@compiled
def _draw(sheet: Sheet, room: Room, drawn: Drawn, scene: Scene) -> None:
    """Finds what each sample shows, in sheet.shown, and what that is made of."""
    n = _project(room.corners, room.sources, drawn, scene.camera)
    rasterise(room.corners, n, sheet.depths, sheet.shown, sheet.scratch.polygon)
    many = seen(sheet.shown, n, room.order, room.seen)
    _surfaces(many, room, drawn, scene, sheet)


@compiled
def _project(corners: Floats, sources: Integers, drawn: Drawn, view: View) -> int:
    """Writes the clip coordinates of all triangles, and what they are part of; returns how many."""
    town = project_actors(drawn.meshes, drawn.actors, view.matrix, corners, sources, 0)
    sky = project_town(drawn.faces, drawn.vertices.positions, view, corners, sources, town)
    n = _project_sky(drawn.dome, view.matrix, corners, sources, sky)
    for k in range(town, sky):
        sources[k, 0] = OF_TOWN
    for k in range(sky, n):
        sources[k, 0] = OF_SKY
    return n


@compiled
def _project_sky(dome: Floats, matrix: Floats, corners: Floats, sources: Integers, n: int) -> int:
    """Likewise the dome, so far away that it lies behind everything and moves with the eye."""
    for triangle in range(len(dome)):
        for k in range(3):
            x, y, z = dome[triangle, k, 0], dome[triangle, k, 1], dome[triangle, k, 2]
            for axis in range(3):
                corners[n, k, axis] = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z
        sources[n, 1] = i32(triangle)
        n += 1
    return n


@compiled
def _surfaces(many: int, room: Room, drawn: Drawn, scene: Scene, sheet: Sheet) -> None:
    """Writes what the triangles that are seen are made of.

    A source is an actor and a triangle of the meshes, OF_TOWN and a face, or OF_SKY and a triangle of the dome.
    """
    values, height, width = sheet.values, sheet.colors.shape[0], sheet.colors.shape[1]
    surfaces = room.surfaces
    for i in range(many):
        source, flat = room.sources[room.seen[i]], surfaces.flats[i]
        if source[0] >= 0:
            surfaces.kinds[i], surfaces.classes[i] = ACTOR, drawn.actors.classes[source[0]]
            actor_values(drawn.meshes, drawn.actors, source, scene.light, values, flat)
        elif source[0] == OF_TOWN:
            triangle = drawn.faces.triangles[source[1]]
            surfaces.classes[i] = drawn.vertices.traits[triangle[0], 3]
            if surfaces.classes[i] == ROAD_CLASS:
                surfaces.kinds[i] = ROAD
                road_values(drawn.vertices, triangle, values, flat)
            else:
                is_even = standing_values(drawn.vertices, triangle, scene.light, values, flat)
                surfaces.kinds[i] = EVEN if is_even else STANDING
        else:
            surfaces.kinds[i], surfaces.classes[i] = SKY, 0
            for k in range(3):
                values[k, 0], values[k, 1] = drawn.dome[source[1], k, 3], drawn.dome[source[1], k, 4]
        planes = surfaces.planes[i, : 3 + 3 * COUNTS[surfaces.kinds[i]]]
        make_planes(room.corners[room.seen[i]], values, width, height, planes)


@compiled
def _classes(sheet: Sheet, room: Room, drawn: Drawn, scene: Scene, out: NDArray[np.uint8]) -> None:
    """Writes the class (H, W) of each pixel of a sheet with one sample a pixel."""
    _draw(sheet, room, drawn, scene)
    shown, surfaces, widths = sheet.shown, room.surfaces, scene.materials.paint[WIDTHS]
    for row in range(shown.shape[0]):
        for column in range(shown.shape[1]):
            i = shown[row, column]
            if i < 0:
                continue
            out[row, column] = surfaces.classes[i]
            if surfaces.kinds[i] == ROAD:
                spot = Spot(f32(column), f32(row), ONE, ONE)
                spot = Spot(spot.column, spot.row, ONE / at(surfaces.planes[i], 0, spot), ONE)
                left, right, stop, _ = markings(surfaces.planes[i], surfaces.flats[i], widths, spot)
                if max(left, right, stop) > HALF:
                    out[row, column] = LINE_CLASS
