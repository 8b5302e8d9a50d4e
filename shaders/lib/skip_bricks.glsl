// Needs: u_step. Provides: steps_to_skip, by the chessboard distance of each brick to the nearest
// one that shows anything (Deakin and Knackstedt 2020). A ray may leave the box of empty bricks
// around it in one leap; samples stay on their lattice, so the picture is the same to the bit.
uniform usampler3D u_distance;
uniform vec3 u_bricks;     // bricks per texture coordinate: N / side
uniform float u_half;      // half a sample, in bricks

// How many steps from here show nothing; 0 where something may be seen.
int steps_to_skip(vec3 at, vec3 direction) {
    vec3 u = at * u_bricks - u_half;
    ivec3 cell = clamp(ivec3(floor(u)), ivec3(0), textureSize(u_distance, 0) - 1);
    int distance = int(texelFetch(u_distance, cell, 0).r);
    if (distance == 0) return 0;
    vec3 du = direction * u_bricks;
    vec3 safe = mix(du, vec3(1e-20), lessThan(abs(du), vec3(1e-20)));
    vec3 plane = vec3(cell) + mix(vec3(1 - distance), vec3(distance), greaterThan(safe, vec3(0.0)));
    vec3 leave = (plane - u) / safe;
    float nearest = min(min(leave.x, leave.y), leave.z) / u_step;
    // a hair less than the whole leap: rounding must not jump into what is seen
    return max(1, int(ceil(min(nearest, 1e6) - 1e-3)));
}
