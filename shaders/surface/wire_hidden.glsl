// The edges of the triangles; what is between them hides what is behind, and is hardly seen.
#include "surface/wire_lines.glsl"

vec4 wired(vec4 color) {
    vec2 line = nearest_line();
    return vec4(color.rgb, line.y > line.x ? 0.07 * color.a : color.a);
}
