#version 330 core
// Casts a ray per pixel through the volume. The picture is linear light, premultiplied.
// Lengths are in units of the smallest voxel spacing, positions in texture coordinates 0..1.
out vec4 o_color;

uniform mat3 u_ray_origin;     // origin = M * (1, x, y), x and y in -1..1 of the whole picture
uniform mat3 u_ray_direction;  // direction likewise, not normalised
uniform mat3 u_tex_to_world;   // texture coordinates to world axes, in units of length
uniform vec2 u_origin_px;      // first pixel of the tile in the whole picture
uniform float u_stride;        // from pixel to pixel: 2 for a quarter of them
uniform vec4 u_pixel;          // -1..1 of the whole picture = pixel * xy + zw
uniform vec3 u_jitter;         // part of a step, sample's shift, seed
uniform float u_step;          // distance between samples
uniform float u_near;          // rays begin here at the earliest
uniform float u_termination;   // opacity at which a ray ends

const float MAX_STEPS = 1048576.0;

#include "@skip"
#include "@sample"
#include "lib/classify.glsl"
#include "@gradient"
#include "@lighting"
#include "@shading"
#include "@mode"
#include "@ends"

// Interleaved gradient noise (Jimenez 2014), shifted by the golden ratio from sample to sample.
float sample_place(vec2 pixel) {
    vec2 place = pixel + 5.588238 * u_jitter.z;
    float noise = fract(52.9829189 * fract(dot(place, vec2(0.06711056, 0.00583715))));
    return 0.5 + (fract(noise + u_jitter.y) - 0.5) * u_jitter.x;
}

// Entry and exit of the box 0..1; empty if entry >= exit.
vec2 box_span(vec3 origin, vec3 direction) {
    vec3 safe = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 a = (vec3(0.0) - origin) / safe;
    vec3 b = (vec3(1.0) - origin) / safe;
    vec3 near = min(a, b), far = max(a, b);
    return vec2(max(max(near.x, near.y), max(near.z, u_near)), min(min(far.x, far.y), far.z));
}

void main() {
    vec2 pixel = floor(gl_FragCoord.xy) * u_stride + u_origin_px;  // whole numbers: tiles do not show
    vec3 at_pixel = vec3(1.0, pixel * u_pixel.xy + u_pixel.zw);
    vec3 origin = u_ray_origin * at_pixel;
    vec3 direction = u_ray_direction * at_pixel;
    vec3 along = u_tex_to_world * direction;
    direction /= length(along);
    vec3 view = -normalize(along);

    vec2 span = ray_ends(box_span(origin, direction), pixel);
    float steps = max((span.y - span.x) / u_step, 0.0);
    float place = sample_place(pixel);
    int whole = int(min(steps, MAX_STEPS));
    bool ended = false;
    ray_begin();
    skip_begin(origin, direction);
    // Two loops: rays that see nothing go on alone until each of the group has something to light.
    // Software rasterisers run a group in lockstep and would light with every sample otherwise.
    for (int i = 0; i < whole && !ended; ++i) {
        vec3 at = vec3(0.0);
        float value = 0.0;
        bool seen = false;
        for (; i < whole; ++i) {
            at = origin + direction * (span.x + (float(i) + place) * u_step);
            int empty = steps_to_skip(at, direction);
            if (empty > 0) {
                i += empty - 1;
                continue;
            }
            if (sample_volume(at, value) && ray_sees(value)) {
                seen = true;
                break;
            }
        }
        if (seen) ended = ray_step(value, at, view, 1.0);
    }
    // what is left of the last step, outside the loop: its weight costs a power
    float rest = steps - float(whole);
    if (!ended && rest > 1e-4) {
        vec3 at = origin + direction * (span.x + (float(whole) + place * rest) * u_step);
        float value;
        if (sample_volume(at, value) && ray_sees(value)) ray_step(value, at, view, rest);
    }
    o_color = with_surface(ray_end());
}
