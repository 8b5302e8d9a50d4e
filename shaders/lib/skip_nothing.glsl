// Needs: nothing. Provides: steps_to_skip for modes to which every sample counts.
int steps_to_skip(vec3 at, vec3 direction) {
    return 0;
}
