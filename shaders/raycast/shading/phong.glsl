// Needs: lighting. Provides: shade by Phong 1975: highlight from the mirrored lamp, R.V.
vec3 shade(vec3 color, vec3 at, float value, vec3 view) {
    vec3 normal = surface_normal(at, value, view);
    if (normal == vec3(0.0)) return color * (u_material.x + u_material.y);
    float diffuse = max(dot(normal, u_lamp), 0.0);
    float shine = max(dot(reflect(-u_lamp, normal), view), 0.0);
    float highlight = diffuse > 0.0 ? u_material.z * pow(shine, u_material.w) : 0.0;
    return color * (u_material.x + u_material.y * diffuse) + highlight;
}
