#include "blocks.glsl"
#include "light.glsl"

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
