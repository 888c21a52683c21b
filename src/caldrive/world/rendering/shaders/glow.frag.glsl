#include "blocks.glsl"

in vec2 local; flat in vec3 glow; flat in float strength;
out vec4 pixel;
void main() {
    float r = 2.4 * length(local), rest = max(1.0 - r / 2.4, 0.0);
    if (strength < 1.0) { pixel = vec4(glow * strength * rest * rest, 0.0); return; }
    float core = clamp((1.05 - r) * 5.0, 0.0, 1.0);
    vec3 color = mix(glow, vec3(1.0), 0.35 * max(1.0 - 1.6 * r, 0.0));
    pixel = vec4(color * core + glow * 0.75 * rest * rest * (1.0 - core), core);
}
