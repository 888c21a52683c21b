"""Meshes on the graphics side: a town's, of which each picture draws what is in view, and instances of one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import moderngl
import numpy as np

from caldrive.datatypes import Semantic
from caldrive.world.rendering.actors import INSTANCE, Instances
from caldrive.world.rendering.gl import gl_context
from caldrive.world.rendering.programs import Programs, SemanticPrograms, programs, semantic_programs
from caldrive.world.rendering.tiles import DetailLevel, TileGrid
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.appearance import Appearance
from caldrive.world.scene.buildings import building_meshes
from caldrive.world.scene.furniture import furniture_meshes
from caldrive.world.scene.ground import KERB_HEIGHT, far_kerb_mesh, kerb_mesh, road_mesh, yard_mesh
from caldrive.world.scene.meshes import Mesh, Triangles, lod_with_class, with_class
from caldrive.world.scene.scenery import Prop

MOST_INSTANCES = 1024  # of one mesh in a picture; the others are left out

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

    buffers = [content(data, _VERTEX)] + ([] if instances is None else [content(instances, _INSTANCE, "/i")])
    return gl_context().vertex_array(program, buffers, index_buffer=index, index_element_size=4)


class _Arrays:
    """One mesh for the programs of its kind: that of the colours and, once it is asked for, that of the classes."""

    def __init__(self, kind: str, *buffers: moderngl.Buffer) -> None:
        self._kind, self._buffers = kind, buffers
        self._colors = self._of(programs())

    def _of(self, owner: Programs | SemanticPrograms) -> moderngl.VertexArray:
        return vertex_array(getattr(owner, self._kind), *self._buffers)

    @cached_property
    def _classes(self) -> moderngl.VertexArray:
        return self._of(semantic_programs())

    def render(self, semantic: bool, *, vertices: int = -1, instances: int = -1) -> None:
        """Draws so many vertices or instances; semantic: classes instead of colours."""
        (self._classes if semantic else self._colors).render(vertices=vertices, instances=instances)


class TownMesh:
    """A part of a town, of whose triangles each picture draws those in view. kind: the name of its programs."""

    def __init__(self, grid: TileGrid, kind: str) -> None:
        gl = gl_context()
        self.grid = grid
        self._index = gl.buffer(reserve=max(4, grid.faces.triangles.nbytes), dynamic=True)
        self._arrays = _Arrays(kind, gl.buffer(np.ascontiguousarray(grid.vertices).tobytes()), self._index)

    def draw(self, triangles: Triangles, semantic: bool = False) -> None:
        """Draws some triangles (N, 3) of the grid; semantic: classes instead of colours."""
        self._index.write(triangles)
        self._arrays.render(semantic, vertices=triangles.size)


class InstancedMesh:
    """One mesh that is drawn many times in a picture."""

    def __init__(self, mesh: Mesh) -> None:
        gl = gl_context()
        self._instances = gl.buffer(reserve=MOST_INSTANCES * INSTANCE.itemsize, dynamic=True)
        data, index = gl.buffer(mesh.vertices.tobytes()), gl.buffer(mesh.triangles.tobytes())
        self._arrays = _Arrays("actor", data, index, self._instances)

    def draw(self, instances: Instances, semantic: bool = False) -> None:
        """Draws the first MOST_INSTANCES of some instances (N,); semantic: classes instead of colours."""
        n = min(len(instances), MOST_INSTANCES)
        if n:
            self._instances.write(np.ascontiguousarray(instances[:n]))
            self._arrays.render(semantic, instances=n)


def town_meshes(roads: RoadNetwork, scenery: Sequence[Prop], appearance: Appearance) -> tuple[TownMesh, TownMesh]:
    """A town's asphalt, and everything else that stands still."""
    houses = lod_with_class(building_meshes(scenery, appearance), Semantic.BUILDING)
    furniture = furniture_meshes(scenery, appearance, foot=KERB_HEIGHT)
    ground = appearance.ground
    asphalt = TileGrid([(road_mesh(roads, ground), DetailLevel.ALWAYS)])
    standing = TileGrid([
        (houses.always, DetailLevel.ALWAYS), (houses.near, DetailLevel.NEAR), (houses.far, DetailLevel.FAR),
        (furniture.always, DetailLevel.ALWAYS), (furniture.near, DetailLevel.NEAR), (furniture.far, DetailLevel.FAR),
        (with_class(kerb_mesh(roads, ground), Semantic.SIDEWALK), DetailLevel.NEAR),
        (with_class(far_kerb_mesh(roads, ground), Semantic.SIDEWALK), DetailLevel.ALWAYS),
        (with_class(yard_mesh(roads, ground), Semantic.GROUND), DetailLevel.ALWAYS),
    ])  # fmt: skip
    return TownMesh(asphalt, "road"), TownMesh(standing, "static")
