// Edges drawn over the triangles, dark on light colours and light on dark ones.
#include "surface/wire_lines.glsl"

vec4 wired(vec4 color) {
    float ink = 0.7 * line_here(0.1);
    float bright = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722));
    vec3 lines = bright > 0.18 ? color.rgb * 0.08 : mix(color.rgb, vec3(1.0), 0.6);
    return vec4(mix(color.rgb, lines, ink), mix(color.a, 1.0, ink * 0.5));
}
