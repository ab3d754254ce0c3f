"""The running simulation: joints follow the controller, objects follow contact and friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ProximityProperties, RoleAssign
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import CoulombFriction
from pydrake.systems.analysis import Simulator

from cognitive_arch.domain import Domain, Placement, Scene
from sim.hands import (
    BENDS,
    DRAWN_IN,
    FINGER_FRICTION,
    SIDES,
    Posture,
    carriage_name,
    finger_names,
    knuckle_names,
)
from sim.scenario import FRICTION, Fixed, Scenario, build_scenario, resist_rolling

Joints = NDArray[np.float64]
COMMAND_PERIOD = 0.02  # s between two set points of a motion
PARK = (2.0, 0.0, -5.0)  # m; where objects wait that are not in the scene: out of sight, far below

HOME: Mapping[str, float] = {  # rad; both hands beside the table's work area, well above it
    "torso_pitch": 0.1,
    "l_shoulder_pitch": -0.5,
    "l_shoulder_roll": 0.6,
    "l_shoulder_yaw": -0.3,
    "l_elbow": 1.4,
    "r_shoulder_pitch": -0.5,
    "r_shoulder_roll": 0.6,
    "r_shoulder_yaw": -0.3,
    "r_elbow": 1.4,
}


class World:
    """One episode's physics. Joint vectors list the actuated joints in the order of `joint_names`."""

    def __init__(
        self, domain: Domain, scene: Scene, *, friction: float = FRICTION, fixed: Fixed | None = None
    ) -> None:
        self.domain = domain
        self.scene = scene
        self.scenario: Scenario = build_scenario(domain, scene, friction=friction, fixed=fixed)
        plant = self.plant = self.scenario.plant
        self.diagram = self.scenario.builder.Build()
        self.simulator = Simulator(self.diagram)
        self._context = self.simulator.get_mutable_context()
        self._plant_context = plant.GetMyMutableContextFromRoot(self._context)
        resist_rolling(plant, self._plant_context, domain, self.scenario.objects)
        robot = self.scenario.robot
        joints = [plant.get_joint_actuator(i).joint() for i in plant.GetJointActuatorIndices(robot)]
        self.joint_names = tuple(joint.name() for joint in joints)
        self._positions = np.array([joint.position_start() for joint in joints])
        self._desired = plant.get_desired_state_input_port(robot)
        self._fingers, self._carriages, self._knuckles = (
            {hand: [self.joint_names.index(name) for name in names(side)] for hand, side in SIDES.items()}
            for names in (finger_names, lambda side: (carriage_name(side),), knuckle_names)
        )
        self.home = np.array([HOME.get(name, 0.0) for name in self.joint_names])
        for hand in SIDES:
            self.home = self.with_pads_in(self.home, hand)
        self.command = self.home.copy()
        self.set_point = self.command  # what the controllers are being asked for at this moment
        self.on_send: Callable[[Joints, Joints], Joints] | None = (
            None  # what becomes of a set point on its way
        )
        self._friction: dict[str, float] = {}
        self.on_tick: Callable[[], None] = lambda: None
        self._seen_contacts: tuple[float, frozenset[tuple[str, str]]] | None = None

    # -- setting up ---------------------------------------------------------------------------------

    def reset(self, placements: Mapping[str, Placement], joints: Joints | None = None) -> None:
        """Robot at home (or at `joints`, (n_joints,)), objects just above the table where `placements` says,
        everything at rest.

        Objects without a placement are parked.
        """
        start = self.home if joints is None else joints
        plant, context = self.plant, self._plant_context
        self._context.SetTime(0.0)
        self._seen_contacts = None
        positions = np.zeros(plant.num_positions())
        positions[self._positions] = start
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        for name in self.scenario.objects:
            if name not in placements:
                self.park(name)
                continue
            x, y = placements[name].position
            z = self.scene.table.height + self.height(name) / 2 + 0.0005
            self.place(name, RigidTransform(RollPitchYaw(0, 0, placements[name].yaw), [x, y, z]))
        self.on_send = None
        self._send(start, np.zeros(len(start)))
        self.command = start.copy()
        self.simulator.Initialize()

    def place(self, name: str, X_WO: RigidTransform) -> None:
        """Put an object somewhere, at rest and free to move."""
        body = self.scenario.objects[name]
        body.Unlock(self._plant_context)
        self.plant.SetFreeBodyPose(self._plant_context, body, X_WO)
        self.plant.SetFreeBodySpatialVelocity(self._plant_context, body, SpatialVelocity(np.zeros(6)))

    def park(self, name: str) -> None:
        """Take an object out of the scene: far away and locked, so that it does not fall on for ever."""
        slot = sorted(self.scenario.objects).index(name)
        self.place(name, RigidTransform([PARK[0], PARK[1] + 0.5 * slot, PARK[2]]))
        self.scenario.objects[name].Lock(self._plant_context)

    # -- looking ------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated seconds since the last reset."""
        return float(self._context.get_time())

    def pose(self, name: str) -> RigidTransform:
        """X_WO of an object."""
        return self.plant.EvalBodyPoseInWorld(self._plant_context, self.scenario.objects[name])

    def hand_pose(self, hand: str) -> RigidTransform:
        """X_WH of a hand's frame."""
        frame = self.plant.GetFrameByName(f"{SIDES[hand]}_hand_dh_frame")
        return frame.CalcPoseInWorld(self._plant_context)

    def height(self, name: str) -> float:
        """Vertical extent of an object that lies flat, metres."""
        return float(self.domain.objects[name].shape.height)

    def joints(self) -> Joints:
        """Measured joint positions, (n_joints,)."""
        measured: Joints = self.plant.GetPositions(self._plant_context)[self._positions]
        return measured

    def positions(self) -> NDArray[np.float64]:
        """All positions of the plant, (n_positions,)."""
        positions: NDArray[np.float64] = self.plant.GetPositions(self._plant_context)
        return positions

    def configuration(self, joints: Joints) -> Joints:
        """All positions of the plant as they are now, (n_positions,), the robot's joints at `joints`."""
        return self.with_joints(self.plant.GetPositions(self._plant_context), joints)

    def with_joints(self, configuration: Joints, joints: Joints) -> Joints:
        """A configuration with the robot's joints at `joints`."""
        changed = configuration.copy()
        changed[self._positions] = joints
        return changed

    def contacts(self) -> frozenset[tuple[str, str]]:
        """Names of the bodies that press on each other now, each pair in both orders.

        They change only while time passes, for they are those of the last step of the simulation.
        """
        if self._seen_contacts is None or self._seen_contacts[0] != self.time:
            self._seen_contacts = self.time, self._find_contacts()
        return self._seen_contacts[1]

    def _find_contacts(self) -> frozenset[tuple[str, str]]:
        results = self.plant.get_contact_results_output_port().Eval(self._plant_context)
        pairs = set()
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            if np.linalg.norm(info.contact_force()) > 1e-4:
                a, b = (self.plant.get_body(k).name() for k in (info.bodyA_index(), info.bodyB_index()))
                pairs.update({(a, b), (b, a)})
        return frozenset(pairs)

    def overlaps(self) -> frozenset[tuple[str, str]]:
        """Names of the bodies that are in each other's way as they stand now, each pair once.

        Other than `contacts` this needs no time to pass.
        """
        graph = self.scenario.scene_graph
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._context))
        inspector = query.inspector()
        pairs = set()
        for found in query.ComputePointPairPenetration():
            bodies = [
                self.plant.GetBodyFromFrameId(inspector.GetFrameId(g)) for g in (found.id_A, found.id_B)
            ]
            a, b = sorted(str(body.name()) for body in bodies if body is not None)
            pairs.add((a, b))
        return frozenset(pairs)

    # -- keeping ------------------------------------------------------------------------------------

    def save(self) -> dict[str, Any]:
        """All that decides what happens next, as plain data.

        The contacts are those of the last step of the simulation, which the state alone does not tell.
        """
        plant, context, objects = self.plant, self._plant_context, self.scenario.objects
        return {
            "time": self.time,
            "joints": list(self.joint_names),
            "state": plant.GetPositionsAndVelocities(context).tolist(),
            "desired": self._desired.Eval(context).tolist(),
            "command": self.command.tolist(),
            "locked": sorted(name for name, body in objects.items() if body.is_locked(context)),
            "objects": sorted(objects),
            "contacts": sorted([a, b] for a, b in self.contacts() if a < b),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Back to what `save` saw; raises `ValueError` if it was another world's, before anything moves."""
        plant, context, objects = self.plant, self._plant_context, self.scenario.objects
        if saved["joints"] != list(self.joint_names) or saved["objects"] != sorted(objects):
            raise ValueError("it has other joints or objects")
        state, desired, command = (np.array(saved[key], float) for key in ("state", "desired", "command"))
        if not np.isfinite(np.concatenate([state, desired, command])).all():
            raise ValueError("its numbers are not finite")
        n = len(self.joint_names)
        if (len(state), len(desired), len(command)) != (plant.num_multibody_states(), 2 * n, n):
            raise ValueError("its vectors have other lengths")
        time, locked = float(saved["time"]), set(saved["locked"])
        contacts = {(str(a), str(b)) for a, b in saved["contacts"]}
        self._context.SetTime(time)
        for name, body in objects.items():
            # Locking stops a body, so positions and velocities come after it.
            (body.Lock if name in locked else body.Unlock)(context)
        plant.SetPositionsAndVelocities(context, state)
        self._ask(desired[:n], desired[n:])
        self.set_point = self.command = command
        self._seen_contacts = time, frozenset(contacts | {(b, a) for a, b in contacts})
        self.simulator.Initialize()

    # -- moving -------------------------------------------------------------------------------------

    def _send(self, position: Joints, velocity: Joints) -> None:
        change, self.set_point = position - self.set_point, position
        arriving = position if self.on_send is None else self.on_send(position, change)
        self._ask(arriving, velocity)

    def _ask(self, position: Joints, velocity: Joints) -> None:
        self._desired.FixValue(self._plant_context, np.concatenate([position, velocity]))

    def follow(
        self, waypoints: Sequence[Joints], seconds: float, until: Callable[[], bool] | None = None
    ) -> None:
        """Move the set point through `waypoints`, (n_joints,) each, with a minimum-jerk time scaling.

        `until` is asked after every set point; where it says yes, the set point stays.
        """
        path = np.vstack([self.command, *waypoints])
        pieces = len(path) - 1
        ticks = max(1, round(seconds / COMMAND_PERIOD))
        start, previous = self.time, self.command
        for tick in range(1, ticks + 1):
            u = tick / ticks
            along = pieces * (10 * u**3 - 15 * u**4 + 6 * u**5)
            piece = min(int(along), pieces - 1)
            point = path[piece] + (along - piece) * (path[piece + 1] - path[piece])
            self._send(point, (point - previous) / COMMAND_PERIOD)
            self._advance(start + seconds * u)
            previous = point
            if until is not None and until():
                break
        self.command = previous
        self._send(previous, np.zeros(len(previous)))

    def hold(self, seconds: float) -> None:
        """Let time pass with the set point where it is."""
        start, ticks = self.time, max(1, round(seconds / COMMAND_PERIOD))
        for tick in range(1, ticks + 1):
            self._advance(start + seconds * tick / ticks)

    def _advance(self, time: float) -> None:
        self.simulator.AdvanceTo(time)
        self.on_tick()

    def with_fingers(self, joints: Joints, hand: str, opening: float) -> Joints:
        """`joints` with both pads of `hand` out and `opening` metres from the middle."""
        changed = joints.copy()
        changed[self._fingers[hand]] = opening
        changed[self._carriages[hand]] = 0.0
        return changed

    def with_pads_in(self, joints: Joints, hand: str) -> Joints:
        """`joints` with the pads of `hand` closed and drawn into the palm."""
        changed = self.with_fingers(joints, hand, 0.0)
        changed[self._carriages[hand]] = DRAWN_IN
        return changed

    def with_posture(self, joints: Joints, hand: str, posture: Posture) -> Joints:
        """`joints` with the four fingers of `hand` in that posture."""
        changed = joints.copy()
        changed[self._knuckles[hand]] = BENDS[posture]
        return changed

    def fingers(self, joints: Joints, hand: str) -> Joints:
        """The two pad positions of `hand` within `joints`, metres."""
        return joints[self._fingers[hand]]

    def arm_joints(self, hand: str) -> list[int]:
        """Where the arm's own joints (without torso and fingers) are within a joint vector."""
        starts = tuple(f"{SIDES[hand]}_{part}" for part in ("shoulder", "elbow", "wrist"))
        return [i for i, name in enumerate(self.joint_names) if name.startswith(starts)]

    def set_finger_friction(self, hand: str, factor: float) -> None:
        """Let the fingers of a hand have that part of their friction; free of cost where nothing changes."""
        if self._friction.get(hand, 1.0) == factor:
            return
        self._friction[hand] = factor
        for name in finger_names(SIDES[hand]):
            self.set_friction(name, friction=FINGER_FRICTION * factor)

    def set_friction(self, *bodies: str, friction: float) -> None:
        """Give bodies another coefficient of friction."""
        graph = self.scenario.scene_graph
        context = graph.GetMyMutableContextFromRoot(self._context)
        for name in bodies:
            for geometry in self.plant.GetCollisionGeometriesForBody(self.plant.GetBodyByName(name)):
                properties = ProximityProperties(graph.model_inspector().GetProximityProperties(geometry))
                properties.UpdateProperty("material", "coulomb_friction", CoulombFriction(friction, friction))
                graph.AssignRole(
                    context, self.plant.get_source_id(), geometry, properties, RoleAssign.kReplace
                )

    def move_fingers(self, hand: str, opening: float, seconds: float = 0.4) -> None:
        """Open or close a hand."""
        self.follow([self.with_fingers(self.command, hand, opening)], seconds)
