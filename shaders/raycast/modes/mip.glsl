// Needs: classify. Provides: the four functions of a mode.
// Maximum intensity projection: the largest value along the ray, then classified.
float largest;
bool found;

void ray_begin() {
    largest = 0.0;
    found = false;
}

// The value is all there is to a sample: never anything to light.
bool ray_sees(float value) {
    largest = found ? max(largest, value) : value;
    found = true;
    return false;
}

bool ray_step(float value, vec3 at, vec3 view, float weight) {
    return false;
}

vec4 ray_end() {
    return found ? classify(largest) : vec4(0.0);
}
