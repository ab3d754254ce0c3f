"""Rendering without a display: colour and depth of a scene, as a camera sees it under given lights."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    QueryObject,
    RenderCameraCore,
    RenderEngineVtkParams,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context
from pydrake.systems.sensors import CameraInfo

from cognitive_arch.errors import BackendError
from cognitive_arch.perception.camera import Camera

Pixels = NDArray[np.uint8]  # (height, width, 3), RGB
Depth = NDArray[np.float32]  # (height, width), metres along the camera's z axis, infinite where nothing is
RENDERER = "camera"
NEAREST, FARTHEST = 0.03, 5.0  # m
WALLS = (0.90, 0.93, 0.96)  # what is seen beyond the table


@dataclass(frozen=True)
class Light:
    """Light that shines along `direction` everywhere; `color` is red, green, blue in 0..1."""

    direction: tuple[float, float, float]
    intensity: float
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)


# A lamp above, a window behind the robot, and what walls throw back: no side of a thing stays black.
ROOM: tuple[Light, ...] = (
    Light((0.25, -0.3, -1.0), 0.62),
    Light((-0.9, 0.25, -0.55), 0.38),
    Light((1.0, 0.4, -0.25), 0.35),
    Light((0.1, -1.0, -0.3), 0.25),
)


def check_rendering() -> None:
    """Raise `BackendError` where the system library for rendering is missing."""
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError:
        raise BackendError(
            "eyes and pictures need the system library libEGL; install it "
            "(Debian, Ubuntu: sudo apt-get install libegl1) or run with --perception oracle --no-record"
        ) from None


def look_from(p_WC: Sequence[float], p_WT: Sequence[float]) -> RigidTransform:
    """X_WC of a camera at `p_WC` that looks at `p_WT` (z forward, y down)."""
    forward = np.subtract(p_WT, p_WC)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    R_WC = RotationMatrix(np.column_stack([right, np.cross(forward, right), forward]))
    return RigidTransform(R_WC, p_WC)


class Renderer:
    """Pictures of one scene graph. Make it before the diagram is built; lights stay as they are.

    With `shadows` the lights cast hard ones; a picture then takes about 0.1 s more.
    """

    def __init__(
        self,
        scene_graph: SceneGraph,
        lights: Sequence[Light] = ROOM,
        *,
        shadows: bool = False,
        walls: tuple[float, float, float] = WALLS,
    ) -> None:
        check_rendering()
        self._graph = scene_graph
        params = RenderEngineVtkParams(
            default_clear_color=list(walls),
            lights=[
                LightParameter(
                    type="directional",
                    direction=list(light.direction),
                    intensity=light.intensity,
                    color=Rgba(*light.color, 1.0),
                    frame="world",
                )
                for light in lights
            ],
            cast_shadows=shadows,
            shadow_map_size=1024,
        )
        scene_graph.AddRenderer(RENDERER, MakeRenderEngineVtk(params))

    def color(self, context: Context, camera: Camera) -> Pixels:
        """What the camera sees, for the diagram's `context`."""
        wanted = ColorRenderCamera(_core(camera), False)
        query, X_WC = self._query(context), RigidTransform(camera.X_WC)
        image = query.RenderColorImage(wanted, self._graph.world_frame_id(), X_WC)
        return np.array(image.data[:, :, :3], dtype=np.uint8)

    def depth(self, context: Context, camera: Camera) -> Depth:
        """How far away it is."""
        wanted = DepthRenderCamera(_core(camera), DepthRange(NEAREST, FARTHEST))
        query, X_WC = self._query(context), RigidTransform(camera.X_WC)
        image = query.RenderDepthImage(wanted, self._graph.world_frame_id(), X_WC)
        return np.array(image.data[:, :, 0], dtype=np.float32)

    def labels(self, context: Context, camera: Camera) -> NDArray[np.int16]:
        """Which body is seen in every pixel: its index in the plant. For making examples, not for seeing."""
        wanted = ColorRenderCamera(_core(camera), False)
        query, X_WC = self._query(context), RigidTransform(camera.X_WC)
        image = query.RenderLabelImage(wanted, self._graph.world_frame_id(), X_WC)
        return np.array(image.data[:, :, 0], dtype=np.int16)

    def _query(self, context: Context) -> QueryObject:
        return self._graph.get_query_output_port().Eval(self._graph.GetMyContextFromRoot(context))


def _core(camera: Camera) -> RenderCameraCore:
    # The renderer counts from the corner of the first pixel, the camera from its middle: without this
    # every place on the table would be off by a millimetre.
    x, y = (coordinate + 0.5 for coordinate in camera.centre)
    lens = CameraInfo(*camera.size, camera.focal, camera.focal, x, y)
    return RenderCameraCore(RENDERER, lens, ClippingRange(0.02, 6.0), RigidTransform())
