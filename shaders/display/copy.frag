#version 330 core
// A picture as it is, at another size or in another framebuffer.
in vec2 v_ndc;
out vec4 o_color;

uniform sampler2D u_picture;

void main() {
    o_color = texture(u_picture, v_ndc * 0.5 + 0.5);
}
