"""Contexts, shaders, passes, renderer. The only home of moderngl; it gets frames, never scenes."""
