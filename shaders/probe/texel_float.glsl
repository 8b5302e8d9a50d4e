uniform sampler3D u_texture;
