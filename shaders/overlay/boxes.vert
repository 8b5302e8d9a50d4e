#version 330 core
// The twelve edges of a box, each as a band of pixels that faces the viewer. One instance per box,
// 72 vertices: edge, then corner of its two triangles.
in vec3 in_low;     // corners of the box, in samples
in vec3 in_high;
in vec4 in_color;   // sRGB, straight opacity

uniform mat4 u_place;         // samples to world mm, and on to the axes of the eye
uniform vec2 u_half;          // half of the picture, at distance 1 where there is a perspective
uniform float u_perspective;  // 1 or 0
uniform float u_near;         // nothing nearer is drawn
uniform vec2 u_reach;         // distances between which lines grow fainter
uniform vec2 u_size;          // of the picture, pixels
uniform float u_width;        // of a line, pixels

out float v_away;  // pixels from the middle of the line
out vec4 v_color;
out vec4 v_eye;  // over the weight, as it is linear in the picture; 1 over the weight

vec3 corner(int axis, int others, float along) {
    vec3 at;
    at[axis] = along;
    at[(axis + 1) % 3] = float(others & 1);
    at[(axis + 2) % 3] = float(others >> 1);
    return (u_place * vec4(mix(in_low, in_high, at), 1.0)).xyz;
}

// Weight and pixels of a point of the eye's axes, 0 in the middle of the picture.
vec3 placed(vec3 eye) {
    float w = mix(1.0, -eye.z, u_perspective);
    return vec3(0.5 * u_size * eye.xy / (u_half * w), w);
}

void main() {
    int edge = gl_VertexID / 6, k = gl_VertexID % 6;
    bool at_end = k == 1 || k == 2 || k == 4, left = k == 0 || k == 1 || k == 3;
    vec3 a = corner(edge >> 2, edge & 3, 0.0), b = corner(edge >> 2, edge & 3, 1.0);
    v_color = in_color;
    v_away = 0.0;
    v_eye = vec4(0.0, 0.0, 0.0, 1.0);
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    if (u_perspective > 0.5) {  // what is behind the viewer is cut off
        if (max(-a.z, -b.z) <= u_near) return;
        if (-a.z < u_near) a = mix(a, b, (u_near + a.z) / (a.z - b.z));
        if (-b.z < u_near) b = mix(b, a, (u_near + b.z) / (b.z - a.z));
    }
    vec3 here = at_end ? b : a;
    float w = mix(1.0, -here.z, u_perspective);
    v_eye = vec4(here, 1.0) / w;
    vec2 from = placed(a).xy, to = placed(b).xy, way = to - from;
    way = dot(way, way) > 1e-12 ? normalize(way) : vec2(1.0, 0.0);
    float reach = 0.5 * u_width + 1.0;
    v_away = left ? reach : -reach;
    vec2 pixel = (at_end ? to : from) + vec2(-way.y, way.x) * v_away;
    float far = clamp((-here.z - u_reach.x) / max(u_reach.y - u_reach.x, 1e-12), 0.0, 1.0);
    v_color.a *= mix(1.0, 0.3, far);
    gl_Position = vec4(2.0 * pixel / u_size, 0.0, 1.0);
}
