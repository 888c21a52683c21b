// A lit lamp, for those before it: a lens with a halo, never smaller than a pixel or so; on a wet road also its streak.
// lamp: x, y, z, heading of the traffic that it faces. tint: colour, and 1 for a streak.
#include "blocks.glsl"

in vec2 corner; in vec4 lamp; in vec4 tint;
out vec2 local; flat out vec3 glow; flat out float strength;
void main() {
    float away = distance(eye.xyz, lamp.xyz), radius = LAMP_RADIUS;
    float behind = step(0.0, dot(eye.xy - lamp.xy, vec2(cos(lamp.w), sin(lamp.w))));
    vec3 world;
    if (tint.w > 0.5) {
        vec2 foot = mix(eye.xy, lamp.xy, 0.55);
        vec2 along = normalize(lamp.xy - eye.xy), across = vec2(-along.y, along.x);
        world = vec3(foot + along * corner.y * 0.36 * away - across * corner.x * 0.26, 0.03);
        strength = 0.40 * wet.x * (1.0 - behind);
    } else {
        float size = 2.4 * clamp(1.25 * away / lens.z, radius, 2.2 * radius) * (1.0 - behind);
        world = lamp.xyz + size * vec3(corner.x * sin(lamp.w), -corner.x * cos(lamp.w), corner.y);
        strength = 1.0;
    }
    local = corner;
    glow = tint.rgb;
    gl_Position = view_projection * vec4(world, 1.0);
}
