uniform usampler3D u_texture;
