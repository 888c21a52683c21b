"""GLSL sources. All programs share two blocks: Frame (per picture) and Look (per weather and town)."""

from __future__ import annotations

from caldrive.datatypes import Semantic

BLOCKS = """#version 330 core
layout(std140) uniform Frame {
    mat4 view_projection;
    vec4 eye;            // position, time in s
    vec4 lens;           // width, height and focal length in pixels, seed of the rain
};
layout(std140) uniform Look {
    vec4 sun_direction; vec4 sun; vec4 sky_ambient; vec4 ground_ambient;
    vec4 horizon;        // colour, fog density per m
    vec4 zenith;
    vec4 wet;            // wetness, puddles, rain
    vec4 shadow_area;    // x, y of its corner, 1 / width, 1 / height
};
"""
LIGHT = """
uniform sampler2D shadows;
float sunshine(vec4 place) {  // 1 in the sun, 0 in the shade; place: xy on the shadow picture, z, which of its channels
    vec2 height = 32.0 * texture(shadows, place.xy).rg;
    return clamp((place.z - mix(height.r, height.g, place.w)) * 2.0 + 1.0, 0.0, 1.0);
}
vec3 hazy(vec3 color) {
    float depth = horizon.w / gl_FragCoord.w;
    return mix(horizon.rgb, color, 1.0 / (1.0 + depth * depth));
}
"""
STATIC_VERTEX = (
    BLOCKS
    + f"const int SIGN = {Semantic.SIGN};"
    + """
in vec3 position; in vec3 uv; in vec4 normal; in vec4 color;
out vec3 lit; out vec3 sunlit; out vec3 cell; out vec4 place;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 n = (normal.xyz * 255.0 - 128.0) / 127.0;
    vec3 albedo = color.rgb * (n.z > 0.9 && position.z < 0.3 ? 1.0 - 0.3 * wet.x : 1.0 - 0.08 * wet.x);
    lit = albedo * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z);
    sunlit = albedo * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
    cell = uv;
    if (int(normal.w * 255.0 + 0.5) == SIGN) {  // signs throw the headlamps' light back
        lit = max(lit, 0.80 * albedo);
        sunlit *= 0.4;
    }
    place = vec4((position.xy + 0.8 * color.w * n.xy - shadow_area.xy) * shadow_area.zw, position.z, color.w);
}
"""
)

STATIC_FRAGMENT = (
    BLOCKS
    + LIGHT
    + """
uniform sampler2DArray layers;
in vec3 lit; in vec3 sunlit; in vec3 cell; in vec4 place;
out vec4 pixel;
void main() {
    vec3 albedo = texture(layers, cell, -0.6).rgb;
    pixel = vec4(hazy(albedo * (lit + sunlit * sunshine(place))), 1.0);
}
"""
)

ROAD_VERTEX = (
    BLOCKS
    + """
in vec3 position; in vec3 uv; in vec4 color;
out vec2 ground; out vec3 lane; flat out vec3 kinds; out vec4 place;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    ground = position.xy;
    lane = uv;
    kinds = color.rgb * vec3(255.0, 255.0, 5.1);
    place = vec4((position.xy - shadow_area.xy) * shadow_area.zw, 0.0, 0.0);
}
"""
)

# A line covers as much of a pixel as the pixel's width on the road overlaps it: far lines fade and do not flicker.
STRIPES = """
uniform vec4 widths;     // half widths of centre and edge line, inset of the edge line, share of a dash
in vec2 ground; in vec3 lane; flat in vec3 kinds; in vec4 place;
out vec4 pixel;
float stripe(float at, float footprint, float middle, float half_width) {
    float low = max(at - 0.5 * footprint, middle - half_width), high = min(at + 0.5 * footprint, middle + half_width);
    return clamp((high - low) / footprint, 0.0, 1.0);
}
void stripes(vec3 footprint, out float left, out float right, out float stop) {
    float dash = stripe(fract(lane.y), footprint.y, 0.5, 0.5 * widths.w);
    dash = mix(dash, widths.w, clamp(2.0 * footprint.y - 0.6, 0.0, 1.0));
    float broken = kinds.x == 4.0 || kinds.x == 2.0 ? 1.0 : dash;
    float inset = kinds.x == 2.0 ? widths.z : 0.0;
    left = kinds.x > 0.0 ? broken * stripe(lane.x, footprint.x, kinds.z - inset, widths.x) : 0.0;
    right = kinds.y == 2.0 ? stripe(lane.x, footprint.x, widths.z - kinds.z, widths.y) : 0.0;
    stop = stripe(lane.z, footprint.z, 0.6, 0.25);
}
"""
ROAD_FRAGMENT = (
    BLOCKS
    + LIGHT
    + STRIPES
    + """
uniform sampler2DArray layers;
uniform vec3 center_color; uniform vec3 edge_color; uniform vec3 asphalt;
void main() {
    vec3 footprint = max(fwidth(lane), vec3(1e-4));
    float fine = texture(layers, vec3(ground * 0.14, 1.0)).r, coarse = texture(layers, vec3(ground.yx * 0.019, 1.0)).r;
    float track = clamp(1.0 - 2.2 * abs(abs(lane.x) - 0.85), 0.0, 1.0) * (kinds.z < 4.9 ? 0.09 : 0.0);
    vec3 albedo = asphalt * fine * (0.45 + 0.7 * coarse) * (1.0 - track);

    float wear = 0.55 + 0.5 * fine, left, right, stop;
    stripes(footprint, left, right, stop);
    albedo = mix(albedo, kinds.x == 2.0 || kinds.x == 3.0 ? edge_color : center_color, left * wear);
    albedo = mix(albedo, edge_color, max(right, stop) * wear);

    float shine = sunshine(place);
    if (wet.x > 0.0) {
        vec3 view = vec3(ground, 0.0) - eye.xyz;
        view *= inversesqrt(dot(view, view));
        float puddle = clamp((texture(layers, vec3(ground * 0.043, 1.0)).r + 0.42 * wet.y - 0.96) * 14.0, 0.0, 1.0);
        float steep = 1.0 + view.z, fresnel = 0.03 + 0.97 * steep * steep * steep * steep * steep;
        float mirror = fresnel * (0.50 * wet.x + 0.35 * puddle);
        float glint = max(dot(vec3(view.xy, -view.z), sun_direction.xyz), 0.0);
        glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint;
        vec3 sky = mix(horizon.rgb, zenith.rgb, clamp(-2.5 * view.z, 0.0, 1.0)) + glint * sun.rgb * shine;
        albedo *= 1.0 - 0.30 * wet.x - 0.15 * puddle;
        vec3 color = albedo * (sky_ambient.rgb + sun.rgb * sun_direction.z * shine);
        pixel = vec4(hazy(mix(color, sky, mirror)), 1.0);
    } else {
        pixel = vec4(hazy(albedo * (sky_ambient.rgb + sun.rgb * sun_direction.z * shine)), 1.0);
    }
}
"""
)

ACTOR_VERTEX = (
    BLOCKS
    + """
in vec3 position; in vec4 normal; in vec4 color;
in vec4 placed; in vec4 scale; in vec4 first; in vec4 second; in vec4 third; in vec4 fourth;
out vec3 lit; out vec3 sunlit; out vec4 place;
void main() {
    int slot = int(normal.w * 255.0 + 0.5), limb = int(color.w * 255.0 + 0.5);
    vec3 p = position, n = (normal.xyz * 255.0 - 128.0) / 127.0;
    if (limb > 0 && limb < 5) {  // legs and arms swing about hip and shoulder, opposite ones together
        float pivot = limb < 3 ? 0.88 : 1.42;
        float angle = (limb == 1 || limb == 4 ? scale.w : -scale.w) * sin(placed.w);
        float c = cos(angle), s = sin(angle), x = p.x, z = p.z - pivot;
        p.x = c * x - s * z;
        p.z = s * x + c * z + pivot;
        n.xz = vec2(c * n.x - s * n.z, s * n.x + c * n.z);
    }
    p *= scale.xyz;
    float c = cos(placed.z), s = sin(placed.z);
    vec3 world = vec3(c * p.x - s * p.y + placed.x, s * p.x + c * p.y + placed.y, p.z + 0.12 * fourth.w);
    n = vec3(c * n.x - s * n.y, s * n.x + c * n.y, n.z);
    gl_Position = view_projection * vec4(world, 1.0);
    vec3 own = slot == 1 ? first.rgb : slot == 2 ? second.rgb : slot == 3 ? third.rgb : fourth.rgb;
    vec3 albedo = slot > 0 && slot < 5 ? own * color.rgb : color.rgb;
    float gloss = slot == 5 ? 0.30 : slot == 1 && limb == 0 && fourth.rgb == vec3(0.0) ? 0.12 : 0.0;
    lit = albedo * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z);
    lit += gloss * horizon.rgb * (0.35 + 0.65 * max(n.z, 0.0));
    sunlit = albedo * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
    if (limb == 8) { lit = albedo; sunlit = vec3(0.0); }
    place = vec4((placed.xy - shadow_area.xy) * shadow_area.zw, p.z, 0.0);
}
"""
)

ACTOR_FRAGMENT = (
    BLOCKS
    + LIGHT
    + """
in vec3 lit; in vec3 sunlit; in vec4 place;
out vec4 pixel;
void main() { pixel = vec4(hazy(lit + sunlit * sunshine(place)), 1.0); }
"""
)
