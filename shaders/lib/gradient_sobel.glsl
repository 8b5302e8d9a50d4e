// Needs: sample_volume. Provides: gradient, by the 3x3x3 operator of Sobel (Zucker & Hummel 1981):
// central differences smoothed across by the weights 1 3 1, 3 6 3, 1 3 1. 26 fetches; it does not
// follow noise and the steps between slices as closely as central differences do.
uniform mat3 u_index_to_world_t;  // inverse transpose of index to world
uniform vec3 u_voxel;             // 1 / N, one voxel in texture coordinates

vec3 gradient(vec3 at, float centre) {
    vec3 sum = vec3(0.0);
    for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
        vec3 o = vec3(x, y, z);
        float rank = dot(abs(o), vec3(1.0));
        float value;
        if (rank == 0.0 || !sample_volume(at + o * u_voxel, value)) continue;
        sum += o * ((value - centre) * (rank == 1.0 ? 6.0 : rank == 2.0 ? 3.0 : 1.0));
    }
    return u_index_to_world_t * (sum / 44.0);
}
