// Everything that stands still, but for the asphalt. normal.w: the semantic class; color.w: 1 on walls
// and trees, which are shaded by buildings only, 0 elsewhere.
#include "blocks.glsl"

in vec3 position; in vec3 uv; in vec4 normal; in vec4 color;
out vec3 lit; out vec3 sunlit; out vec3 cell; out vec4 place;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 n = (normal.xyz * 255.0 - 128.0) / 127.0;
    vec3 albedo = color.rgb * (n.z > 0.9 && position.z < 0.3 ? 1.0 - 0.3 * wet.x : 1.0 - 0.08 * wet.x);
    lit = albedo * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z);
    sunlit = albedo * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
    cell = uv;
    if (int(normal.w * 255.0 + 0.5) == CLASS_SIGN) {  // signs throw the headlamps' light back
        lit = max(lit, 0.80 * albedo);
        sunlit *= 0.4;
    }
    place = vec4((position.xy + 0.8 * color.w * n.xy - shadow_area.xy) * shadow_area.zw, position.z, color.w);
}
