// The edges of the triangles; what is between them hides what is behind, and is hardly seen. However
// faint the lines are they hide each other: their opacity is that of the surface.
#include "surface/wire_lines.glsl"

vec4 wired(vec4 color) {
    return vec4(color.rgb, v.color.a * mix(0.07, 1.0, line_here(DENSEST)));
}
