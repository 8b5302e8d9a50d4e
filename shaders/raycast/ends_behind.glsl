// Needs: u_termination. A projection of the maximum has no depth that surfaces could lie in: their
// layers are put over each other, and the whole ray comes behind them. As ends_layers.glsl else.
uniform sampler2D u_gathered;      // light in front of this part
uniform sampler2D u_far_key;       // the layer of this part, and its colour
uniform sampler2D u_far_color;
uniform sampler2D u_opaque_key;    // where every ray ends, and the colour there
uniform sampler2D u_opaque_color;
uniform ivec2 u_layers;            // is there a layer before, is this part one
uniform vec2 u_first_px;           // pixel of the whole picture at the textures' corner
uniform vec2 u_place;              // t = key * x + y

vec4 in_front;
vec4 surface;

vec2 ray_ends(vec2 span, vec2 pixel) {
    ivec2 at = ivec2(pixel - u_first_px);
    in_front = u_layers.x > 0 ? texelFetch(u_gathered, at, 0) : vec4(0.0);
    surface = vec4(0.0);
    if (in_front.a >= u_termination) {
        in_front /= in_front.a;
        return vec2(0.0, -1.0);
    }
    if (u_layers.y > 0) {
        if (texelFetch(u_far_key, at, 0).r > 0.0) surface = texelFetch(u_far_color, at, 0);
        return vec2(0.0, -1.0);
    }
    float far = texelFetch(u_opaque_key, at, 0).r;
    surface = texelFetch(u_opaque_color, at, 0);
    if (far > 0.0) span.y = min(span.y, far * u_place.x + u_place.y);
    return span;
}

vec4 with_surface(vec4 segment) {
    vec4 part = segment + (1.0 - segment.a) * surface;
    return in_front + (1.0 - in_front.a) * part;
}
