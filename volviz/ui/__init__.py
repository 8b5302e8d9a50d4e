"""The window. The only home of imgui_bundle and of glfw windows."""
