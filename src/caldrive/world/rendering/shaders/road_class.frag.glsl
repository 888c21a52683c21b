// The semantic image of the asphalt: markings and road.
#include "blocks.glsl"
#include "stripes.glsl"

void main() {
    vec3 footprint = max(fwidth(lane), vec3(1e-4));
    float left, right, stop;
    stripes(footprint, left, right, stop);
    pixel = vec4(vec3(max(left, max(right, stop)) > 0.5 ? float(CLASS_LINE) : float(CLASS_ROAD)) / 255.0, 1.0);
}
