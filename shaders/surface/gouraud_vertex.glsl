// Needs: lit_by, u_perspective. Light at the vertices, for both sides (Gouraud 1971).
vec4 vertex_light(vec3 eye, vec3 normal) {
    vec3 view = to_viewer(eye, u_perspective);
    return vec4(lit_by(normal, view), lit_by(-normal, view));
}
