// Needs: u_step. Provides: steps_to_skip, by the chessboard distance of each brick to the nearest
// one that shows anything (Deakin and Knackstedt 2020). A ray may leave the box of empty bricks
// around it in one leap; samples stay on their lattice, so the picture is the same to the bit.
uniform usampler3D u_distance;
uniform vec3 u_bricks;     // bricks per texture coordinate: N / side
uniform float u_half;      // half a sample, in bricks

// The ray in bricks, once per ray: compilers of software rasterisers leave it in the loop.
vec3 brick_start, brick_step, brick_pace, brick_ahead;
ivec3 brick_last;

void skip_begin(vec3 origin, vec3 direction) {
    vec3 du = direction * u_bricks;
    brick_step = du;
    brick_start = origin * u_bricks - u_half;
    vec3 safe = mix(du, vec3(1e-20), lessThan(abs(du), vec3(1e-20)));
    brick_ahead = vec3(greaterThan(safe, vec3(0.0)));
    brick_pace = 1.0 / (safe * u_step);
    brick_last = textureSize(u_distance, 0) - 1;
}

// How many steps from here show nothing; 0 where something may be seen.
int steps_to_skip(vec3 at, vec3 direction) {
    vec3 u = at * u_bricks - u_half;
    vec3 cell = clamp(floor(u), vec3(0.0), vec3(brick_last));
    float distance = float(texelFetch(u_distance, ivec3(cell), 0).r);
    if (distance == 0.0) return 0;
    vec3 plane = cell + mix(vec3(1.0 - distance), vec3(distance), brick_ahead);
    vec3 leave = (plane - u) * brick_pace;
    float nearest = min(min(leave.x, leave.y), leave.z);
    // a hair less than the whole leap: rounding must not jump into what is seen
    return max(1, int(ceil(min(nearest, 1e6) - 1e-3)));
}
