// Needs: wire.geom. Edges drawn over the triangles, dark on light colours and light on dark ones.
in vec3 g_corner;  // barycentric
uniform float u_line;  // pixels across a line

vec4 wired(vec4 color) {
    vec3 narrow = max(fwidth(g_corner), vec3(1e-9));  // 1 / height of the triangle in pixels
    vec3 away = g_corner / narrow;
    float line = clamp(0.5 * u_line + 0.5 - min(min(away.x, away.y), away.z), 0.0, 1.0);
    // where triangles are hardly larger than pixels, lines would be all there is
    line *= 1.0 - 0.9 * smoothstep(0.2, 0.7, max(max(narrow.x, narrow.y), narrow.z));
    float bright = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722));
    vec3 ink = bright > 0.18 ? color.rgb * 0.12 : mix(color.rgb, vec3(1.0), 0.6);
    return vec4(mix(color.rgb, ink, line), mix(color.a, 1.0, line * 0.5));
}
