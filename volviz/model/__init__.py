"""Frozen dataclasses: volume, transfer function, camera, scene, frame. They know numpy alone."""
