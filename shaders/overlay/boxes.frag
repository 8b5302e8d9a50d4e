#version 330 core
// A line, smooth at its sides; faint where an opaque surface covers it. Blended by maximum: no
// order, straight opacity.
in float v_away;
in vec4 v_color;
in vec4 v_eye;  // axes of the eye, mm, over the weight; 1 over the weight
out vec4 o_color;

uniform float u_width;
uniform float u_perspective;  // 1 or 0
uniform vec2 u_size;          // of the picture, pixels
uniform sampler2D u_depth;    // mm to the opaque surfaces along each ray, 0: none
uniform float u_covering;     // 1: there is such a depth
uniform float u_slack;        // mm: what lies in the surface is not covered by it
uniform float u_covered;      // opacity of what is covered, of that of the rest

void main() {
    float inside = clamp(0.5 * u_width + 0.5 - abs(v_away), 0.0, 1.0);
    if (inside <= 0.0) discard;
    if (u_covering > 0.5) {
        float there = texture(u_depth, gl_FragCoord.xy / u_size).r;
        vec3 eye = v_eye.xyz / v_eye.w;
        float here = u_perspective > 0.5 ? length(eye) : -eye.z;
        if (there > 0.0 && here > there + u_slack) inside *= u_covered;
    }
    o_color = vec4(v_color.rgb, v_color.a * inside);
}
