// Needs: nothing. Provides: shade, which leaves the colour as it is.
vec3 shade(vec3 color, vec3 at, float value, vec3 view) {
    return color;
}
