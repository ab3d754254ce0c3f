"""How the explorer sees what it explores with and on: pictures from above, and the descriptors of blobs.

A thing lies alone on a table, the handle of a tool towards the robot; a camera `HEIGHT` above it looks
straight down, a millimetre a pixel. Depth tells what rises above the table, `perception.top_view` draws that
blob as from straight above at 1 mm per pixel, up being away from the robot, and `perception.descriptors`
describes it. The upper half of a tool is its effector half, the lower one its handle. So a thing that the
robot's own eyes see on its table, drawn by the same function, is described alike.

Hands are seen as in thesis Sec. 5.3.3: a picture of the body's model, the back of the hand up, fingers away
from the robot, without the arm.

Every thing has `VIEWS` views that differ a little in how it lies and in where the camera is.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from cognitive_arch.perception.camera import Camera
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.scene import SceneView
from cognitive_arch.perception.top_view import Mask, top_view
from cognitive_arch.shapes import Shape, ToolShape
from sim.hands import (
    BENDS,
    DRAWN_IN,
    PALM_SIGN,
    SIDES,
    Posture,
    carriage_name,
    finger_names,
    hand_links,
    knuckle_names,
)
from sim.rendering import Pixels, Renderer
from sim.scenario import add_robot, drake_shape, solid_parts
from sim.world import HOME

HEIGHT = 0.60  # m of the camera above the table
SIZE = (480, 480)  # pixels
VIEW = 2 * math.atan(SIZE[1] / 2 * 0.001 / HEIGHT)  # rad: a millimetre a pixel on the table
VIEWS = 8
ASIDE = 0.04  # m that the camera may be beside a thing
TURNED = 0.25  # rad that a tool may be turned from straight away
TABLE = (0.62, 0.50, 0.38)
DOWN = RotationMatrix(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))
"""The camera's axes: right in the picture is +y (the robot's right), down is +x (towards the robot)."""

Descriptors = dict[str, float]


def descriptors_of(shape: Shape, view: int = 0, yaw: float = 0.0) -> Descriptors:
    """`m_*` (effector half) and `h_*` (handle) of a tool, `o_*` (whole) of any other thing, by column name.

    `view` 0 is the thing straight on in the middle of the picture, 1 to `VIEWS` - 1 are a little different.
    The thing lies turned by `yaw` radians.
    """
    return _of_mask(blob_of(shape, view, yaw), isinstance(shape, ToolShape))


def hand_descriptors(posture: Posture, hand: str = "LeftHand", view: int = 0) -> Descriptors:
    """`m_*` (half with the fingers) and `h_*` (half at the wrist) of a bare hand, by column name."""
    return _of_mask(hand_blob(posture, hand, view), True)


def _of_mask(mask: Mask, manipulator: bool) -> Descriptors:
    found = describe(mask)
    if not manipulator:
        return {f"o_{name}": float(value) for name, value in found.whole.items()}
    top = {f"m_{name}": float(value) for name, value in found.top.items()}
    return top | {f"h_{name}": float(value) for name, value in found.bottom.items()}


def blob_of(shape: Shape, view: int = 0, yaw: float = 0.0) -> Mask:
    """The thing as seen from above, (h, w), turned by `yaw` radians."""
    raised, points = _seen(shape, view)
    # Drawn anew from above, it may be turned after the picture was taken.
    return top_view(raised, points @ RotationMatrix.MakeZRotation(yaw).matrix().T)


def picture_of(shape: Shape, view: int = 0) -> Pixels:
    """What the camera sees of it, (height, width, 3) RGB."""
    return _look(shape, view)[0]


@lru_cache(maxsize=1024)
def _seen(shape: Shape, view: int) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which pixels show the thing, cut to its box, and their places (n, 3), metres."""
    _, raised, points = _look(shape, view)
    rows, columns = np.flatnonzero(raised.any(axis=1)), np.flatnonzero(raised.any(axis=0))
    return raised[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].copy(), points


def _look(shape: Shape, view: int) -> tuple[Pixels, NDArray[np.bool_], NDArray[np.float64]]:
    """The picture, where the thing is in it, and the places (n, 3) of these pixels, metres."""
    turn = TURNED if isinstance(shape, ToolShape) else 0.0
    rng = np.random.default_rng([7, view])
    yaw, aside = (rng.uniform(-turn, turn), rng.uniform(-ASIDE, ASIDE, 2)) if view else (0.0, np.zeros(2))
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    X_WO = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [0.0, 0.0, shape.height / 2])
    for part in solid_parts(shape):
        solid = drake_shape(part.solid)
        color = np.array([0.2, 0.4, 0.7, 1.0])
        plant.RegisterVisualGeometry(plant.world_body(), X_WO @ part.X_OP, solid, part.label, color)
    table = RigidTransform([0.0, 0.0, -0.02])
    plant.RegisterVisualGeometry(
        plant.world_body(), table, Box(1.0, 1.0, 0.04), "table", np.array([*TABLE, 1.0])
    )
    plant.Finalize()
    renderer = Renderer(graph)
    context = builder.Build().CreateDefaultContext()
    camera = _camera(RigidTransform(DOWN, [*aside, HEIGHT]))
    color, depth = renderer.color(context, camera), renderer.depth(context, camera)
    seen = SceneView(color, depth, np.zeros(depth.shape, np.bool_), camera, 0.0)
    raised = seen.raised()
    return color, raised, seen.points[raised].astype(np.float64)


def _camera(X_WC: RigidTransform) -> Camera:
    return Camera.with_view(SIZE, VIEW, X_WC.GetAsMatrix4())


def hand_blob(posture: Posture, hand: str = "LeftHand", view: int = 0) -> Mask:
    """A bare hand as the robot's model of its body looks from above, (h, w)."""
    return _body().look(posture, hand, view)[1]


def hand_picture(posture: Posture, hand: str = "LeftHand", view: int = 0) -> Pixels:
    """What the camera sees of the body's model, (height, width, 3) RGB."""
    return _body().look(posture, hand, view)[0]


@lru_cache(maxsize=1)
def _body() -> _Body:
    return _Body()


class _Body:
    """The robot alone, to look at its hands."""

    def __init__(self) -> None:
        builder = DiagramBuilder()
        self.plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        add_robot(self.plant)
        self.plant.Finalize()
        self._renderer = Renderer(graph)
        self._diagram = builder.Build()

    def look(self, posture: Posture, hand: str, view: int) -> tuple[Pixels, Mask]:
        """Colour (height, width, 3), and the hand from above (h, w)."""
        side = SIDES[hand]
        plant, context = self.plant, self._diagram.CreateDefaultContext()
        plant_context = plant.GetMyMutableContextFromRoot(context)
        for name, angle in HOME.items():
            plant.GetJointByName(name).set_angle(plant_context, angle)
        for name, bend in zip(knuckle_names(side), BENDS[posture], strict=True):
            plant.GetJointByName(name).set_angle(plant_context, bend)
        for name in finger_names(side):
            plant.GetJointByName(name).set_translation(plant_context, 0.0)
        plant.GetJointByName(carriage_name(side)).set_translation(plant_context, DRAWN_IN)
        X_WH = plant.GetFrameByName(f"{side}_hand_dh_frame").CalcPoseInWorld(plant_context)
        # Axes of a hand that lies on a table: fingers away from the robot (-x), back up.
        back = -PALM_SIGN[side]
        R_HS = np.column_stack([[-1.0, 0.0, 0.0], np.cross([0.0, 0.0, back], [-1.0, 0.0, 0.0]), [0, 0, back]])
        rng = np.random.default_rng([11, view])
        tilt, turn = (rng.normal(0.0, 0.06, 2), rng.uniform(-TURNED, TURNED)) if view else (np.zeros(2), 0.0)
        X_WS = X_WH @ RigidTransform(RotationMatrix(R_HS), [0.02, 0.0, 0.0])
        X_WS = X_WS @ RigidTransform(RollPitchYaw(tilt[0], tilt[1], turn), np.zeros(3))
        camera = _camera(X_WS @ RigidTransform(DOWN, [0.0, 0.0, HEIGHT]))
        links = [int(plant.GetBodyByName(link).index()) for link in (*hand_links(side), f"{side}_hand")]
        mask = np.isin(self._renderer.labels(context, camera), links)
        points = camera.points(self._renderer.depth(context, camera))[mask]
        local = (X_WS.inverse() @ points.astype(np.float64).T).T
        return self._renderer.color(context, camera), top_view(mask, local)
