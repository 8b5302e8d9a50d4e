// Depth peeling (Everitt 2001): of what is behind the layer before and in front of all that is
// opaque, the depth buffer keeps the nearest.
uniform sampler2D u_before;    // keys of the layer before
uniform sampler2D u_opaque;    // keys of the opaque surfaces; 0: none here
uniform sampler2D u_gathered;  // light down to the layer before
uniform float u_termination;   // opacity behind which nothing is seen
uniform int u_layer;           // number of this layer; the first has none before
uniform float u_thick;         // keys that a layer is thick: points beside each other overlap

bool hidden(float key, ivec2 at) {
    float opaque = texelFetch(u_opaque, at, 0).r;
    if (opaque > 0.0 && key >= opaque) return true;
    if (u_layer == 0) return false;
    float before = texelFetch(u_before, at, 0).r;
    return before == 0.0 || key <= before + u_thick || texelFetch(u_gathered, at, 0).a >= u_termination;
}

float opacity(float given) {
    return given;
}
