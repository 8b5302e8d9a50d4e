// Provides: how a surface answers the lamp, Blinn 1977. Everything in the axes of the eye.
uniform vec4 u_material;  // ambient, diffuse, specular, exponent
uniform vec3 u_lamp;      // direction to the lamp, unit length

vec3 to_viewer(vec3 eye, float perspective) {
    return perspective > 0.5 ? -normalize(eye) : vec3(0.0, 0.0, 1.0);
}

// How bright the colour is, and the highlight on it; the normal faces the viewer.
vec2 lit_by(vec3 normal, vec3 view) {
    float diffuse = max(dot(normal, u_lamp), 0.0);
    float shine = max(dot(normal, normalize(u_lamp + view)), 0.0);
    float highlight = diffuse > 0.0 ? u_material.z * pow(shine, u_material.w) : 0.0;
    return vec2(u_material.x + u_material.y * diffuse, highlight);
}
