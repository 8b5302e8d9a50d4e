// Needs: sample_volume (nearest). Provides: gradient for label volumes, where values are names and
// their differences mean nothing: the gradient of "same label as here", by the 3x3x3 Sobel weights.
uniform mat3 u_index_to_world_t;
uniform vec3 u_voxel;

vec3 gradient(vec3 at, float centre) {
    vec3 sum = vec3(0.0);
    for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
        ivec3 o = ivec3(x, y, z);
        int rank = abs(x) + abs(y) + abs(z);
        if (rank == 0) continue;
        float value;
        bool same = sample_volume(at + vec3(o) * u_voxel, value) && abs(value - centre) < 0.5;
        sum += same ? vec3(o) * (rank == 1 ? 6.0 : rank == 2 ? 3.0 : 1.0) : vec3(0.0);
    }
    return u_index_to_world_t * (sum / 44.0);
}
