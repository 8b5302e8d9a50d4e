// Rays go all the way: there is no surface.
vec2 ray_ends(vec2 span, vec2 pixel) {
    return span;
}

vec4 with_surface(vec4 segment) {
    return segment;
}
