"""GLSL that draws classes instead of colours, from the same triangles as the picture."""

from __future__ import annotations

from caldrive.datatypes import Semantic
from caldrive.world.rendering.shaders import BLOCKS, STRIPES

STATIC_KIND_VERTEX = (
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

STATIC_KIND = """#version 330 core
flat in float kind;
out vec4 pixel;
void main() { pixel = vec4(vec3(kind), 1.0); }
"""
ROAD_KIND = (
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

ACTOR_KIND = """#version 330 core
uniform float kind;
out vec4 pixel;
void main() { pixel = vec4(vec3(kind / 255.0), 1.0); }
"""
