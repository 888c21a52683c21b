#include "blocks.glsl"
#include "light.glsl"

in vec3 lit; in vec3 sunlit; in vec4 place;
out vec4 pixel;
void main() { pixel = vec4(hazy(lit + sunlit * sunshine(place)), 1.0); }
