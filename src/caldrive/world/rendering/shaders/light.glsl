// Sunshine and fog. Needs blocks.glsl.
uniform sampler2D shadows;
float sunshine(vec4 place) {  // 1 in the sun, 0 in the shade; place: xy on the shadow texture, z in m, which channel
    vec2 height = TALLEST_SHADOW * texture(shadows, place.xy).rg;
    return clamp((place.z - mix(height.r, height.g, place.w)) * 2.0 + 1.0, 0.0, 1.0);
}
vec3 hazy(vec3 color) {
    float depth = horizon.w / gl_FragCoord.w;
    return mix(horizon.rgb, color, 1.0 / (1.0 + depth * depth));
}
