// Needs: gradient. Provides: the lamp, and the surface normal that faces the viewer.
uniform vec4 u_material;  // ambient, diffuse, specular, exponent
uniform vec3 u_lamp;      // world direction to the lamp, unit length

// Outside the outer sample centres there is nothing to take differences with: what is seen there
// is the cut through the material, and its normal is the side of the box.
bool cut_face(vec3 at, out vec3 across) {
    vec3 depth = min(at, 1.0 - at) / u_voxel;
    float least = min(min(depth.x, depth.y), depth.z);
    across = u_index_to_world_t * vec3(equal(depth, vec3(least)));
    return least < 0.5;
}

// Zero where the field is flat: there is no surface to light.
vec3 surface_normal(vec3 at, float value, vec3 view) {
    vec3 g;
    if (!cut_face(at, g)) g = gradient(at, value);
    float length2 = dot(g, g);
    if (!(length2 > 1e-30)) return vec3(0.0);
    vec3 normal = g * inversesqrt(length2);
    return dot(normal, view) < 0.0 ? -normal : normal;
}
