uniform sampler2D panorama;
in vec2 cell;
out vec4 pixel;
void main() { pixel = vec4(texture(panorama, cell).rgb, 1.0); }
