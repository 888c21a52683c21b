// Two layers of streaks over the whole picture, that move with the time.
#include "blocks.glsl"

in vec2 corner;
out vec2 near_drops; out vec2 far_drops;
void main() {
    gl_Position = vec4(corner, 0.0, 1.0);
    vec2 p = corner * vec2(lens.x / lens.z, -lens.y / lens.z) * 0.5;
    near_drops = p * vec2(0.9, 0.5) + vec2(lens.w, 2.7 * eye.w + 3.0 * lens.w);
    far_drops = p * vec2(1.9, 0.9) + vec2(0.31 + 2.0 * lens.w, 1.9 * eye.w + lens.w);
}
