// The semantic image of what stands still.
#include "blocks.glsl"

in vec3 position; in vec4 normal;
flat out float kind;
void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    kind = normal.w;
}
