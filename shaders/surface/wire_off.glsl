vec4 wired(vec4 color) {
    return color;
}
