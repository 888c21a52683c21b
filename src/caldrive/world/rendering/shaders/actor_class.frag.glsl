// The semantic image of cars or people.
uniform float kind;
out vec4 pixel;
void main() { pixel = vec4(vec3(kind / 255.0), 1.0); }
