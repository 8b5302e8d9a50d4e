// Needs: nothing. Provides: the transfer function as a table, and classify.
// Colour is linear light, premultiplied by opacity; opacity is already corrected to the step.
// Said once for all shaders: front-to-back, C += (1 - A) c, A += (1 - A) a.
uniform sampler2D u_table;  // entries in rows of 4096
uniform float u_last;       // index of the last entry

// value: an index into the table, as sample_volume gives it.
vec4 classify(float value) {
    int index = int(clamp(value, 0.0, u_last) + 0.5);
    return texelFetch(u_table, ivec2(index & 4095, index >> 12), 0);
}
