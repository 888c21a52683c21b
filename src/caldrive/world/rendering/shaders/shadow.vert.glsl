// A box's shadow: its footprint swept away from the sun as far as its height throws it, and the dark under it.
// stands: x, y, heading, height. extent: half length, half width, darkness underneath, height of the ground.
#include "blocks.glsl"

in vec2 corner; in vec4 stands; in vec4 extent;
out vec2 local; flat out vec2 sweep; flat out vec3 half_size; out vec4 place;
void main() {
    float c = cos(stands.z), s = sin(stands.z);
    vec2 thrown = -sun_direction.xy / sun_direction.z * stands.w;
    sweep = vec2(c * thrown.x + s * thrown.y, -s * thrown.x + c * thrown.y) + vec2(1e-4);
    half_size = extent.xyz;
    local = corner * (extent.xy + 0.3) + mix(vec2(0.0), sweep, greaterThan(corner * sweep, vec2(0.0)));
    vec2 ground = vec2(c * local.x - s * local.y, s * local.x + c * local.y) + stands.xy;
    gl_Position = view_projection * vec4(ground, extent.w, 1.0);
    place = vec4((ground - shadow_area.xy) * shadow_area.zw, 0.1, 0.0);
}
