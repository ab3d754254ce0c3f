"""Where on the table a pixel is: a camera and a table, as a file tells them, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError

from cognitive_arch.domain import explain_invalid, read_yaml
from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.camera import Array, Camera
from cognitive_arch.shapes import Frozen

Row = tuple[float, float, float, float]
ROUNDING = 2e-3  # by which a rotation's numbers may be off
FAR = 100.0  # m: what is seen farther away than that is on no table


class CalibrationFile(Frozen):
    """One file: `size` (width, height) of the pictures and `focal` length in pixels, `centre` the principal
    point (their middle if not given), `pose` the rows of X_WC, metres; `table` the height of its top, metres.

    `pixel_sigma` pixels is how far off a blob's middle may be, `height_sigma` metres how far from the table's
    top what is seen there (half a thing's height).
    """

    size: tuple[int, int]
    focal: float
    centre: tuple[float, float] | None = None
    pose: tuple[Row, Row, Row, Row]
    table: float
    pixel_sigma: Annotated[float, Field(ge=0)] = 0.5
    height_sigma: Annotated[float, Field(ge=0)] = 0.01


@dataclass(frozen=True, eq=False)
class TableView:
    """A camera that looks at a table whose top is at the height `table`, metres; see `CalibrationFile`."""

    camera: Camera
    table: float
    pixel_sigma: float = 0.5
    height_sigma: float = 0.01

    def check(self, size: tuple[int, int]) -> None:
        """Raise `PerceptionError` for pictures of another size (width, height) than this camera's."""
        if size != self.camera.size:
            raise PerceptionError(
                f"a picture of {size[0]}x{size[1]} pixels; "
                f"this camera's are {self.camera.size[0]}x{self.camera.size[1]}"
            )

    def place(self, pixel: tuple[float, float]) -> dict[str, Any] | None:
        """Where on the table the pixel (x, y) is, as plain data: `position` [x, y] metres and `covariance`
        [[xx, xy], [xy, yy]] square metres; None where its ray does not meet the table within `FAR` metres."""
        pixels = np.array([pixel])
        (position,) = self.camera.to_plane(pixels, self.table)
        if not (np.isfinite(position).all() and math.dist(position, self.camera.position[:2]) < FAR):
            return None
        (covariance,) = self.camera.plane_covariance(pixels, self.table, self.pixel_sigma, self.height_sigma)
        return {"position": position.round(6).tolist(), "covariance": covariance.round(12).tolist()}


def _unrounded(X_WC: Array) -> Array:
    """The pose with the nearest rotation: three digits in a file are none, to the last digit."""
    left, _, right = np.linalg.svd(X_WC[:3, :3])
    if np.allclose(left @ right, X_WC[:3, :3], atol=ROUNDING):
        X_WC[:3, :3] = left @ right
    return X_WC


def read_calibration(path: Path) -> TableView:
    """A YAML or JSON file with the fields of `CalibrationFile`; raises `ConfigError` naming file and field,
    `PerceptionError` for what is no camera."""
    try:
        told = CalibrationFile.model_validate(read_yaml(path, "camera"))
    except ValidationError as error:
        raise explain_invalid(error, path, CalibrationFile) from None
    width, height = told.size
    centre = told.centre or ((width - 1) / 2, (height - 1) / 2)
    camera = Camera(told.size, told.focal, centre, _unrounded(np.array(told.pose)))
    return TableView(camera, told.table, told.pixel_sigma, told.height_sigma)
