"""GLSL sources. All programs share the Frame block (per picture) and the Look block (per weather)."""

from __future__ import annotations

BLOCKS = """#version 330 core
layout(std140) uniform Frame { mat4 view_projection; vec4 eye; };
layout(std140) uniform Look {
    vec4 sun_direction; vec4 sun; vec4 sky_ambient; vec4 ground_ambient; vec4 horizon; vec4 zenith; vec4 wet;
};
"""

STATIC_VERTEX = BLOCKS + """
in vec3 position; in vec3 uv; in vec4 normal; in vec4 color;
out vec3 lit; out vec3 sunlit;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 n = (normal.xyz * 255.0 - 128.0) / 127.0;
    lit = color.rgb * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z);
    sunlit = color.rgb * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
}
"""

STATIC_FRAGMENT = BLOCKS + """
in vec3 lit; in vec3 sunlit;
out vec4 pixel;
void main() {
    float depth = horizon.w / gl_FragCoord.w;
    float clear = 1.0 / (1.0 + depth * depth);
    pixel = vec4(mix(horizon.rgb, lit + sunlit, clear), 1.0);
}
"""
