#version 330 core
// One triangle that covers the viewport; no buffers needed.
out vec2 v_ndc;

void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    v_ndc = corner;
    gl_Position = vec4(corner, 0.0, 1.0);
}
