// Road markings, of which the fragment shaders of the picture and of the semantic image make use.
// A line covers as much of a pixel as the pixel's width on the road overlaps it: far lines fade and do not flicker.
uniform vec4 widths;     // half widths of centre and edge line, inset of the edge line in m, share of a dash
in vec2 ground; in vec3 lane; flat in vec3 kinds; in vec4 place;
out vec4 pixel;
float stripe(float at, float footprint, float middle, float half_width) {
    float low = max(at - 0.5 * footprint, middle - half_width), high = min(at + 0.5 * footprint, middle + half_width);
    return clamp((high - low) / footprint, 0.0, 1.0);
}
void stripes(vec3 footprint, out float left, out float right, out float stop) {
    float dash = stripe(fract(lane.y), footprint.y, 0.5, 0.5 * widths.w);
    dash = mix(dash, widths.w, clamp(2.0 * footprint.y - 0.6, 0.0, 1.0));
    bool edge = kinds.x == float(BORDER_EDGE);
    float broken = kinds.x == float(BORDER_SOLID_CENTER) || edge ? 1.0 : dash;
    float inset = edge ? widths.z : 0.0;
    left = kinds.x > 0.0 ? broken * stripe(lane.x, footprint.x, kinds.z - inset, edge ? widths.y : widths.x) : 0.0;
    right = kinds.y == float(BORDER_EDGE) ? stripe(lane.x, footprint.x, widths.z - kinds.z, widths.y) : 0.0;
    stop = stripe(lane.z, footprint.z, 0.6, 0.25);
}
