"""GLSL sources. All programs share two blocks: Frame (per picture) and Look (per weather and town)."""

from __future__ import annotations

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

_LIGHT = """
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

STATIC_VERTEX = BLOCKS + """
in vec3 position; in vec3 uv; in vec4 normal; in vec4 color;
out vec3 lit; out vec3 sunlit; out vec3 cell; out vec4 place;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 n = (normal.xyz * 255.0 - 128.0) / 127.0;
    vec3 albedo = color.rgb * (n.z > 0.9 && position.z < 0.3 ? 1.0 - 0.3 * wet.x : 1.0 - 0.08 * wet.x);
    lit = albedo * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z);
    sunlit = albedo * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
    cell = uv;
    place = vec4((position.xy + 0.8 * color.w * n.xy - shadow_area.xy) * shadow_area.zw, position.z, color.w);
}
"""

STATIC_FRAGMENT = BLOCKS + _LIGHT + """
uniform sampler2DArray layers;
in vec3 lit; in vec3 sunlit; in vec3 cell; in vec4 place;
out vec4 pixel;
void main() {
    vec3 albedo = texture(layers, cell).rgb;
    pixel = vec4(hazy(albedo * (lit + sunlit * sunshine(place))), 1.0);
}
"""

ROAD_VERTEX = BLOCKS + """
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

# A line covers as much of a pixel as the pixel's width on the road overlaps it: no flicker, and far lines fade as they should.
ROAD_FRAGMENT = BLOCKS + _LIGHT + """
uniform sampler2DArray layers;
uniform vec3 center_color; uniform vec3 edge_color; uniform vec3 asphalt;
uniform vec4 widths;     // half widths of centre and edge line, distance of the edge line from the edge, share of a dash
in vec2 ground; in vec3 lane; flat in vec3 kinds; in vec4 place;
out vec4 pixel;
float stripe(float at, float footprint, float middle, float half_width) {
    float low = max(at - 0.5 * footprint, middle - half_width), high = min(at + 0.5 * footprint, middle + half_width);
    return clamp((high - low) / footprint, 0.0, 1.0);
}
void main() {
    vec3 footprint = max(fwidth(lane), vec3(1e-4));
    float fine = texture(layers, vec3(ground * 0.14, 1.0)).r, coarse = texture(layers, vec3(ground.yx * 0.019, 1.0)).r;
    float track = clamp(1.0 - 2.2 * abs(abs(lane.x) - 0.85), 0.0, 1.0) * (kinds.z < 4.9 ? 0.09 : 0.0);
    vec3 albedo = asphalt * fine * (0.45 + 0.7 * coarse) * (1.0 - track);

    float wear = 0.55 + 0.5 * fine;
    float dash = stripe(fract(lane.y), footprint.y, 0.5, 0.5 * widths.w);
    dash = mix(dash, widths.w, clamp(2.0 * footprint.y - 0.6, 0.0, 1.0));
    float broken = kinds.x == 4.0 || kinds.x == 2.0 ? 1.0 : dash;
    float inset = kinds.x == 2.0 ? widths.z : 0.0;
    float left = kinds.x > 0.0 ? broken * stripe(lane.x, footprint.x, kinds.z - inset, widths.x) : 0.0;
    albedo = mix(albedo, kinds.x == 2.0 || kinds.x == 3.0 ? edge_color : center_color, left * wear);
    float right = kinds.y == 2.0 ? stripe(lane.x, footprint.x, widths.z - kinds.z, widths.y) : 0.0;
    float stop = stripe(lane.z, footprint.z, 0.6, 0.25);
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
        albedo *= 1.0 - 0.38 * wet.x - 0.15 * puddle;
        vec3 color = albedo * (sky_ambient.rgb + sun.rgb * sun_direction.z * shine);
        pixel = vec4(hazy(mix(color, sky, mirror)), 1.0);
    } else {
        pixel = vec4(hazy(albedo * (sky_ambient.rgb + sun.rgb * sun_direction.z * shine)), 1.0);
    }
}
"""

ACTOR_VERTEX = BLOCKS + """
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
    vec3 albedo = slot == 1 ? first.rgb : slot == 2 ? second.rgb : slot == 3 ? third.rgb : slot == 4 ? fourth.rgb : vec3(1.0);
    albedo *= color.rgb;
    float gloss = slot == 5 ? 0.30 : slot == 1 && limb == 0 && fourth.rgb == vec3(0.0) ? 0.12 : 0.0;
    lit = albedo * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z) + gloss * horizon.rgb * (0.35 + 0.65 * max(n.z, 0.0));
    sunlit = albedo * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
    if (limb == 8) { lit = albedo; sunlit = vec3(0.0); }
    place = vec4((placed.xy - shadow_area.xy) * shadow_area.zw, p.z, 0.0);
}
"""

ACTOR_FRAGMENT = BLOCKS + _LIGHT + """
in vec3 lit; in vec3 sunlit; in vec4 place;
out vec4 pixel;
void main() { pixel = vec4(hazy(lit + sunlit * sunshine(place)), 1.0); }
"""

# A box's shadow: its footprint swept away from the sun as far as its height throws it, and the dark under it.
SHADOW_VERTEX = BLOCKS + """
in vec2 corner; in vec4 stands; in vec4 extent;
out vec2 local; flat out vec2 sweep; flat out vec3 half_size; out vec4 place;
void main() {
    float c = cos(stands.z), s = sin(stands.z);
    vec2 thrown = -sun_direction.xy / sun_direction.z * stands.w;
    sweep = vec2(c * thrown.x + s * thrown.y, -s * thrown.x + c * thrown.y) + vec2(1e-4);
    half_size = extent.xyz;
    local = corner * (extent.xy + 0.3) + vec2(corner.x * sweep.x > 0.0 ? sweep.x : 0.0, corner.y * sweep.y > 0.0 ? sweep.y : 0.0);
    vec2 ground = vec2(c * local.x - s * local.y, s * local.x + c * local.y) + stands.xy;
    gl_Position = view_projection * vec4(ground, extent.w, 1.0);
    place = vec4((ground - shadow_area.xy) * shadow_area.zw, 0.1, 0.0);
}
"""

SHADOW_FRAGMENT = BLOCKS + _LIGHT + """
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

# A lit lamp: a lens with a halo, never smaller than a pixel or so; on a wet road also its streak.
GLOW_VERTEX = BLOCKS + """
in vec2 corner; in vec4 lamp; in vec4 tint;
out vec2 local; flat out vec3 glow; flat out float strength;
void main() {
    float away = distance(eye.xyz, lamp.xyz), radius = 0.155;
    vec3 world;
    if (tint.w > 0.5) {
        vec2 foot = mix(eye.xy, lamp.xy, eye.z / (eye.z + lamp.z));
        vec2 along = normalize(lamp.xy - eye.xy), across = vec2(-along.y, along.x);
        world = vec3(foot + along * corner.y * 0.16 * away - across * corner.x * 0.32, 0.03);
        strength = 0.55 * wet.x;
    } else {
        float size = 2.4 * clamp(0.9 * away / lens.z, radius, 2.0 * radius);
        world = lamp.xyz + size * vec3(corner.x * sin(lamp.w), -corner.x * cos(lamp.w), corner.y);
        strength = 1.0;
    }
    local = corner;
    glow = tint.rgb;
    gl_Position = view_projection * vec4(world, 1.0);
}
"""

GLOW_FRAGMENT = BLOCKS + """
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

SKY_VERTEX = BLOCKS + """
in vec3 position; in vec3 uv;
out vec2 cell;
void main() {
    cell = uv.xy;
    gl_Position = (view_projection * vec4(position + vec3(eye.xy, 0.0), 1.0)).xyww;
}
"""

SKY_FRAGMENT = """#version 330 core
uniform sampler2D panorama;
in vec2 cell;
out vec4 pixel;
void main() { pixel = vec4(texture(panorama, cell).rgb, 1.0); }
"""

RAIN_VERTEX = BLOCKS + """
in vec2 corner;
out vec2 near_drops; out vec2 far_drops;
void main() {
    gl_Position = vec4(corner, 0.0, 1.0);
    vec2 p = corner * vec2(lens.x / lens.z, -lens.y / lens.z) * 0.5;
    near_drops = p * vec2(0.9, 0.5) + vec2(lens.w, 2.7 * eye.w + 3.0 * lens.w);
    far_drops = p * vec2(1.9, 0.9) + vec2(0.31 + 2.0 * lens.w, 1.9 * eye.w + lens.w);
}
"""

RAIN_FRAGMENT = BLOCKS + """
uniform sampler2D drops;
in vec2 near_drops; in vec2 far_drops;
out vec4 pixel;
void main() {
    float streak = texture(drops, near_drops).r * 0.42 + texture(drops, far_drops).r * 0.28;
    pixel = vec4(mix(horizon.rgb, vec3(0.9), 0.4), streak * (0.35 + 0.65 * wet.z));
}
"""
