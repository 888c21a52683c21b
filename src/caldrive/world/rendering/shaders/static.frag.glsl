#include "blocks.glsl"
#include "light.glsl"

uniform sampler2DArray layers;
in vec3 lit; in vec3 sunlit; in vec3 cell; in vec4 place;
out vec4 pixel;
void main() {
    vec3 albedo = texture(layers, cell, -0.6).rgb;
    pixel = vec4(hazy(albedo * (lit + sunlit * sunshine(place))), 1.0);
}
