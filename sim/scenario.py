"""What stands in the room: the robot, a table, and the objects of a scene, in one discrete plant.

Contact is point contact. Flat faces that only touch in a few corners creep, so every object carries rings
of small spheres on its underside, an outer and an inner one: the inner ring keeps a square slice from
sinking into a round one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    CollisionFilterDeclaration,
    Cylinder,
    GeometrySet,
    ProximityProperties,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    ModelInstanceIndex,
    PdControllerGains,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import DiagramBuilder

from cognitive_arch import domain as dom
from cognitive_arch.domain import Domain, ObjectSpec, Scene
from sim.assets import robot_urdf
from sim.hands import PAD_RADIUS, PAD_STIFFNESS

TIME_STEP = 0.004  # s
TABLE_SIZE = (0.70, 0.90, 0.04)  # m
TABLE_CENTRE_X = -0.50  # m
FRICTION = 0.8
DISSIPATION = 1.0  # s/m, of the contact model
GAINS: Mapping[str, tuple[float, float]] = {  # N m/rad and N m s/rad; N/m and N s/m for the fingers
    "torso": (3000.0, 150.0),
    "shoulder": (1500.0, 60.0),
    "elbow": (800.0, 30.0),
    "wrist": (200.0, 6.0),
    "finger": (400.0, 20.0),
}
ROTOR_INERTIA, GEAR_RATIO = 1e-5, 100.0
_TABLE_COLOR = [0.62, 0.50, 0.38, 1.0]
_LEG_COLOR = [0.35, 0.30, 0.26, 1.0]


@dataclass(frozen=True)
class Scenario:
    """The finished plant and its parts; not yet part of a simulator."""

    builder: DiagramBuilder
    plant: MultibodyPlant
    scene_graph: SceneGraph
    robot: ModelInstanceIndex
    table: RigidBody
    objects: Mapping[str, RigidBody]


def build_scenario(domain: Domain, scene: Scene, *, friction: float = FRICTION) -> Scenario:
    """Put robot, table and the scene's objects into one plant and finalise it."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    plant.set_contact_model(ContactModel.kPoint)
    robot = add_robot(plant)
    table = _add_table(plant, scene.table.height, friction)
    objects = {name: _add_object(plant, name, domain.objects[name], friction) for name in scene.things}
    _set_gains(plant)
    # The real arms compensate gravity in their controllers; the objects they carry still weigh.
    plant.set_gravity_enabled(robot, False)
    plant.Finalize()
    _let_robot_overlap_itself(plant, scene_graph, robot)
    return Scenario(builder, plant, scene_graph, robot, table, objects)


def add_robot(plant: MultibodyPlant) -> ModelInstanceIndex:
    """Add the iCub with its root frame fixed to the world: world frame and root frame are one."""
    (robot,) = Parser(plant).AddModels(str(robot_urdf()))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("root_link", robot))
    return robot


def _contact(friction: float) -> ProximityProperties:
    properties = ProximityProperties()
    AddContactMaterial(DISSIPATION, PAD_STIFFNESS, CoulombFriction(friction, friction), properties)
    return properties


def _add_table(plant: MultibodyPlant, height: float, friction: float) -> RigidBody:
    # A body of its own: joints cannot be locked while geometry of the world body itself is in contact.
    depth = TABLE_SIZE[2]
    instance = plant.AddModelInstance("table")
    inertia = SpatialInertia(20.0, np.zeros(3), UnitInertia.SolidBox(*TABLE_SIZE))
    table = plant.AddRigidBody("table", instance, inertia)
    X_WT = RigidTransform([TABLE_CENTRE_X, 0.0, height - depth / 2])
    plant.WeldFrames(plant.world_frame(), table.body_frame(), X_WT)
    top = Box(*TABLE_SIZE)
    plant.RegisterCollisionGeometry(table, RigidTransform(), top, "table_top", _contact(friction))
    plant.RegisterVisualGeometry(table, RigidTransform(), top, "table_top", _TABLE_COLOR)
    length = 0.42
    for i, (sx, sy) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
        X_TL = RigidTransform(
            [sx * (TABLE_SIZE[0] / 2 - 0.03), sy * (TABLE_SIZE[1] / 2 - 0.03), -depth / 2 - length / 2]
        )
        plant.RegisterVisualGeometry(table, X_TL, Box(0.04, 0.04, length), f"table_leg_{i}", _LEG_COLOR)
    return table


def drake_shape(shape: dom.Cylinder | dom.Box | dom.Sphere) -> Shape:
    """Drake's shape for one of ours."""
    if isinstance(shape, dom.Cylinder):
        return Cylinder(shape.radius, shape.height)
    if isinstance(shape, dom.Box):
        return Box(*shape.size)
    return Sphere(shape.radius)


def tool_parts(tool: dom.ToolShape) -> Iterator[tuple[str, RigidTransform, dom.Box]]:
    """Shaft and cross bar of a tool in its body frame: origin mid-shaft, x along it, the bar at -x."""
    width = tool.width
    yield "shaft", RigidTransform(), dom.Box(type="box", size=(tool.length, width, width))
    if tool.bar > 0:
        X_OB = RigidTransform([-tool.length / 2 + width / 2, 0, 0])
        yield "bar", X_OB, dom.Box(type="box", size=(width, tool.bar, width))


def object_inertia(spec: ObjectSpec) -> SpatialInertia:
    """Inertia of a solid of uniform density (kg, m), about the body origin."""
    shape = spec.shape
    if isinstance(shape, dom.ToolShape):
        parts = [(X_OP.translation(), part.size) for _, X_OP, part in tool_parts(shape)]
        volumes = [float(np.prod(size)) for _, size in parts]
        total = SpatialInertia.Zero()
        for (p_OP, size), volume in zip(parts, volumes, strict=True):
            mass = spec.mass * volume / sum(volumes)
            total += SpatialInertia(mass, np.zeros(3), UnitInertia.SolidBox(*size)).Shift(-p_OP)
        return total
    if isinstance(shape, dom.Cylinder):
        unit = UnitInertia.SolidCylinder(shape.radius, shape.height, [0, 0, 1])
    elif isinstance(shape, dom.Box):
        unit = UnitInertia.SolidBox(*shape.size)
    else:
        unit = UnitInertia.SolidSphere(shape.radius)
    return SpatialInertia(spec.mass, np.zeros(3), unit)


def _add_object(plant: MultibodyPlant, name: str, spec: ObjectSpec, friction: float) -> RigidBody:
    body = plant.AddRigidBody(name, plant.AddModelInstance(name), object_inertia(spec))
    color = [*spec.color, 1.0]
    if isinstance(spec.shape, dom.ToolShape):
        parts = list(tool_parts(spec.shape))
    else:
        parts = [("body", RigidTransform(), spec.shape)]  # type: ignore[list-item]
    for part, X_OP, shape in parts:
        label = f"{name}_{part}"
        plant.RegisterVisualGeometry(body, X_OP, drake_shape(shape), label, color)
        _add_contact_geometry(plant, body, label, X_OP, shape, _contact(friction))
    return body


def _add_contact_geometry(
    plant: MultibodyPlant,
    body: RigidBody,
    label: str,
    X_OP: RigidTransform,
    shape: dom.Cylinder | dom.Box | dom.Sphere,
    properties: ProximityProperties,
) -> None:
    if isinstance(shape, dom.Sphere):
        plant.RegisterCollisionGeometry(body, X_OP, Sphere(shape.radius), label, properties)
        return
    # The core ends a little above the spheres' lowest points, so that the spheres carry the object.
    core = 0.001
    if isinstance(shape, dom.Cylinder):
        solid: Shape = Cylinder(shape.radius, shape.height - core)
    else:
        solid = Box(shape.size[0], shape.size[1], shape.size[2] - core)
    plant.RegisterCollisionGeometry(body, X_OP, solid, label, properties)
    z = -shape.height / 2 + PAD_RADIUS
    for i, (x, y) in enumerate(_pad_places(shape)):
        X_PS = RigidTransform([x, y, z])
        plant.RegisterCollisionGeometry(body, X_OP @ X_PS, Sphere(PAD_RADIUS), f"{label}_pad_{i}", properties)


def _pad_places(shape: dom.Cylinder | dom.Box) -> list[tuple[float, float]]:
    """Where the small spheres sit on the underside (metres): an outer and an inner ring, or a grid."""
    if isinstance(shape, dom.Cylinder):
        outer, inner = shape.radius - PAD_RADIUS, shape.radius * 0.55
        rings = [(outer, 8), (inner, 4)]
    elif max(shape.size[:2]) <= 0.08:
        half = min(shape.size[:2]) / 2 - PAD_RADIUS
        corners = [
            (sx * (shape.size[0] / 2 - PAD_RADIUS), sy * (shape.size[1] / 2 - PAD_RADIUS))
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]
        return corners + [
            (0.6 * half * math.cos(a), 0.6 * half * math.sin(a)) for a in np.arange(4) * math.pi / 2
        ]
    else:
        xs, ys = (
            np.linspace(-s / 2 + PAD_RADIUS, s / 2 - PAD_RADIUS, max(2, math.ceil(s / 0.06) + 1))
            for s in shape.size[:2]
        )
        return [(float(x), float(y)) for x in xs for y in ys]
    return [
        (r * math.cos(2 * math.pi * k / n), r * math.sin(2 * math.pi * k / n))
        for r, n in rings
        for k in range(n)
    ]


def _set_gains(plant: MultibodyPlant) -> None:
    # Before Finalize the list per model instance is empty; this form has all actuators.
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        kp, kd = next(gains for key, gains in GAINS.items() if key in actuator.name())
        actuator.set_controller_gains(PdControllerGains(p=kp, d=kd))
        if "finger" not in actuator.name():
            actuator.set_default_rotor_inertia(ROTOR_INERTIA)
            actuator.set_default_gear_ratio(GEAR_RATIO)


def _let_robot_overlap_itself(
    plant: MultibodyPlant, scene_graph: SceneGraph, robot: ModelInstanceIndex
) -> None:
    """The primitives of neighbouring links overlap by construction; only their contacts are dropped."""
    own = GeometrySet()
    for index in plant.GetBodyIndices(robot):
        frame = plant.GetBodyFrameIdIfExists(index)
        if frame is not None:
            own.Add(frame)
    scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(own))
