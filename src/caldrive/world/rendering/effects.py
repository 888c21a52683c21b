"""GLSL sources of what lies over the solid things: shadows of cars and people, lit lamps, sky and rain."""

from __future__ import annotations

from caldrive.world.rendering.shaders import BLOCKS, LIGHT

# A box's shadow: its footprint swept away from the sun as far as its height throws it, and the dark under it.
SHADOW_VERTEX = (
    BLOCKS
    + """
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
"""
)

SHADOW_FRAGMENT = (
    BLOCKS
    + LIGHT
    + """
in vec2 local; flat in vec2 sweep; flat in vec3 half_size; in vec4 place;
out vec4 pixel;
void main() {
    vec2 a = (local - half_size.xy) / sweep, b = (local + half_size.xy) / sweep;
    vec2 low = min(a, b), high = max(a, b);
    float inside = min(min(high.x, high.y), 1.0) - max(max(low.x, low.y), 0.0);
    float direct = dot(sun.rgb, vec3(0.33)) * sun_direction.z, sky = dot(sky_ambient.rgb, vec3(0.33));
    float swept = clamp(inside * length(sweep) * 4.0, 0.0, 1.0) * direct / (direct + sky) * sunshine(place);
    vec2 beyond = max(abs(local) - half_size.xy + 0.15, 0.0);
    float under = half_size.z * clamp(1.0 - dot(beyond, beyond) * 5.0, 0.0, 1.0);
    float depth = horizon.w / gl_FragCoord.w;
    pixel = vec4(0.0, 0.0, 0.0, max(swept, under) / (1.0 + depth * depth));
}
"""
)

# A lit lamp, for those before it: a lens with a halo, never smaller than a pixel or so; on a wet road also its streak.
GLOW_VERTEX = (
    BLOCKS
    + """
in vec2 corner; in vec4 lamp; in vec4 tint;
out vec2 local; flat out vec3 glow; flat out float strength;
void main() {
    float away = distance(eye.xyz, lamp.xyz), radius = 0.155;
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
"""
)

GLOW_FRAGMENT = (
    BLOCKS
    + """
in vec2 local; flat in vec3 glow; flat in float strength;
out vec4 pixel;
void main() {
    float r = 2.4 * length(local), rest = max(1.0 - r / 2.4, 0.0);
    if (strength < 1.0) { pixel = vec4(glow * strength * rest * rest, 0.0); return; }
    float core = clamp((1.05 - r) * 5.0, 0.0, 1.0);
    vec3 color = mix(glow, vec3(1.0), 0.35 * max(1.0 - 1.6 * r, 0.0));
    pixel = vec4(color * core + glow * 0.75 * rest * rest * (1.0 - core), core);
}
"""
)

SKY_VERTEX = (
    BLOCKS
    + """
in vec3 position; in vec3 uv;
out vec2 cell;
void main() {
    cell = uv.xy;
    gl_Position = (view_projection * vec4(position + vec3(eye.xy, 0.0), 1.0)).xyww;
}
"""
)

SKY_FRAGMENT = """#version 330 core
uniform sampler2D panorama;
in vec2 cell;
out vec4 pixel;
void main() { pixel = vec4(texture(panorama, cell).rgb, 1.0); }
"""
RAIN_VERTEX = (
    BLOCKS
    + """
in vec2 corner;
out vec2 near_drops; out vec2 far_drops;
void main() {
    gl_Position = vec4(corner, 0.0, 1.0);
    vec2 p = corner * vec2(lens.x / lens.z, -lens.y / lens.z) * 0.5;
    near_drops = p * vec2(0.9, 0.5) + vec2(lens.w, 2.7 * eye.w + 3.0 * lens.w);
    far_drops = p * vec2(1.9, 0.9) + vec2(0.31 + 2.0 * lens.w, 1.9 * eye.w + lens.w);
}
"""
)

RAIN_FRAGMENT = (
    BLOCKS
    + """
uniform sampler2D drops;
in vec2 near_drops; in vec2 far_drops;
out vec4 pixel;
void main() {
    float streak = texture(drops, near_drops).r * 0.30 + texture(drops, far_drops).r * 0.22;
    pixel = vec4(mix(horizon.rgb, vec3(0.9), 0.4), streak * (0.35 + 0.65 * wet.z));
}
"""
)
