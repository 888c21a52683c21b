#include "blocks.glsl"

uniform sampler2D drops;
in vec2 near_drops; in vec2 far_drops;
out vec4 pixel;
void main() {
    float streak = texture(drops, near_drops).r * 0.30 + texture(drops, far_drops).r * 0.22;
    pixel = vec4(mix(horizon.rgb, vec3(0.9), 0.4), streak * (0.35 + 0.65 * wet.z));
}
