// Shared by all programs: Frame holds for one picture, Lighting for one weather in one town.
layout(std140) uniform Frame {
    mat4 view_projection;
    vec4 eye;            // position in m, time in s
    vec4 lens;           // width, height and focal length in pixels, seed of the rain in [0, 1)
};
layout(std140) uniform Lighting {
    vec4 sun_direction; vec4 sun; vec4 sky_ambient; vec4 ground_ambient;
    vec4 horizon;        // colour, fog density per m
    vec4 zenith;
    vec4 wet;            // wetness, puddles, rain, each in [0, 1]
    vec4 shadow_area;    // x, y of its corner in m, 1 / width, 1 / height
};
