// Needs: nothing. Provides: the volume texture and sample_volume, for volumes with missing samples.
// Texels hold (value * valid, valid): their quotient interpolates the valid neighbours alone
// (normalised convolution, Knutsson & Westin 1993).
uniform sampler3D u_volume;
uniform vec2 u_value;  // texel * x + y = index into the transfer function's table

// False where most of the neighbourhood was not measured.
bool sample_volume(vec3 at, out float value) {
    vec2 texel = textureLod(u_volume, at, 0.0).rg;
    value = texel.r / max(texel.g, 1e-6) * u_value.x + u_value.y;
    return texel.g >= 0.5;
}
