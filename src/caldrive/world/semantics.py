"""What each pixel shows: the classes of the semantic image, and the shaders that draw it.

The image is drawn from the same triangles as the picture. In meshes of what stands still, a vertex's slot is its class.
"""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

from caldrive.world.meshes import Detail, Mesh
from caldrive.world.shaders import ACTOR_VERTEX, BLOCKS, ROAD_VERTEX, STRIPES


class Semantic(IntEnum):
    """Classes of pixels, as numbers in a recording."""

    SKY = 0
    ROAD = 1
    LINE = 2
    SIDEWALK = 3
    GROUND = 4
    BUILDING = 5
    PLANT = 6
    FURNITURE = 7
    LIGHT = 8
    SIGN = 9
    VEHICLE = 10
    PERSON = 11


# Of props; all others are furniture.
PROP_CLASSES = {"tree": Semantic.PLANT, "hedge": Semantic.PLANT, "light_post": Semantic.LIGHT}


def classed(mesh: Mesh, semantic: Semantic) -> Mesh:
    """The mesh with a class on all vertices that have none yet."""
    made = mesh.vertices.copy()
    made["slot"][made["slot"] == 0] = semantic
    return replace(mesh, vertices=made)


def classed_detail(detail: Detail, semantic: Semantic) -> Detail:
    """The same for all parts of a thing."""
    return Detail(*(classed(mesh, semantic) for mesh in (detail.always, detail.near, detail.far)))


STANDING_VERTEX = (
    BLOCKS
    + """
in vec3 position; in vec4 normal;
flat out float kind;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    kind = normal.w;
}
"""
)
STANDING_FRAGMENT = """#version 330 core
flat in float kind;
out vec4 pixel;
void main() { pixel = vec4(vec3(kind), 1.0); }
"""
ASPHALT_VERTEX = ROAD_VERTEX
ASPHALT_FRAGMENT = (
    BLOCKS
    + STRIPES
    + f"""
void main() {{
    vec3 footprint = max(fwidth(lane), vec3(1e-4));
    float left, right, stop;
    stripes(footprint, left, right, stop);
    pixel = vec4(vec3(max(left, max(right, stop)) > 0.5 ? {Semantic.LINE}.0 : {Semantic.ROAD}.0) / 255.0, 1.0);
}}
"""
)
ACTORS_VERTEX = ACTOR_VERTEX
ACTORS_FRAGMENT = """#version 330 core
uniform float kind;
out vec4 pixel;
void main() { pixel = vec4(vec3(kind / 255.0), 1.0); }
"""
