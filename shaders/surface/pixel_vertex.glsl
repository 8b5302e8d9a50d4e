// The light is worked out for every pixel: nothing to do at the vertices.
vec4 vertex_light(vec3 eye, vec3 normal) {
    return vec4(0.0);
}
