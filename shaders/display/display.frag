#version 330 core
// From gathered linear light to the screen: mean of the samples, over the background, encoded once.
in vec2 v_ndc;
out vec4 o_color;

uniform sampler2D u_light;     // sum of premultiplied linear light
uniform float u_weight;        // 1 / number of samples
uniform vec4 u_background_top; // linear light, premultiplied
uniform vec4 u_background_bottom;
uniform vec2 u_vertical;       // height in the whole picture (0..1) = ndc.y * x + y

vec3 encode(vec3 light) {
    vec3 v = clamp(light, 0.0, 1.0);
    return mix(1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, v * 12.92, lessThanEqual(v, vec3(0.0031308)));
}

void main() {
    vec4 light = texture(u_light, v_ndc * 0.5 + 0.5) * u_weight;
    vec4 ground = mix(u_background_bottom, u_background_top, v_ndc.y * u_vertical.x + u_vertical.y);
    vec4 shown = light + (1.0 - light.a) * ground;
    // straight alpha: PNG and windows want colour and opacity apart
    o_color = vec4(encode(shown.a > 0.0 ? shown.rgb / shown.a : vec3(0.0)), shown.a);
}
