#version 330 core
// Triangles as they are, with barycentric coordinates, by which fragments know their edges
// (Bærentzen et al. 2006).
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

in Surface {
    vec3 eye;
    vec3 normal;
    vec4 color;
    vec4 lit;
} of[];
out Surface {
    vec3 eye;
    vec3 normal;
    vec4 color;
    vec4 lit;
} v;
out vec3 g_corner;

void main() {
    for (int i = 0; i < 3; ++i) {
        v.eye = of[i].eye;
        v.normal = of[i].normal;
        v.color = of[i].color;
        v.lit = of[i].lit;
        g_corner = vec3(i == 0, i == 1, i == 2);
        gl_Position = gl_in[i].gl_Position;
        EmitVertex();
    }
    EndPrimitive();
}
