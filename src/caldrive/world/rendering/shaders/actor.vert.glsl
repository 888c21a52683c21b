// Cars and people, many instances of one mesh. placed: x, y, heading, phase of the gait. scale: along, across, up, swing
// of the limbs. first to fourth: colours of the parts; fourth.w: whether it stands on the sidewalk.
#include "blocks.glsl"

in vec3 position; in vec4 normal; in vec4 color;
in vec4 placed; in vec4 scale; in vec4 first; in vec4 second; in vec4 third; in vec4 fourth;
out vec3 lit; out vec3 sunlit; out vec4 place;
void main() {
    int slot = int(normal.w * 255.0 + 0.5), limb = int(color.w * 255.0 + 0.5);
    vec3 p = position, n = (normal.xyz * 255.0 - 128.0) / 127.0;
    bool leg = limb == LIMB_LEFT_LEG || limb == LIMB_RIGHT_LEG, arm = limb == LIMB_LEFT_ARM || limb == LIMB_RIGHT_ARM;
    if (leg || arm) {  // legs and arms swing about hip and shoulder, opposite ones together
        float pivot = leg ? HIP_HEIGHT : SHOULDER_HEIGHT;
        float angle = (limb == LIMB_LEFT_LEG || limb == LIMB_RIGHT_ARM ? scale.w : -scale.w) * sin(placed.w);
        float c = cos(angle), s = sin(angle), x = p.x, z = p.z - pivot;
        p.x = c * x - s * z;
        p.z = s * x + c * z + pivot;
        n.xz = vec2(c * n.x - s * n.z, s * n.x + c * n.z);
    }
    p *= scale.xyz;
    float c = cos(placed.z), s = sin(placed.z);
    vec3 world = vec3(c * p.x - s * p.y + placed.x, s * p.x + c * p.y + placed.y, p.z + KERB_HEIGHT * fourth.w);
    n = vec3(c * n.x - s * n.y, s * n.x + c * n.y, n.z);
    gl_Position = view_projection * vec4(world, 1.0);
    vec3 own = slot == 1 ? first.rgb : slot == 2 ? second.rgb : slot == 3 ? third.rgb : fourth.rgb;
    vec3 albedo = slot > 0 && slot < CAR_GLASS ? own * color.rgb : color.rgb;
    bool painted = slot == CAR_PAINT && limb == 0 && fourth.rgb == vec3(0.0);  // people have a fourth colour, cars none
    float gloss = slot == CAR_GLASS ? 0.30 : painted ? 0.12 : 0.0;
    lit = albedo * mix(ground_ambient.rgb, sky_ambient.rgb, 0.5 + 0.5 * n.z);
    lit += gloss * horizon.rgb * (0.35 + 0.65 * max(n.z, 0.0));
    sunlit = albedo * sun.rgb * max(dot(n, sun_direction.xyz), 0.0);
    if (limb == GLOWING) { lit = albedo; sunlit = vec3(0.0); }
    place = vec4((placed.xy - shadow_area.xy) * shadow_area.zw, p.z, 0.0);
}
