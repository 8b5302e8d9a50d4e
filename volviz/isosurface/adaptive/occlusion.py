"""What blocks hide: boxes against the picture's frame and against the triangles in front of them.

The depth of the triangles so far is kept at the middles of the picture's pixels. A box is hidden
if every pixel that it may touch, and one more all round, has something nearer.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.adaptive.leaves import row
from volviz.isosurface.kernel import inline

SEEN, OUTSIDE, HIDDEN = 0, 1, 2
_NEAR = 1e-6
_ROUND = 2e-7  # of a distance, more than a float32 rounds


@inline
def judged(sight: Any, depth: Any, box: Any) -> int:
    """SEEN, OUTSIDE or HIDDEN: of a box, its least and greatest index coordinates x, y, z."""
    out = np.zeros(5, np.int64)  # corners beyond each side of the frame, and behind the camera
    low_x = low_y = nearest = np.inf
    high_x = high_y = -np.inf
    wide, high = sight.half
    for c in range(8):
        x = box[3] if c & 1 else box[0]
        y = box[4] if c & 2 else box[1]
        z = box[5] if c & 4 else box[2]
        a, b, d = row(sight.eye, 0, x, y, z), row(sight.eye, 1, x, y, z), row(sight.eye, 2, x, y, z)
        w = d if sight.perspective else 1.0
        out[0] += a < -wide * w
        out[1] += a > wide * w
        out[2] += b < -high * w
        out[3] += b > high * w
        out[4] += w <= _NEAR * sight.side
        nearest = min(nearest, d)
        if out[4] == 0:
            low_x, high_x = min(low_x, a / (wide * w)), max(high_x, a / (wide * w))
            low_y, high_y = min(low_y, b / (high * w)), max(high_y, b / (high * w))
    if out.max() == 8:
        return OUTSIDE
    if out[4] or depth.size == 0:
        return SEEN
    h, w = depth.shape
    left = max(int(np.floor((low_x + 1) / 2 * w)) - 1, 0)
    right = min(int(np.floor((high_x + 1) / 2 * w)) + 1, w - 1)
    low = max(int(np.floor((low_y + 1) / 2 * h)) - 1, 0)
    top = min(int(np.floor((high_y + 1) / 2 * h)) + 1, h - 1)
    for j in range(low, top + 1):
        for i in range(left, right + 1):
            if depth[j, i] >= nearest:
                return SEEN
    return HIDDEN


@inline
def projected(sight: Any, depth: Any, corners: Any, out: Any) -> None:
    """Where a triangle is in the picture: float32[7], pixels x, y of its corners, and how far its
    farthest corner is; infinitely far if one is behind the camera.

    corners: float64[3, 3], index coordinates.
    """
    h, w = depth.shape
    far = -np.inf
    for k in range(3):
        x, y, z = corners[k, 0], corners[k, 1], corners[k, 2]
        d = row(sight.eye, 2, x, y, z)
        scale = d if sight.perspective else 1.0
        if scale <= _NEAR * sight.side:
            out[6] = np.inf
            return
        out[2 * k] = (row(sight.eye, 0, x, y, z) / (sight.half[0] * scale) + 1) / 2 * w - 0.5
        out[2 * k + 1] = (row(sight.eye, 1, x, y, z) / (sight.half[1] * scale) + 1) / 2 * h - 0.5
        far = max(far, d)
    out[6] = far + _ROUND * abs(far)


@inline
def hide(depth: Any, triangle: Any) -> None:
    """Enter a triangle, as `projected` gives it."""
    far = np.float64(triangle[6])
    if far == np.inf:
        return
    h, w = depth.shape
    x0, y0 = np.float64(triangle[0]), np.float64(triangle[1])
    x1, y1 = np.float64(triangle[2]), np.float64(triangle[3])
    x2, y2 = np.float64(triangle[4]), np.float64(triangle[5])
    left, right = max(int(np.ceil(min(x0, x1, x2))), 0), min(int(np.floor(max(x0, x1, x2))), w - 1)
    low, top = max(int(np.ceil(min(y0, y1, y2))), 0), min(int(np.floor(max(y0, y1, y2))), h - 1)
    ax, ay, bx, by = x1 - x0, y1 - y0, x2 - x0, y2 - y0
    area = ax * by - ay * bx
    if area == 0:
        return
    for j in range(low, top + 1):
        for i in range(left, right + 1):
            px, py = i - x0, j - y0
            u, v = (px * by - py * bx) / area, (ax * py - ay * px) / area
            if u >= 0 and v >= 0 and u + v <= 1 and far < depth[j, i]:
                depth[j, i] = far
