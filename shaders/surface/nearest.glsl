// Opaque surfaces: the nearest is all there is to see.
bool hidden(float key, ivec2 at) {
    return false;
}

float opacity(float given) {
    return 1.0;  // interpolation leaves it a hair off
}
