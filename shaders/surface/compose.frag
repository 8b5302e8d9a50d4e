#version 330 core
// The layers of surfaces over each other, with nothing between them.
out vec4 o_color;

uniform vec2 u_origin_px;      // first pixel of the tile in the whole picture
uniform float u_termination;   // opacity at which a ray ends

#include "@ends"

void main() {
    ray_ends(vec2(0.0), floor(gl_FragCoord.xy) + u_origin_px);
    o_color = with_surface(vec4(0.0));
}
