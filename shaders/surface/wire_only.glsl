// Needs: wire.geom. The edges of the triangles and nothing between them.
in vec3 g_corner;  // barycentric
uniform float u_line;  // pixels across a line

vec4 wired(vec4 color) {
    vec3 away = g_corner / max(fwidth(g_corner), vec3(1e-9));
    if (min(min(away.x, away.y), away.z) > 0.5 * u_line) discard;
    return color;
}
