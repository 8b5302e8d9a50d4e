#version 330 core
// A fragment of a surface: its colour, and its place along the ray as a whole number (a key), so
// that the depth buffer, the layers and the rays agree on what is in front of what.
in Surface {
    vec3 eye;
    vec3 normal;
    vec4 color;
    vec4 lit;
} v;
layout(location = 0) out vec4 o_color;  // linear light, premultiplied
layout(location = 1) out float o_key;   // 1 and up; 0 is nothing

uniform float u_perspective;  // 1 or 0
uniform vec3 u_keys;          // key = floor((t - x) * y) + z
uniform float u_round;        // 1: points are round

const float LAST_KEY = 4194303.0;  // 2^22 − 1: whole in floats and in 24 bits of depth

#include "surface/light.glsl"
#include "@place"
#include "@shading"
#include "@wire"
#include "@layer"

void main() {
    vec3 eye = surface_eye();
    float t = u_perspective > 0.5 ? length(eye) : -eye.z;
    float key = clamp(floor((t - u_keys.x) * u_keys.y) + u_keys.z, 1.0, LAST_KEY);
    vec2 light = surface_light(to_viewer(v.eye, u_perspective));
    vec4 color = wired(vec4(v.color.rgb, opacity(v.color.a)));
    if (hidden(key, ivec2(gl_FragCoord.xy))) discard;
    o_color = vec4((color.rgb * light.x + light.y) * color.a, color.a);
    o_key = key;
    gl_FragDepth = key / (LAST_KEY + 1.0);
}
