"""Pictures and recordings of an episode, without a display."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from cognitive_arch.errors import BackendError
from sim.world import RECORDING_FPS, World

RENDERER = "pictures"
WIDTH, HEIGHT, FIELD_OF_VIEW = 960, 720, 0.75  # pixels, pixels, radians
RECORDING_LIMIT = 240.0  # simulated s
CAMERA_FROM, CAMERA_TO = (-1.12, 0.60, 0.46), (-0.17, 0.02, 0.05)  # m


def look_from(p_WC: Sequence[float], p_WT: Sequence[float]) -> RigidTransform:
    """X_WC of a camera at `p_WC` that looks at `p_WT` (z forward, y down)."""
    forward = np.subtract(p_WT, p_WC)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    R_WC = RotationMatrix(np.column_stack([right, np.cross(forward, right), forward]))
    return RigidTransform(R_WC, p_WC)


def check_rendering() -> None:
    """Raise `BackendError` where the system library for rendering is missing."""
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError:
        raise BackendError(
            "pictures need the system library libEGL; install it "
            "(Debian, Ubuntu: sudo apt-get install libegl1) or run with --no-record"
        ) from None


class Photographer:
    """Takes pictures of a world and records it in Meshcat."""

    def __init__(self, world: World) -> None:
        check_rendering()
        self._world = world
        self._pictures: dict[str, NDArray[np.uint8]] = {}
        lights = [
            LightParameter(type="directional", direction=[0.4, -0.3, -1.0], intensity=0.9, frame="world"),
            LightParameter(type="directional", direction=[1.0, 0.3, -0.25], intensity=0.55, frame="world"),
            LightParameter(type="directional", direction=[0.1, -1.0, -0.3], intensity=0.45, frame="world"),
        ]
        params = RenderEngineVtkParams(default_clear_color=[0.90, 0.93, 0.96], lights=lights)
        world.scenario.scene_graph.AddRenderer(
            world.scenario.scene_graph.GetMyMutableContextFromRoot(world.simulator.get_mutable_context()),
            RENDERER,
            MakeRenderEngineVtk(params),
        )
        core = RenderCameraCore(
            RENDERER, CameraInfo(WIDTH, HEIGHT, FIELD_OF_VIEW), ClippingRange(0.02, 6.0), RigidTransform()
        )
        self._camera = ColorRenderCamera(core, False)

    def start(self) -> None:
        """Begin a recording; an earlier one is forgotten."""
        self._pictures.clear()
        meshcat = self._world.meshcat
        assert meshcat is not None
        meshcat.DeleteRecording()
        meshcat.SetProperty("/Grid", "visible", False)
        meshcat.SetProperty("/Axes", "visible", False)
        meshcat.SetCameraPose(CAMERA_FROM, CAMERA_TO)
        meshcat.StartRecording(frames_per_second=RECORDING_FPS, set_visualizations_while_recording=False)

    def after_action(self) -> None:
        """Keep the recording below 15 MB: an episode this long has shown what there is to see."""
        if self._world.time > RECORDING_LIMIT and self._world.meshcat is not None:
            self._world.meshcat.StopRecording()

    def take(self, name: str) -> None:
        """Take a picture of the present moment."""
        graph = self._world.scenario.scene_graph
        context = graph.GetMyContextFromRoot(self._world.simulator.get_context())
        query = graph.get_query_output_port().Eval(context)
        X_WC = look_from(CAMERA_FROM, CAMERA_TO)
        image = query.RenderColorImage(self._camera, graph.world_frame_id(), X_WC)
        self._pictures[name] = np.array(image.data[:, :, :3], dtype=np.uint8)

    def save(self, folder: Path) -> tuple[str, ...]:
        """Write all pictures and the recording into `folder`; returns the file names."""
        names = []
        for name, pixels in self._pictures.items():
            Image.fromarray(pixels).save(folder / f"{name}.png", optimize=True)
            names.append(f"{name}.png")
        meshcat = self._world.meshcat
        assert meshcat is not None
        meshcat.StopRecording()
        meshcat.PublishRecording()
        (folder / "recording.html").write_text(meshcat.StaticHtml(), encoding="utf-8")
        return (*names, "recording.html")
