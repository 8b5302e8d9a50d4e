// Needs: lit_by. A round point with a normal of its own, towards the viewer; without one, facing
// the viewer.
vec2 surface_light(vec3 view) {
    vec2 at = gl_PointCoord * 2.0 - 1.0;
    if (u_round > 0.5 && dot(at, at) > 1.0) discard;
    vec3 normal = dot(v.normal, v.normal) > 0.25 ? normalize(v.normal) : view;
    return lit_by(dot(normal, view) < 0.0 ? -normal : normal, view);
}
