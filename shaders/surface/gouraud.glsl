// What the vertices found, in between (Gouraud 1971).
vec2 surface_light(vec3 view) {
    return gl_FrontFacing ? v.lit.xy : v.lit.zw;
}
