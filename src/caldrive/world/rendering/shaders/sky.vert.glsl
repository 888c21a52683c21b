// The sky's dome: it moves with the eye, and lies behind everything.
#include "blocks.glsl"

in vec3 position; in vec3 uv;
out vec2 cell;
void main() {
    cell = uv.xy;
    gl_Position = (view_projection * vec4(position + vec3(eye.xy, 0.0), 1.0)).xyww;
}
