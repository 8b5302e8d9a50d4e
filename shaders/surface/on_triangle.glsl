// Where this fragment of the surface is, in the axes of the eye.
vec3 surface_eye() {
    return v.eye;
}
