// The edges of the triangles; what is between them hides what is behind, and is hardly seen.
#include "surface/wire_lines.glsl"

vec4 wired(vec4 color) {
    return vec4(color.rgb, color.a * mix(0.07, 1.0, line_here(DENSEST)));
}
