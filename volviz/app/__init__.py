"""The running viewer without its window: scenes, loading, messages, settings; no OpenGL."""

from volviz.app.viewer import App

__all__ = ["App"]
