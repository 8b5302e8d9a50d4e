// Needs: nothing. Provides: the volume texture and sample_volume.
// Every sample counts; for volumes with missing samples see sample_masked.glsl.
uniform sampler3D u_volume;
uniform vec2 u_value;  // texel * x + y = index into the transfer function's table

// False where nothing was measured.
bool sample_volume(vec3 at, out float value) {
    value = textureLod(u_volume, at, 0.0).r * u_value.x + u_value.y;
    return true;
}
