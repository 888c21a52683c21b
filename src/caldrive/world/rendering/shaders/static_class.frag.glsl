flat in float kind;
out vec4 pixel;
void main() { pixel = vec4(vec3(kind), 1.0); }
