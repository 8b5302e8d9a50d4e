"""What the field's own readers say about a file: values, and where three corner voxels lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from volviz.model.volume import Volume

RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


def corners(dims: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Three voxels that fix where a grid lies."""
    nx, ny, nz = dims[:3]
    return [(0, 0, 0), (nx - 1, 0, nz - 1), (nx - 1, ny - 1, 0)]


def places(volume: Volume) -> np.ndarray:
    """World positions, mm LPS, of `corners`."""
    return np.array([(volume.affine @ (*c, 1))[:3] for c in corners(volume.dims)])


def same_as_simpleitk(volume: Volume, path: Path) -> None:
    """Values equal, corners within 1e-4 mm."""
    import SimpleITK as sitk

    image = sitk.ReadImage(str(path))
    np.testing.assert_array_equal(volume.data, sitk.GetArrayFromImage(image))
    expected = [image.TransformIndexToPhysicalPoint(c) for c in corners(volume.dims)]
    np.testing.assert_allclose(places(volume), expected, atol=1e-4)


def same_as_nibabel(volume: Volume, path: Path, index: tuple[int, ...] = ()) -> None:
    """Values equal (to float32), corners within 1e-4 mm. index: of the axes after x, y, z."""
    import nibabel as nib

    image = nib.load(path)
    data = np.asarray(image.dataobj)
    data = data[(slice(None), slice(None), slice(None), *index)] if index else data
    expected = data.T.astype(volume.data.dtype)
    np.testing.assert_allclose(volume.data, expected, rtol=1e-6)
    affine = RAS_TO_LPS @ image.affine
    where = [(affine @ (*c, 1))[:3] for c in corners(volume.dims)]
    np.testing.assert_allclose(places(volume), where, atol=1e-4)
