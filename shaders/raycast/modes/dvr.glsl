// Needs: classify, shade, u_termination. Provides: the four functions of a mode.
// Emission and absorption, front to back (Levoy 1988; Max 1995).
vec4 gathered;
vec4 light;  // of the present sample

void ray_begin() {
    gathered = vec4(0.0);
}

// True if this value is worth the light of ray_step.
bool ray_sees(float value) {
    light = classify(value);
    return light.a > 0.0;
}

// The sample just seen; weight: the part of a full step that it stands for. True ends the ray.
bool ray_step(float value, vec3 at, vec3 view, float weight) {
    light.rgb = shade(light.rgb / light.a, at, value, view);
    if (weight < 1.0) light.a = 1.0 - pow(1.0 - light.a, weight);
    light.rgb *= light.a;
    gathered += (1.0 - gathered.a) * light;
    return gathered.a >= u_termination;
}

// A ray that ended early would have become opaque: what it lacks is in the colour it has.
vec4 ray_end() {
    return gathered.a >= u_termination ? vec4(gathered.rgb / gathered.a, 1.0) : gathered;
}
