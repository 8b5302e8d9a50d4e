// Needs: lit_by. The triangle's own normal, towards the viewer.
vec2 surface_light(vec3 view) {
    vec3 normal = cross(dFdx(v.eye), dFdy(v.eye));
    float length2 = dot(normal, normal);
    normal = length2 > 1e-30 ? normal * inversesqrt(length2) : view;
    return lit_by(dot(normal, view) < 0.0 ? -normal : normal, view);
}
