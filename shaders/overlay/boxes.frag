#version 330 core
// A line, smooth at its sides. Blended by maximum: no order, straight opacity.
in float v_away;
in vec4 v_color;
out vec4 o_color;

uniform float u_width;

void main() {
    float inside = clamp(0.5 * u_width + 0.5 - abs(v_away), 0.0, 1.0);
    if (inside <= 0.0) discard;
    o_color = vec4(v_color.rgb, v_color.a * inside);
}
