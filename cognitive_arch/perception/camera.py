"""The geometry of one camera: from places to pixels, and from pixels back to places.

A pixel's centre has whole coordinates: (0, 0) is the middle of the upper left one. The camera frame C looks
along its z axis, x is right in the image, y is down. All lengths are metres, in the world frame W.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError

Array = NDArray[np.float64]
MIN_DEPTH = 1e-6  # m in front of the camera that can still be projected


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera without distortion.

    `size` is (width, height) in pixels, `focal` the focal length and `centre` the principal point (x, y) in
    pixels, `X_WC` the camera's pose, (4, 4). Raises `PerceptionError` for what is no camera.
    """

    size: tuple[int, int]
    focal: float
    centre: tuple[float, float]
    X_WC: Array

    def __post_init__(self) -> None:
        X_WC = np.array(self.X_WC, dtype=np.float64)
        if min(self.size) < 1:
            raise PerceptionError(f"a camera of {self.size[0]}x{self.size[1]} pixels; valid: at least 1x1")
        if not (math.isfinite(self.focal) and self.focal > 0):
            raise PerceptionError(f"a focal length of {self.focal:g} pixels; valid: more than 0")
        if not np.isfinite(self.centre).all():
            raise PerceptionError(f"a principal point of {self.centre}; valid: two finite numbers of pixels")
        if X_WC.shape != (4, 4) or not np.isfinite(X_WC).all():
            raise PerceptionError("a camera's pose is a matrix of 4 by 4 finite numbers")
        R = X_WC[:3, :3]
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
            raise PerceptionError("a camera's pose needs a rotation: its first three columns are none")
        if not np.allclose(X_WC[3], [0, 0, 0, 1]):
            raise PerceptionError("a camera's pose ends in the row 0 0 0 1")
        X_WC.setflags(write=False)
        object.__setattr__(self, "X_WC", X_WC)

    @classmethod
    def with_view(cls, size: tuple[int, int], view: float, X_WC: Array) -> Camera:
        """A camera that sees `view` radians from the upper to the lower border, its axis in the middle."""
        if not 0 < view < math.pi:
            raise PerceptionError(f"a field of view of {view:g} rad; valid: more than 0, less than pi")
        focal = size[1] / 2 / math.tan(view / 2)
        return cls(size, focal, ((size[0] - 1) / 2, (size[1] - 1) / 2), X_WC)

    @property
    def view(self) -> float:
        """Vertical field of view, radians."""
        return 2 * math.atan(self.size[1] / 2 / self.focal)

    @property
    def position(self) -> Array:
        """Where it is, (3,) metres."""
        place: Array = self.X_WC[:3, 3]
        return place

    def project(self, points: Array) -> Array:
        """Where `points` (n, 3), metres, are seen: (n, 2) pixels; NaN for what is not in front of it.

        They may lie outside of the image, or behind something.
        """
        points = _rows(points, 3, "points")
        p_C = (points - self.position) @ self.X_WC[:3, :3]
        depth = np.where(p_C[:, 2] > MIN_DEPTH, p_C[:, 2], np.nan)
        pixels: Array = self.focal * p_C[:, :2] / depth[:, None] + self.centre
        return pixels

    def ray(self, pixels: Array) -> Array:
        """Directions in W of what is seen at `pixels` (n, 2): (n, 3), 1 long along the camera's z axis."""
        pixels = _rows(pixels, 2, "pixels")
        d_C = np.column_stack([(pixels - self.centre) / self.focal, np.ones(len(pixels))])
        directions: Array = d_C @ self.X_WC[:3, :3].T
        return directions

    def to_plane(self, pixels: Array, height: float) -> Array:
        """Where the rays of `pixels` (n, 2) meet the level plane at `height`, metres: (n, 2), x and y.

        NaN for rays that never do (a camera that looks above the horizon).
        """
        directions = self.ray(pixels)
        return self.position[:2] + self._range(directions, height)[:, None] * directions[:, :2]

    def plane_covariance(
        self, pixels: Array, height: float, pixel_sigma: float = 0.5, height_sigma: float = 0.0
    ) -> Array:
        """How far off `to_plane` may be: (n, 2, 2), square metres.

        To first order, for errors of `pixel_sigma` pixels in both directions of the image and of
        `height_sigma` metres in the plane's height, all independent.
        """
        directions = self.ray(pixels)
        along = self._range(directions, height)
        slope = directions[:, :2] / directions[:, 2:]  # metres sideways per metre of height
        # A pixel more turns the ray by one of the camera's axes; the plane holds its height fixed.
        axes = self.X_WC[:3, :2].T / self.focal
        moved = along[:, None, None] * (axes[None, :, :2] - slope[:, None, :] * axes[None, :, 2:])
        by_pixel = np.einsum("nij,nik->njk", moved, moved) * pixel_sigma**2
        by_height = np.einsum("ni,nj->nij", slope, slope) * height_sigma**2
        covariance: Array = by_pixel + by_height
        return covariance

    def points(self, depth: NDArray[np.floating]) -> NDArray[np.float32]:
        """Places of all pixels of a depth image (height, width), metres along the camera's z axis:
        (height, width, 3), metres; NaN where the depth is not a finite number above 0."""
        width, height = self.size
        if depth.shape != (height, width):
            raise PerceptionError(f"a depth image of {depth.shape}; this camera's are {(height, width)}")
        R, place = self.X_WC[:3, :3].astype(np.float32), self.position.astype(np.float32)
        # The grid of rays is a sum of one part per column and one per row.
        x = ((np.arange(width) - self.centre[0]) / self.focal).astype(np.float32)
        y = ((np.arange(height) - self.centre[1]) / self.focal).astype(np.float32)
        known = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan).astype(np.float32)
        seen = np.empty((height, width, 3), np.float32)
        for axis in range(3):
            rays = (y * R[axis, 1] + R[axis, 2])[:, None] + (x * R[axis, 0])[None, :]
            np.multiply(rays, known, out=rays)
            np.add(rays, place[axis], out=seen[:, :, axis])
        return seen

    def _range(self, directions: Array, height: float) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (height - self.position[2]) / directions[:, 2]
        reached: Array = np.where((along > 0) & np.isfinite(along), along, np.nan)
        return reached


def _rows(values: Array, width: int, what: str) -> Array:
    rows = np.asarray(values, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != width:
        raise PerceptionError(f"{what} of shape {rows.shape}; valid: (n, {width})")
    return rows
