#version 330 core
// How far the opaque surfaces are along the rays, mm; 0 where there is none.
out vec4 o_depth;

uniform sampler2D u_opaque;  // keys, see surface.frag
uniform vec2 u_first_px;     // of the picture, at the corner of the keys
uniform vec2 u_place;        // mm = key * x + y

void main() {
    float key = texelFetch(u_opaque, ivec2(gl_FragCoord.xy - u_first_px), 0).r;
    o_depth = vec4(key > 0.0 ? max(key * u_place.x + u_place.y, 1e-30) : 0.0);
}
