#version 330 core
// Fetches the last texel of a 3D texture, to prove that its memory is there.
#include "@sampler"

uniform ivec3 u_last;
out vec4 o_texel;

void main() {
    o_texel = vec4(texelFetch(u_texture, u_last, 0));
}
