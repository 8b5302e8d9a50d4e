uniform isampler3D u_texture;
