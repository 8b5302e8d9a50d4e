#version 330 core
// A vertex of a surface: from world mm to the axes of the eye and to the pixels of a tile.
// Lengths are in units of the smallest voxel spacing, as along the rays.
in vec3 in_position;
in vec3 in_normal;
in vec4 in_color;  // sRGB, where the mesh brings colours

uniform vec3 u_eye;           // world mm
uniform mat3 u_axes;          // rows right, up, back: mm to units of length
uniform vec2 u_half;          // half of the picture, at distance 1 where there is a perspective
uniform float u_perspective;  // 1 or 0
uniform float u_near;         // nothing nearer is drawn
uniform vec2 u_size;          // the whole picture, pixels
uniform vec2 u_shift;         // where in its pixel this sample's ray goes
uniform vec4 u_tile;          // of the whole picture: first pixel, width, height
uniform vec4 u_color;         // linear light, straight opacity
uniform float u_painted;      // 1: colours of the mesh
uniform float u_point;        // pixels across a point, at least
uniform float u_apart;        // way between points: as large as that they leave no holes

const float MOST_POINT = 32.0;  // larger ones would reach into tiles that do not draw them

out Surface {
    vec3 eye;
    vec3 normal;
    vec4 color;
    vec4 lit;  // of the front and of the back: how bright the colour, and the highlight
} v;
out float v_point;  // pixels across, of points

#include "surface/light.glsl"
#include "@shading_vertex"

vec3 decode(vec3 s) {
    return mix(pow((s + 0.055) / 1.055, vec3(2.4)), s / 12.92, lessThanEqual(s, vec3(0.04045)));
}

void main() {
    v.eye = u_axes * (in_position - u_eye);
    vec3 normal = u_axes * in_normal;
    float length2 = dot(normal, normal);
    v.normal = length2 > 0.0 ? normal * inversesqrt(length2) : vec3(0.0);
    v.color = vec4(mix(u_color.rgb, decode(in_color.rgb), u_painted), u_color.a);
    v.color.a *= mix(1.0, in_color.a, u_painted);
    v.lit = vertex_light(v.eye, v.normal);

    float w = mix(1.0, -v.eye.z, u_perspective);
    vec2 pixel = 0.5 * u_size * (v.eye.xy / u_half + w) - u_shift * w;
    // To the rasteriser's own grid of 1/256 pixel, counted from the whole picture: then the same
    // pixels are covered whichever tile is drawn.
    if (w > u_near) pixel = floor(pixel / w * 256.0 + 0.5) / 256.0 * w;
    float z = mix(0.0, w - 2.0 * u_near, u_perspective);
    gl_Position = vec4(2.0 * (pixel - u_tile.xy * w) / u_tile.zw - w, z, w);
    float wide = u_apart * 0.5 * u_size.y / (u_half.y * max(w, u_near + 1e-6));
    gl_PointSize = v_point = clamp(wide, u_point, MOST_POINT);
}
