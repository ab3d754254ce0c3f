"""The running simulation: joints follow the controller, objects follow contact and friction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, MeshcatParams, MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import Simulator

from cognitive_arch.domain import Domain, Placement, Scene
from sim.hands import SIDES, STROKE, finger_names
from sim.scenario import FRICTION, Scenario, build_scenario, resist_rolling

Joints = NDArray[np.float64]
COMMAND_PERIOD = 0.02  # s between two set points of a motion
PARK = (2.0, 0.0, -5.0)  # m; where objects wait that are not in the scene: out of sight, far below
RECORDING_FPS = 5.0  # the viewer interpolates between frames

HOME: Mapping[str, float] = {  # rad; both hands beside the table's work area, well above it
    "torso_pitch": 0.1,
    "l_shoulder_pitch": -0.5,
    "l_shoulder_roll": 0.6,
    "l_shoulder_yaw": 0.3,
    "l_elbow": 1.4,
    "r_shoulder_pitch": -0.5,
    "r_shoulder_roll": 0.6,
    "r_shoulder_yaw": 0.3,
    "r_elbow": 1.4,
}


class World:
    """One episode's physics. Joint vectors list the actuated joints in the order of `joint_names`."""

    def __init__(
        self, domain: Domain, scene: Scene, *, record: bool = False, friction: float = FRICTION
    ) -> None:
        self.domain = domain
        self.scene = scene
        self.scenario: Scenario = build_scenario(domain, scene, friction=friction)
        plant = self.plant = self.scenario.plant
        self.meshcat: Meshcat | None = None
        if record:
            self._add_meshcat()
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
        self._fingers = {
            hand: [self.joint_names.index(name) for name in finger_names(side)]
            for hand, side in SIDES.items()
        }
        self.home = np.array([HOME.get(n, STROKE if "finger" in n else 0.0) for n in self.joint_names])
        self.command = self.home.copy()

    def _add_meshcat(self) -> None:
        params = MeshcatParams(host="localhost", port=None, show_stats_plot=False)
        self.meshcat = Meshcat(params)
        visual = MeshcatVisualizerParams(role=Role.kIllustration, publish_period=1.0 / RECORDING_FPS)
        MeshcatVisualizer.AddToBuilder(self.scenario.builder, self.scenario.scene_graph, self.meshcat, visual)

    # -- setting up ---------------------------------------------------------------------------------

    def reset(self, placements: Mapping[str, Placement]) -> None:
        """Robot at home, objects just above the table where `placements` says, everything at rest.

        Objects without a placement are parked.
        """
        plant, context = self.plant, self._plant_context
        self._context.SetTime(0.0)
        positions = np.zeros(plant.num_positions())
        positions[self._positions] = self.home
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        for name in self.scenario.objects:
            if name not in placements:
                self.park(name)
                continue
            x, y = placements[name].position
            z = self.scene.table.height + self.height(name) / 2 + 0.0005
            self.place(name, RigidTransform(RollPitchYaw(0, 0, placements[name].yaw), [x, y, z]))
        self._send(self.home, np.zeros(len(self.home)))
        self.command = self.home.copy()
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

    def contacts(self) -> frozenset[tuple[str, str]]:
        """Names of the bodies that press on each other now, each pair in both orders."""
        results = self.plant.get_contact_results_output_port().Eval(self._plant_context)
        pairs = set()
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            if np.linalg.norm(info.contact_force()) > 1e-4:
                a, b = (self.plant.get_body(k).name() for k in (info.bodyA_index(), info.bodyB_index()))
                pairs.update({(a, b), (b, a)})
        return frozenset(pairs)

    # -- moving -------------------------------------------------------------------------------------

    def _send(self, position: Joints, velocity: Joints) -> None:
        self._desired.FixValue(self._plant_context, np.concatenate([position, velocity]))

    def follow(self, waypoints: Sequence[Joints], seconds: float) -> None:
        """Move the set point through `waypoints`, (n_joints,) each, with a minimum-jerk time scaling."""
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
            self.simulator.AdvanceTo(start + seconds * u)
            previous = point
        self.command = previous
        self._send(previous, np.zeros(len(previous)))

    def hold(self, seconds: float) -> None:
        """Let time pass with the set point where it is."""
        self.simulator.AdvanceTo(self.time + seconds)

    def with_fingers(self, joints: Joints, hand: str, opening: float) -> Joints:
        """`joints` with both fingers of `hand` at `opening` metres from the middle."""
        changed = joints.copy()
        changed[self._fingers[hand]] = opening
        return changed

    def fingers(self, joints: Joints, hand: str) -> Joints:
        """The two finger positions of `hand` within `joints`, metres."""
        return joints[self._fingers[hand]]

    def move_fingers(self, hand: str, opening: float, seconds: float = 0.4) -> None:
        """Open or close a hand."""
        self.follow([self.with_fingers(self.command, hand, opening)], seconds)
