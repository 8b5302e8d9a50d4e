// Needs: to_viewer, u_perspective. A point is a disc across its normal (a surfel, Pfister et al.
// 2000): where it is under this fragment, in the axes of the eye. Without a normal, or where the
// disc is hardly larger than a pixel, it faces the viewer.
in float v_point;     // pixels across
uniform vec2 u_half;  // half of the picture, at distance 1 where there is a perspective
uniform vec2 u_size;  // the whole picture, pixels

const float STEEPEST = 0.3;  // least cosine to the viewer: steeper discs are turned to it
const float SMALL = 2.5;

// Of the disc as it is drawn, towards the viewer.
vec3 disc_normal(vec3 view) {
    if (dot(v.normal, v.normal) <= 0.25) return view;
    vec3 normal = normalize(v.normal);
    normal = dot(normal, view) < 0.0 ? -normal : normal;
    vec3 side = normal - dot(normal, view) * view;
    if (dot(normal, view) >= STEEPEST) return normal;
    return STEEPEST * view + sqrt(1.0 - STEEPEST * STEEPEST) * normalize(side);
}

vec3 surface_eye() {
    if (v_point <= SMALL) return v.eye;
    vec3 view = to_viewer(v.eye, u_perspective), normal = disc_normal(view);
    float w = mix(1.0, -v.eye.z, u_perspective), across = v_point * 2.0 * u_half.y * w / u_size.y;
    vec3 off = vec3((gl_PointCoord - 0.5) * vec2(across, -across), 0.0);
    off -= view * dot(normal, off) / dot(normal, view);
    if (dot(off, off) > 0.25 * across * across) discard;
    return v.eye + off;
}
