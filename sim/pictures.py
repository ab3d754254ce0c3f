"""Pictures of a scene, without a display: still ones, a video and a Meshcat recording of a trajectory.

They are taken in a copy of the scene, so that looking changes nothing in the simulation and can be done
afterwards just as well.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray
from PIL import Image
from pydrake.geometry import Meshcat, MeshcatParams, MeshcatVisualizer, MeshcatVisualizerParams, Role

from cognitive_arch.domain import Domain, Scene
from cognitive_arch.errors import StoreError
from cognitive_arch.perception.camera import Camera
from cognitive_arch.runlog.trajectory import Trajectory
from sim.eyes import EyePose
from sim.rendering import Pixels, Renderer, look_from
from sim.scenario import Fixed, build_scenario

LARGE, SMALL = (960, 720), (640, 480)  # pixels
SIDE_FROM, SIDE_TO, SIDE_VIEW = (-1.12, 0.60, 0.46), (-0.17, 0.02, 0.05), 0.75  # m, m, rad
VIDEO_FPS = 12.5
RECORDING_FPS, RECORDING_FRAMES = 5.0, 1200  # the viewer interpolates; more frames would take more than 15 MB
_FONT, _INK, _PAPER = cv2.FONT_HERSHEY_SIMPLEX, (30, 30, 30), (255, 255, 255)


class View(StrEnum):
    """From where a picture is taken."""

    SIDE = "side"
    EYE = "eye"


class Stage:
    """A scene that stands still until it is told how it looks."""

    def __init__(
        self, domain: Domain, scene: Scene, meshcat: Meshcat | None = None, fixed: Fixed | None = None
    ) -> None:
        scenario = build_scenario(domain, scene, fixed=fixed)
        self.plant, graph = scenario.plant, scenario.scene_graph
        self._renderer = None if meshcat is not None else Renderer(graph)
        if meshcat is not None:
            visual = MeshcatVisualizerParams(role=Role.kIllustration)
            MeshcatVisualizer.AddToBuilder(scenario.builder, graph, meshcat, visual)
        self.diagram = scenario.builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self._starts = {name: body.floating_positions_start() for name, body in scenario.objects.items()}
        self._eye = EyePose(self.plant, self._plant_context)

    def show(self, positions: NDArray[np.floating]) -> None:
        """Set all positions of the plant, in the simulation's order."""
        self.plant.SetPositions(self._plant_context, positions)

    def positions(self, trajectory: Trajectory) -> Iterator[NDArray[np.floating]]:
        """The plant's positions at every sample; raises `StoreError` for the trajectory of another scene."""
        if set(trajectory.object_names) != set(self._starts):
            raise StoreError(
                f"the trajectory is of {', '.join(trajectory.object_names)}, the scene has "
                f"{', '.join(sorted(self._starts))}"
            )
        unknown = [name for name in trajectory.joint_names if not self.plant.HasJointNamed(name)]
        if unknown:
            raise StoreError(f"the trajectory is of another robot: it has {', '.join(unknown[:3])}")
        joints = [self.plant.GetJointByName(name).position_start() for name in trajectory.joint_names]
        for sample in range(len(trajectory)):
            positions = np.zeros(self.plant.num_positions())
            positions[joints] = trajectory.joints[sample]
            for name, pose in zip(trajectory.object_names, trajectory.poses[sample], strict=True):
                start = self._starts[name]
                positions[start : start + 4] = pose[3:] / np.linalg.norm(pose[3:])
                positions[start + 4 : start + 7] = pose[:3]
            yield positions

    def picture(self, view: View, size: tuple[int, int] = SMALL) -> Pixels:
        """What is to be seen from there, `size` (width, height) in pixels."""
        assert self._renderer is not None, "a stage for Meshcat takes no pictures"
        if view is View.EYE:
            camera = self._eye.camera(self._plant_context, size)
        else:
            camera = Camera.with_view(size, SIDE_VIEW, look_from(SIDE_FROM, SIDE_TO).GetAsMatrix4())
        return self._renderer.color(self.context, camera)


def save_picture(pixels: Pixels, path: Path) -> None:
    """Write a PNG."""
    Image.fromarray(pixels).save(path)


def _evenly(trajectory: Trajectory, rate: float, most: int | None = None) -> list[int]:
    """Samples as near as can be to `rate` per second, at most `most`."""
    if len(trajectory) == 0:
        return []
    first, last = trajectory.time[0], trajectory.time[-1]
    n = round((last - first) * rate) + 1
    times = np.linspace(first, last, n if most is None else min(n, most))
    after = np.searchsorted(trajectory.time, times).clip(1, max(1, len(trajectory) - 1))
    if len(trajectory) == 1:
        return [0]
    nearer = times - trajectory.time[after - 1] < trajectory.time[after] - times
    return [int(i) for i in np.where(nearer, after - 1, after)]


def write_video(stage: Stage, trajectory: Trajectory, path: Path) -> None:
    """An MP4 of the side view at `VIDEO_FPS`, in real time, with the action's name in it."""
    if not (path.parent.is_dir() and os.access(path.parent, os.W_OK)):
        raise StoreError(f"cannot write the video '{path}': there is no folder for it that can be written to")
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), VIDEO_FPS, SMALL)
    if not writer.isOpened():
        raise StoreError(f"cannot write the video '{path}'")
    positions = list(stage.positions(trajectory))
    try:
        for sample in _evenly(trajectory, VIDEO_FPS):
            stage.show(positions[sample])
            frame = cv2.cvtColor(stage.picture(View.SIDE), cv2.COLOR_RGB2BGR)
            _write_on(frame, trajectory.labels[trajectory.label[sample]], (16, SMALL[1] - 20), 0.7)
            _write_on(frame, f"{trajectory.time[sample]:5.1f} s", (SMALL[0] - 100, 30), 0.55)
            writer.write(frame)
    finally:
        writer.release()


def _write_on(frame: MatLike, text: str, place: tuple[int, int], scale: float) -> None:
    """Dark letters on a light label, readable on anything; `place` is their lower left corner."""
    if text:
        (width, height), below = cv2.getTextSize(text, _FONT, scale, 2)
        corner = (place[0] + width + 6, place[1] + below)
        cv2.rectangle(frame, (place[0] - 6, place[1] - height - 6), corner, _PAPER, cv2.FILLED)
        cv2.putText(frame, text, place, _FONT, scale, _INK, 2, cv2.LINE_AA)


def write_recording(domain: Domain, scene: Scene, trajectory: Trajectory, path: Path) -> None:
    """One HTML file for any browser, which needs no network; the whole episode in below 15 MB."""
    meshcat = Meshcat(MeshcatParams(host="localhost", port=None, show_stats_plot=False))
    stage = Stage(domain, scene, meshcat)
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetCameraPose(SIDE_FROM, SIDE_TO)
    positions = list(stage.positions(trajectory))
    samples = _evenly(trajectory, RECORDING_FPS, RECORDING_FRAMES)
    meshcat.StartRecording(frames_per_second=VIDEO_FPS * 4, set_visualizations_while_recording=False)
    for sample in samples:
        stage.context.SetTime(float(trajectory.time[sample]))
        stage.show(positions[sample])
        stage.diagram.ForcedPublish(stage.context)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    path.write_text(meshcat.StaticHtml(), encoding="utf-8")
