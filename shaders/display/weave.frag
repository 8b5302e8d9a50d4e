#version 330 core
// Every second pixel along each side from a picture with a quarter of the pixels.
out vec4 o_color;

uniform sampler2D u_quarter;
uniform ivec2 u_first;  // the first of its pixels

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - u_first;
    if (((at.x | at.y) & 1) != 0) discard;
    o_color = texelFetch(u_quarter, at / 2, 0);
}
