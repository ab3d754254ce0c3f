"""The robot's eyes: colour and depth from where they are, and which pixels show the robot itself.

They look at a copy of the scene, so that looking changes nothing in the simulation. What the robot knows of
its own body it knows from its joints: its arms and hands are rendered alone, where the joints say they are,
and what is seen there, and not nearer, is its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context, DiagramBuilder

from cognitive_arch.domain import Domain, Scene
from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.camera import Camera
from sim.rendering import ROOM, Depth, Light, Pixels, Renderer, look_from
from sim.scenario import add_robot, build_scenario

EYE_SIZE = (640, 480)  # pixels
# Sitting upright. Leaning as at home, the table is in view from x = -0.20 to -0.80 m and |y| <= 0.35 m.
EYE_FROM, EYE_TO, EYE_VIEW = (-0.17, 0.0, 0.34), (-0.458, 0.0, -0.10), 1.25  # m, m, rad
SELF_TOLERANCE = 0.004  # m by which the robot may be nearer than its joints tell
NOISES = 4.0  # standard deviations of depth noise that are added to it


@dataclass(frozen=True)
class EyeNoise:
    """Gaussian noise of the sensors: `color` in grey levels, `depth` in metres at 1 m distance, growing
    with the square of the distance, as it does for two cameras side by side."""

    color: float = 0.0
    depth: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.color <= 255 and 0 <= self.depth <= 1):
            raise PerceptionError(
                f"noise of {self.color:g} grey levels and {self.depth:g} m; valid: 0 to 255 and 0 to 1"
            )


IDEAL = EyeNoise()
# About what a camera for colour and depth has at half a metre to a metre: 1 to 2 mm over the table.
SENSOR = EyeNoise(color=2.0, depth=0.004)


@dataclass(frozen=True, eq=False)
class EyeImage:
    """One look: `color` (height, width, 3) uint8 RGB, `depth` (height, width) float32 metres along the
    view, infinite where nothing is, `own` (height, width) bool, the robot's own body, and the camera."""

    color: Pixels
    depth: Depth
    own: NDArray[np.bool_]
    camera: Camera


class EyePose:
    """Where the eyes of one plant are: fixed in the head, which the torso moves."""

    def __init__(self, plant: MultibodyPlant, upright: Context) -> None:
        self._head = plant.GetFrameByName("head")
        self._X_HC = self._head.CalcPoseInWorld(upright).inverse() @ look_from(EYE_FROM, EYE_TO)

    def camera(self, plant_context: Context, size: tuple[int, int] = EYE_SIZE) -> Camera:
        """The eyes as the joints in `plant_context` carry them."""
        X_WC: RigidTransform = self._head.CalcPoseInWorld(plant_context) @ self._X_HC
        return Camera.with_view(size, EYE_VIEW, X_WC.GetAsMatrix4())


class _Body:
    """The robot alone, as its joints say."""

    def __init__(self) -> None:
        builder = DiagramBuilder()
        self.plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        self.instance: ModelInstanceIndex = add_robot(self.plant)
        self.plant.Finalize()
        self._renderer = Renderer(graph)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self._context)
        self._pose = EyePose(self.plant, self._plant_context)

    def feel(self, joints: NDArray[np.floating], size: tuple[int, int]) -> tuple[Camera, Depth]:
        """From where the eyes look and how far away the body is from them, for the robot's positions."""
        self.plant.SetPositions(self._plant_context, joints)
        camera = self._pose.camera(self._plant_context, size)
        return camera, self._renderer.depth(self._context, camera)


class Eyes:
    """Looks at the objects of one scene; raises `BackendError` where nothing can be rendered."""

    def __init__(
        self,
        domain: Domain,
        scene: Scene,
        *,
        size: tuple[int, int] = EYE_SIZE,
        lights: Sequence[Light] = ROOM,
        shadows: bool = False,
        noise: EyeNoise | None = None,
    ) -> None:
        scenario = build_scenario(domain, scene)
        self.plant, self._robot = scenario.plant, scenario.robot
        self._renderer = Renderer(scenario.scene_graph, lights, shadows=shadows)
        self._diagram = scenario.builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self._context)
        self._body = _Body()
        self._size = size
        self._noise = noise or EyeNoise()

    @property
    def noisy(self) -> bool:
        """Whether depth as seen has noise."""
        return self._noise.depth > 0

    def look(self, positions: NDArray[np.floating], rng: np.random.Generator | None = None) -> EyeImage:
        """What is seen when the simulation's plant has these `positions`, (n_positions,).

        `rng` draws the noise, if there is any; without it there is none.
        """
        self.plant.SetPositions(self._plant_context, positions)
        camera, own_depth = self._body.feel(
            self.plant.GetPositionsFromArray(self._robot, positions), self._size
        )
        color = self._renderer.color(self._context, camera)
        depth = self._renderer.depth(self._context, camera)
        if rng is not None:
            color, depth = self._disturbed(color, depth, rng)
        own = np.isfinite(own_depth)
        tolerance = SELF_TOLERANCE + NOISES * self._noise.depth * np.square(own_depth[own])
        own[own] = own_depth[own] <= depth[own] + tolerance
        return EyeImage(color, depth, own, camera)

    def _disturbed(self, color: Pixels, depth: Depth, rng: np.random.Generator) -> tuple[Pixels, Depth]:
        noise = self._noise
        if noise.color > 0:
            shades = color + np.float32(noise.color) * rng.standard_normal(color.shape, dtype=np.float32)
            color = np.clip(np.rint(shades), 0, 255).astype(np.uint8)
        if noise.depth > 0:
            errors = rng.standard_normal(depth.shape, dtype=np.float32)
            seen = np.isfinite(depth)
            depth = np.array(depth)
            depth[seen] += np.float32(noise.depth) * np.square(depth[seen]) * errors[seen]
        return color, depth
