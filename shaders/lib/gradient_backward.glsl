// Needs: sample_volume. Provides: gradient, by backward differences: half the fetches of central
// ones, and exact half a voxel behind the sample instead of at it.
uniform mat3 u_index_to_world_t;  // inverse transpose of index to world
uniform vec3 u_voxel;             // 1 / N, one voxel in texture coordinates

float difference(vec3 at, vec3 offset, float centre) {
    float behind;
    return sample_volume(at - offset, behind) ? centre - behind : 0.0;
}

vec3 gradient(vec3 at, float centre) {
    vec3 index = vec3(difference(at, vec3(u_voxel.x, 0.0, 0.0), centre),
                      difference(at, vec3(0.0, u_voxel.y, 0.0), centre),
                      difference(at, vec3(0.0, 0.0, u_voxel.z), centre));
    return u_index_to_world_t * index;
}
