"""Meshes on the graphics side: a town's tiles, drawn as far as they are in view, and crowds of one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import moderngl
import numpy as np

from caldrive.datatypes import Semantic
from caldrive.world.rendering.actors import INSTANCE, Instances
from caldrive.world.rendering.gl import gl_context
from caldrive.world.rendering.programs import Programs, SemanticPrograms, programs, semantic_programs
from caldrive.world.rendering.visibility import Level, Tiles
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.buildings import building_meshes
from caldrive.world.scene.decor import Decor
from caldrive.world.scene.furniture import furniture_meshes
from caldrive.world.scene.ground import KERB_HEIGHT, far_kerb_mesh, kerb_mesh, road_mesh, yard_mesh
from caldrive.world.scene.meshes import Mesh, Triangles, classed, classed_detail
from caldrive.world.scene.scenery import Prop

# Attributes with their format, and the padding where a program has no use for them.
_VERTEX = {"position": ("3f", "3x4"), "uv": ("3f", "3x4"), "normal": ("4f1", "4x1"), "color": ("4f1", "4x1")}
_INSTANCE = {
    "placed": ("4f", "4x4"), "scale": ("4f", "4x4"),
    "first": ("4f1", "4x1"), "second": ("4f1", "4x1"), "third": ("4f1", "4x1"), "fourth": ("4f1", "4x1"),
}  # fmt: skip


def vertex_array(
    program: moderngl.Program, data: moderngl.Buffer, index: moderngl.Buffer, instances: moderngl.Buffer | None = None
) -> moderngl.VertexArray:
    """Triangles for a program, which takes of the vertices and instances what it has a use for."""

    def content(buffer: moderngl.Buffer, table: dict[str, tuple[str, str]], each: str = "") -> tuple[object, ...]:
        layout = " ".join(used if name in program else skipped for name, (used, skipped) in table.items())
        return (buffer, layout + each, *(name for name in table if name in program))

    both = [content(data, _VERTEX)] + ([] if instances is None else [content(instances, _INSTANCE, "/i")])
    return gl_context().vertex_array(program, both, index_buffer=index, index_element_size=4)


class TownBatch:
    """A town's mesh, whose triangles are chosen anew for each picture. kind: the name of its programs."""

    def __init__(self, tiles: Tiles, kind: str) -> None:
        gl = gl_context()
        self.tiles, self.kind = tiles, kind
        self.index = gl.buffer(reserve=max(4, tiles.faces.triangles.nbytes), dynamic=True)
        self.data = gl.buffer(np.ascontiguousarray(tiles.vertices).tobytes())
        self.array = self._array(programs())

    def _array(self, made: Programs | SemanticPrograms) -> moderngl.VertexArray:
        return vertex_array(getattr(made, self.kind), self.data, self.index)

    @cached_property
    def semantic(self) -> moderngl.VertexArray:
        return self._array(semantic_programs())

    def draw(self, triangles: Triangles, semantic: bool = False) -> None:
        self.index.write(triangles)
        (self.semantic if semantic else self.array).render(vertices=triangles.size)


class Crowd:
    """Instances of one mesh."""

    def __init__(self, mesh: Mesh, most: int = 1024) -> None:
        gl = gl_context()
        self.most = most
        self.buffer = gl.buffer(reserve=most * INSTANCE.itemsize, dynamic=True)
        self.data, self.index = gl.buffer(mesh.vertices.tobytes()), gl.buffer(mesh.triangles.tobytes())
        self.array = self._array(programs())

    def _array(self, made: Programs | SemanticPrograms) -> moderngl.VertexArray:
        return vertex_array(made.actor, self.data, self.index, self.buffer)

    @cached_property
    def semantic(self) -> moderngl.VertexArray:
        return self._array(semantic_programs())

    def draw(self, instances: Instances, semantic: bool = False) -> None:
        n = min(len(instances), self.most)
        if n:
            self.buffer.write(np.ascontiguousarray(instances[:n]))
            (self.semantic if semantic else self.array).render(instances=n)


def town_batches(roads: RoadNetwork, scenery: Sequence[Prop], decor: Decor) -> tuple[TownBatch, TownBatch]:
    """A town's asphalt, and everything else that stands still."""
    houses = classed_detail(building_meshes(scenery, decor), Semantic.BUILDING)
    furniture = furniture_meshes(scenery, decor, KERB_HEIGHT)
    asphalt = Tiles([(road_mesh(roads, decor.ground), Level.ALWAYS)])
    standing = Tiles([
        (houses.always, Level.ALWAYS), (houses.near, Level.NEAR), (houses.far, Level.FAR),
        (furniture.always, Level.ALWAYS), (furniture.near, Level.NEAR), (furniture.far, Level.FAR),
        (classed(kerb_mesh(roads, decor.ground), Semantic.SIDEWALK), Level.NEAR),
        (classed(far_kerb_mesh(roads, decor.ground), Semantic.SIDEWALK), Level.ALWAYS),
        (classed(yard_mesh(roads, decor.ground), Semantic.GROUND), Level.ALWAYS),
    ])  # fmt: skip
    return TownBatch(asphalt, "road"), TownBatch(standing, "static")
