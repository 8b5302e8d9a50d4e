"""One file per pass: `draw` with a frame into the bound framebuffer."""
