// Needs: wire.geom. Lines along the edges of the triangle.
in vec3 g_corner;      // barycentric
uniform float u_line;  // pixels across a line

const float DENSEST = 0.5;  // of a triangle, that lines may cover: smaller ones have finer lines

// Half the width of the lines, the distance to the nearest, the radius of the triangle's inner
// circle; pixels.
vec3 nearest_line() {
    vec3 x = dFdx(g_corner), y = dFdy(g_corner);
    vec3 narrow = max(sqrt(x * x + y * y), vec3(1e-9));  // 1 / height of the triangle
    vec3 away = g_corner / narrow;
    float inner = 1.0 / (narrow.x + narrow.y + narrow.z);
    return vec3(min(0.5 * u_line, 0.5 * DENSEST * inner), min(min(away.x, away.y), away.z), inner);
}

// How much of the pixel the line covers: over its whole width together as much as it is wide. Of
// triangles smaller than a pixel it is `small`.
float line_here(float small) {
    vec3 line = nearest_line();
    float reach = line.x + 0.5;
    float here = clamp(reach - line.y, 0.0, 1.0) * min(2.0 * line.x / (reach * reach), 1.0);
    return mix(small, here, smoothstep(0.3, 1.0, line.z));
}
