// Needs: wire.geom. How far the nearest edge of the triangle is, in pixels.
in vec3 g_corner;      // barycentric
uniform float u_line;  // pixels across a line

const float DENSEST = 0.5;  // of a triangle, that lines may cover: smaller ones have finer lines

// Half the width of the lines, and the distance to the nearest.
vec2 nearest_line() {
    vec3 x = dFdx(g_corner), y = dFdy(g_corner);
    vec3 narrow = max(sqrt(x * x + y * y), vec3(1e-9));  // 1 / height of the triangle in pixels
    vec3 away = g_corner / narrow;
    float most = DENSEST / (2.0 * (narrow.x + narrow.y + narrow.z));
    return vec2(min(0.5 * u_line, most), min(min(away.x, away.y), away.z));
}
