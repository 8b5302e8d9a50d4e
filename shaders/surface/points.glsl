// Needs: lit_by, disc_normal. A point with a normal of its own, round if it is large.
vec2 surface_light(vec3 view) {
    vec2 at = gl_PointCoord * 2.0 - 1.0;
    if (u_round > 0.5 && dot(at, at) > 1.0) discard;
    return lit_by(disc_normal(view), view);
}
