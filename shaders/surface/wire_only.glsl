// The edges of the triangles and nothing between them; those seen from behind are fainter.
#include "surface/wire_lines.glsl"

vec4 wired(vec4 color) {
    vec3 line = nearest_line();
    if (line.y > line.x) discard;
    return vec4(color.rgb, gl_FrontFacing ? color.a : 0.45 * color.a);
}
