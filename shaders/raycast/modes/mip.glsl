// Needs: classify. Provides: the three functions of a mode.
// Maximum intensity projection: the largest value along the ray, then classified.
float largest;
bool found;

void ray_begin() {
    largest = 0.0;
    found = false;
}

bool ray_step(float value, vec3 at, vec3 view, float weight) {
    largest = found ? max(largest, value) : value;
    found = true;
    return false;
}

vec4 ray_end() {
    return found ? classify(largest) : vec4(0.0);
}
