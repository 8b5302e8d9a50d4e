"""Mesh → Mesh | number: weld, components, smooth, normals, decimate, lod, distance, measure."""
