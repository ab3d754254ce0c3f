"""What stands in the room: the robot, a table, and the objects of a scene, in one discrete plant.

Contact is point contact. Flat faces that only touch in a few corners creep, so every object carries rings
of small spheres on its underside, an outer and an inner one: the inner ring keeps a square slice from
sinking into a round one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    CalcVolume,
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
    BodyIndex,
    ModelInstanceIndex,
    PdControllerGains,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context, DiagramBuilder

from cognitive_arch import shapes
from cognitive_arch.domain import Domain, ObjectSpec, Scene
from sim.assets import robot_urdf
from sim.hands import PAD_RADIUS, PAD_STIFFNESS, is_hand_joint

TIME_STEP = 0.005  # s
TABLE_SIZE = (0.70, 0.90, 0.04)  # m
TABLE_CENTRE_X = -0.50  # m
FRICTION = 0.8
DISSIPATION = 1.0  # s/m, of the contact model
ROLLING_TIME = 0.15  # s in which what rolls loses 63 % of its speed
GAINS: Mapping[str, tuple[float, float]] = {  # N m/rad and N m s/rad; N/m and N s/m for the pads
    "torso": (3000.0, 150.0),
    "shoulder": (1500.0, 60.0),
    "elbow": (800.0, 30.0),
    "wrist": (200.0, 6.0),
    "finger": (400.0, 20.0),
    "carriage": (6000.0, 100.0),
    "knuckle": (10.0, 0.2),
}
PAD_SPACING = 0.12  # m at most between the small spheres under long things
UPPER_PAD = "upper_pad"
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


Fixed = Mapping[str, tuple[str, RigidTransform]]
"""Things that are fixed to a link of the robot, by name: the link and X_LO."""


def build_scenario(
    domain: Domain, scene: Scene, *, friction: float = FRICTION, fixed: Fixed | None = None
) -> Scenario:
    """Put robot, table and the scene's objects into one plant and finalise it.

    What is `fixed` to the robot touches anything but that arm, and is none of the scenario's `objects`.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    plant.set_contact_model(ContactModel.kPoint)
    robot, table, objects = populate(plant, domain, scene, friction)
    for name, (link, X_LO) in (fixed or {}).items():
        plant.WeldFrames(plant.GetFrameByName(link), objects.pop(name).body_frame(), X_LO)
    _set_gains(plant)
    # The real arms compensate gravity in their controllers; the objects they carry still weigh.
    plant.set_gravity_enabled(robot, False)
    plant.Finalize()
    _let_robot_overlap_itself(plant, scene_graph, robot)
    _keep_upper_pads_from_pads(plant, scene_graph, robot, objects.values())
    for name, (link, _) in (fixed or {}).items():
        _let_arm_overlap(plant, scene_graph, name, link[:2])
    return Scenario(builder, plant, scene_graph, robot, table, objects)


def populate(
    plant: MultibodyPlant, domain: Domain, scene: Scene, friction: float = FRICTION
) -> tuple[ModelInstanceIndex, RigidBody, dict[str, RigidBody]]:
    """Add robot, table and the scene's objects, always in the same order; returns them."""
    robot = add_robot(plant)
    table = _add_table(plant, scene.table.height, friction)
    return (
        robot,
        table,
        {name: _add_object(plant, name, domain.objects[name], friction) for name in scene.things},
    )


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


def drake_shape(shape: shapes.Cylinder | shapes.Box | shapes.Sphere) -> Shape:
    """Drake's shape for one of ours."""
    if isinstance(shape, shapes.Cylinder):
        return Cylinder(shape.radius, shape.height)
    if isinstance(shape, shapes.Box):
        return Box(*shape.size)
    return Sphere(shape.radius)


@dataclass(frozen=True)
class SolidPart:
    """A solid of a thing, in its body frame O; the lowest ones are those that it may stand on."""

    label: str
    X_OP: RigidTransform
    solid: shapes.Cylinder | shapes.Box | shapes.Sphere
    lowest: bool = True

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return float(CalcVolume(drake_shape(self.solid)))


def solid_parts(shape: shapes.Shape) -> list[SolidPart]:
    """What a thing is made of; a tool's x axis runs along its shaft from the bar at -x to the handle."""
    if isinstance(shape, shapes.ToolShape):
        width = shape.width
        parts = [SolidPart("shaft", RigidTransform(), _box(shape.length, width, width))]
        if shape.bar > 0:
            X_OB = RigidTransform([-shape.length / 2 + width / 2, shape.offset, 0])
            parts.append(SolidPart("bar", X_OB, _box(width, shape.bar, width)))
        return parts
    if not isinstance(shape, shapes.Compound):
        return [SolidPart("body", RigidTransform(), shape)]
    return [
        SolidPart(
            f"part_{n}",
            RigidTransform([*part.place, part.above + part.solid.height / 2 - shape.height / 2]),
            part.solid,
            part.above == 0,
        )
        for n, part in enumerate(shape.parts)
    ]


def _box(x: float, y: float, z: float) -> shapes.Box:
    return shapes.Box(type="box", size=(x, y, z))


def _unit_inertia(solid: shapes.Cylinder | shapes.Box | shapes.Sphere) -> UnitInertia:
    if isinstance(solid, shapes.Cylinder):
        return UnitInertia.SolidCylinder(solid.radius, solid.height, [0, 0, 1])
    if isinstance(solid, shapes.Box):
        return UnitInertia.SolidBox(*solid.size)
    return UnitInertia.SolidSphere(solid.radius)


def object_inertia(spec: ObjectSpec) -> SpatialInertia:
    """Inertia of a solid of uniform density (kg, m), about the body origin.

    Where parts overlap the density counts twice: what is told is the mass of the whole.
    """
    parts = solid_parts(spec.shape)
    whole = sum(part.volume for part in parts)
    total = SpatialInertia.Zero()
    for part in parts:
        about_middle = SpatialInertia(spec.mass * part.volume / whole, np.zeros(3), _unit_inertia(part.solid))
        total += about_middle.Shift(-part.X_OP.translation())
    return total


def rolling_damping(spec: ObjectSpec) -> float:
    """What slows down what rolls, N m s: a torque against the rate of turning.

    A ball that rolls at v thereby loses it as exp(-t / `ROLLING_TIME`) and comes to rest after
    v * `ROLLING_TIME`, whatever its size and mass. Zero for what cannot roll.
    """
    if not spec.shape.rolls:
        return 0.0
    radius = min(spec.shape.extent) / 2
    # A rolling ball's inertia about the point where it touches the table.
    return 7 / 5 * spec.mass * radius**2 / ROLLING_TIME


def resist_rolling(
    plant: MultibodyPlant, plant_context: Context, domain: Domain, objects: Iterable[str]
) -> None:
    """Let all that rolls come to rest by itself.

    A parameter of the context: with a damped joint of our own an object could not be locked any more.
    """
    for name in objects:
        damping = rolling_damping(domain.objects[name])
        if damping > 0:
            plant.GetJointByName(name).SetDampingVector(plant_context, np.array([damping] * 3 + [0.0] * 3))


def _add_object(plant: MultibodyPlant, name: str, spec: ObjectSpec, friction: float) -> RigidBody:
    body = plant.AddRigidBody(name, plant.AddModelInstance(name), object_inertia(spec))
    color = [*spec.color, 1.0]
    for part in solid_parts(spec.shape):
        label = f"{name}_{part.label}"
        plant.RegisterVisualGeometry(body, part.X_OP, drake_shape(part.solid), label, color)
        _add_contact_geometry(plant, body, label, part, _contact(friction))
    return body


def _add_contact_geometry(
    plant: MultibodyPlant, body: RigidBody, label: str, part: SolidPart, properties: ProximityProperties
) -> None:
    shape, X_OP = part.solid, part.X_OP
    if isinstance(shape, shapes.Sphere):
        plant.RegisterCollisionGeometry(body, X_OP, Sphere(shape.radius), label, properties)
        return
    # The core ends a little short of the spheres' outermost points, so that the spheres carry the object.
    core = 0.001
    if isinstance(shape, shapes.Cylinder):
        solid: Shape = Cylinder(shape.radius, shape.height - core)
    else:
        solid = Box(shape.size[0], shape.size[1], shape.size[2] - core)
    plant.RegisterCollisionGeometry(body, X_OP, solid, label, properties)
    z = shape.height / 2 - PAD_RADIUS

    def add_pads(kind: str, places: Sequence[tuple[float, float]], z: float) -> None:
        for i, (x, y) in enumerate(places):
            X_OS = X_OP @ RigidTransform([x, y, z])
            plant.RegisterCollisionGeometry(body, X_OS, Sphere(PAD_RADIUS), f"{label}_{kind}_{i}", properties)

    if part.lowest:
        add_pads("pad", _pad_places(shape), -z)
        # Turned over, a bare face would sink into the table: two flat faces have but one contact.
        add_pads(UPPER_PAD, _pad_places(shape), z)
    else:
        # What sits on top of another part (a stud) has no underside, but carries what is put on it.
        add_pads("pad", [(0.0, 0.0)], z)


def _pad_places(shape: shapes.Cylinder | shapes.Box) -> list[tuple[float, float]]:
    """Where the small spheres sit on the underside (metres): an outer and an inner ring, or a grid."""
    if isinstance(shape, shapes.Cylinder):
        outer, inner = shape.radius - PAD_RADIUS, shape.radius * 0.55
        rings = [(outer, 6), (inner, 3)]
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
            np.linspace(-s / 2 + PAD_RADIUS, s / 2 - PAD_RADIUS, max(2, math.ceil(s / PAD_SPACING) + 1))
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
        if not is_hand_joint(actuator.name()):
            actuator.set_default_rotor_inertia(ROTOR_INERTIA)
            actuator.set_default_gear_ratio(GEAR_RATIO)


def _let_robot_overlap_itself(
    plant: MultibodyPlant, scene_graph: SceneGraph, robot: ModelInstanceIndex
) -> None:
    """The primitives of neighbouring links overlap by construction: only the two arms meet each other."""
    for other_arm in ("l_", "r_"):
        own = GeometrySet()
        for index in plant.GetBodyIndices(robot):
            frame = plant.GetBodyFrameIdIfExists(index)
            if frame is not None and not plant.get_body(index).name().startswith(other_arm):
                own.Add(frame)
        scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(own))


def _keep_upper_pads_from_pads(
    plant: MultibodyPlant, scene_graph: SceneGraph, robot: ModelInstanceIndex, objects: Iterable[RigidBody]
) -> None:
    """What an upright thing carries rests on its flat top, and so do fingers: pad on pad is a bumpy ride."""
    upper, lower, inspector = GeometrySet(), GeometrySet(), scene_graph.model_inspector()
    for body in objects:
        for geometry in plant.GetCollisionGeometriesForBody(body):
            name = inspector.GetName(geometry)
            if UPPER_PAD in name:
                upper.Add(geometry)
            elif "pad" in name:
                lower.Add(geometry)
    for index in plant.GetBodyIndices(robot):
        lower.Add(plant.GetBodyFrameIdOrThrow(index))
    filters = scene_graph.collision_filter_manager()
    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(upper).ExcludeBetween(upper, lower))


def _let_arm_overlap(plant: MultibodyPlant, scene_graph: SceneGraph, name: str, arm: str) -> None:
    """What is fixed to a hand lies between its fingers."""
    own = GeometrySet()
    for body in (plant.get_body(index) for index in _all_bodies(plant)):
        if body.name().startswith(arm):
            own.Add(plant.GetBodyFrameIdOrThrow(body.index()))
    held = GeometrySet(plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(name).index()))
    scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeBetween(own, held))


def _all_bodies(plant: MultibodyPlant) -> list[BodyIndex]:
    return [BodyIndex(i) for i in range(plant.num_bodies())]
