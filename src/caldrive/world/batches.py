"""Meshes on the graphics side: a town's tiles, drawn as far as they are in view, and crowds of one mesh."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from caldrive.world.actors import INSTANCE, Instances
from caldrive.world.buildings import building_meshes
from caldrive.world.furniture import furniture_meshes
from caldrive.world.gl import gl_context, programs
from caldrive.world.ground import KERB_HEIGHT, far_kerb_mesh, kerb_mesh, road_mesh, yard_mesh
from caldrive.world.meshes import Mesh, Triangles
from caldrive.world.roads import RoadNetwork
from caldrive.world.scenery import Prop
from caldrive.world.tiles import Level, Tiles

_FORMAT = {"position": "3f", "uv": "3f", "normal": "4f1", "color": "4f1"}
_SKIPPED = {"position": "3x4", "uv": "3x4", "normal": "4x1", "color": "4x1"}
_PER_INSTANCE = ("4f 4f 4f1 4f1 4f1 4f1/i", "placed", "scale", "first", "second", "third", "fourth")


def vertex_array(
    program: moderngl.Program, data: moderngl.Buffer, wanted: tuple[str, ...], index: moderngl.Buffer,
    instances: moderngl.Buffer | None = None,
) -> moderngl.VertexArray:  # fmt: skip
    layout = " ".join(_FORMAT[name] if name in wanted else _SKIPPED[name] for name in _FORMAT)
    content: list[tuple[object, ...]] = [(data, layout, *(name for name in _FORMAT if name in wanted))]
    if instances is not None:
        content.append((instances, *_PER_INSTANCE))
    return gl_context().vertex_array(program, content, index_buffer=index, index_element_size=4)


class TownBatch:
    """A town's mesh, whose triangles are chosen anew for each picture."""

    def __init__(self, tiles: Tiles, program: moderngl.Program, layout: tuple[str, ...]) -> None:
        gl = gl_context()
        self.tiles = tiles
        self.index = gl.buffer(reserve=max(4, tiles.faces.triangles.nbytes), dynamic=True)
        self.data = gl.buffer(np.ascontiguousarray(tiles.vertices).tobytes())
        self.array = vertex_array(program, self.data, layout, self.index)

    def draw(self, triangles: Triangles) -> None:
        self.index.write(triangles)
        self.array.render(vertices=triangles.size)


class Crowd:
    """Instances of one mesh."""

    def __init__(self, mesh: Mesh, most: int = 1024) -> None:
        gl = gl_context()
        self.most = most
        self.buffer = gl.buffer(reserve=most * INSTANCE.itemsize, dynamic=True)
        data, index = gl.buffer(mesh.vertices.tobytes()), gl.buffer(mesh.triangles.tobytes())
        self.array = vertex_array(programs().actor, data, ("position", "normal", "color"), index, self.buffer)

    def draw(self, instances: Instances) -> None:
        n = min(len(instances), self.most)
        if n:
            self.buffer.write(np.ascontiguousarray(instances[:n]))
            self.array.render(instances=n)


def town_batches(roads: RoadNetwork, scenery: Sequence[Prop]) -> tuple[TownBatch, TownBatch]:
    """A town's asphalt, and everything else that stands still."""
    houses = building_meshes(scenery, roads.style)
    furniture = furniture_meshes(scenery, roads.style, KERB_HEIGHT)
    asphalt = Tiles([(road_mesh(roads), Level.ALWAYS)])
    standing = Tiles([
        (houses.always, Level.ALWAYS), (houses.near, Level.NEAR), (houses.far, Level.FAR),
        (furniture.always, Level.ALWAYS), (furniture.near, Level.NEAR), (furniture.far, Level.FAR),
        (kerb_mesh(roads), Level.NEAR), (far_kerb_mesh(roads), Level.ALWAYS), (yard_mesh(roads), Level.ALWAYS),
    ])  # fmt: skip
    made = programs()
    return (
        TownBatch(asphalt, made.road, ("position", "uv", "color")),
        TownBatch(standing, made.static, ("position", "uv", "normal", "color")),
    )
