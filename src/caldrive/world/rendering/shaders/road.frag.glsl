#include "blocks.glsl"
#include "light.glsl"
#include "stripes.glsl"

uniform sampler2DArray layers;
uniform vec3 center_color; uniform vec3 edge_color; uniform vec3 asphalt;
float grain(vec2 at) { return texture(layers, vec3(at, float(TEX_ASPHALT))).r; }
void main() {
    vec3 footprint = max(fwidth(lane), vec3(1e-4));
    float fine = grain(ground * 0.14), coarse = grain(ground.yx * 0.019);
    float track = clamp(1.0 - 2.2 * abs(abs(lane.x) - 0.85), 0.0, 1.0) * (kinds.z < JUNCTION_HALF_WIDTH - 0.1 ? 0.09 : 0.0);
    vec3 albedo = asphalt * fine * (0.45 + 0.7 * coarse) * (1.0 - track);

    float wear = 0.55 + 0.5 * fine, left, right, stop;
    stripes(footprint, left, right, stop);
    bool white = kinds.x == float(BORDER_EDGE) || kinds.x == float(BORDER_DIVIDER);
    albedo = mix(albedo, white ? edge_color : center_color, left * wear);
    albedo = mix(albedo, edge_color, max(right, stop) * wear);

    float shine = sunshine(place);
    if (wet.x > 0.0) {  // the sky and the sun mirrored in the water
        vec3 view = vec3(ground, 0.0) - eye.xyz;
        view *= inversesqrt(dot(view, view));
        float puddle = clamp((grain(ground * 0.043) + 0.42 * wet.y - 0.96) * 14.0, 0.0, 1.0);
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
