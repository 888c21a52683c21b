// The asphalt. uv and color: see scene/ground.py.
#include "blocks.glsl"

in vec3 position; in vec3 uv; in vec4 color;
out vec2 ground; out vec3 lane; flat out vec3 kinds; out vec4 place;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    ground = position.xy;
    lane = uv;
    kinds = color.rgb * vec3(255.0, 255.0, METRES_PER_COLOR);  // left line, right line, half width in m
    place = vec4((position.xy - shadow_area.xy) * shadow_area.zw, 0.0, 0.0);
}
