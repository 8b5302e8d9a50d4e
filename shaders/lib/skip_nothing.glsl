// Needs: nothing. Provides: steps_to_skip for modes to which every sample counts.
void skip_begin(vec3 origin, vec3 direction) {}

int steps_to_skip(vec3 at, vec3 direction) {
    return 0;
}
