// Needs: gradient. Provides: the lamp, and the surface normal that faces the viewer.
uniform vec4 u_material;  // ambient, diffuse, specular, exponent
uniform vec3 u_lamp;      // world direction to the lamp, unit length

// Zero where the field is flat: there is no surface to light.
vec3 surface_normal(vec3 at, float value, vec3 view) {
    vec3 g = gradient(at, value);
    float length2 = dot(g, g);
    if (!(length2 > 1e-30)) return vec3(0.0);
    vec3 normal = g * inversesqrt(length2);
    return dot(normal, view) < 0.0 ? -normal : normal;
}
