// Needs: lit_by. Normals between those of the vertices (Phong 1975), towards the seen side.
vec2 surface_light(vec3 view) {
    vec3 normal = normalize(v.normal);
    return lit_by(gl_FrontFacing ? normal : -normal, view);
}
