"""Where the arms can go: inverse kinematics of torso and one arm, the other arm staying where it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import SnoptSolver

from cognitive_arch.world.observation import HANDS
from sim.assets import FOREARM, FOREARM_AT
from sim.hands import FINGER_LENGTH, FINGER_OFFSET, PALM_SIGN, SIDES, STROKE, is_hand_joint
from sim.scenario import add_robot
from sim.world import HOME, Joints

Vector = NDArray[np.float64]
TORSO_COST, ARM_COST = 2.0, 0.3  # moving the torso moves everything, so arms go first
POSITION_TOLERANCE = 0.001  # m
TIP_CLEARANCE = 0.02  # m that an idle hand's finger tips keep above the table
FOREARM_CLEARANCE = FOREARM["radius"] + 0.010  # m that the axes of both forearms do
MAX_LEAN = 0.40  # rad that the torso may lean forward; farther, and the head hangs over the table
APPROACH = 0.09  # m above its target that a hand comes down from
OUT_OF_REACH = -0.60  # m, x: no arm gets that far
REACH_MARGIN = 0.008  # m: where a hand only just gets to, it cannot turn as an object asks for
RESTARTS = 3
RAISED_TILT = 0.15  # rad by which a hand may tilt on its way
DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class HandTarget:
    """What a hand pose must satisfy.

    The point `p_HP` of the hand frame (metres) is to be at `p_WP`, give or take `tolerance`; the hand's
    direction `axis_H` within `tilt` radians of `axis_W`; and, if given, its y axis (along which the
    fingers close) within `yaw_tolerance` of `fingers_W`.
    """

    p_HP: Vector
    p_WP: Vector
    axis_H: Vector
    axis_W: Vector
    tilt: float
    fingers_W: Vector | None = None
    yaw_tolerance: float = 0.08
    tolerance: float = POSITION_TOLERANCE

    def at(self, p_WP: Vector) -> HandTarget:
        """The same demand at another place."""
        return replace(self, p_WP=p_WP)


def forearm_ends(side: str) -> tuple[Vector, Vector]:
    """Both ends of the forearm's capsule, metres, in the frame of its link."""
    centre, half = np.array(FOREARM_AT[side]), np.array([0.0, 0.0, FOREARM["length"] / 2])
    return centre - half, centre + half


def palm_axis(hand: str) -> Vector:
    """The direction out of the palm, in the hand frame."""
    return np.array([0.0, 0.0, PALM_SIGN[SIDES[hand]]])


def fingertip(hand: str) -> Vector:
    """The point between the tips of the two pads when they are out, in the hand frame, metres."""
    return np.array([FINGER_OFFSET, 0.0, 0.0]) + FINGER_LENGTH * palm_axis(hand)


def open_tips(hand: str) -> list[Vector]:
    """The finger tips of the open hand, in the hand frame, metres."""
    return [fingertip(hand) + np.array([0.0, sign * STROKE, 0.0]) for sign in (1, -1)]


class Kinematics:
    """Solves for the joint vectors of a `World` whose joints are called `joint_names`."""

    def __init__(self, joint_names: Sequence[str], table_height: float) -> None:
        self.plant = MultibodyPlant(0.0)
        add_robot(self.plant)
        self.plant.Finalize()
        lean = self.plant.GetJointByName("torso_pitch")
        lean.set_position_limits(lean.position_lower_limits(), np.array([MAX_LEAN]))
        self._context = self.plant.CreateDefaultContext()
        self._index = np.array([self.plant.GetJointByName(name).position_start() for name in joint_names])
        self._names = tuple(joint_names)
        self._table_height = table_height
        self._home = np.array([HOME.get(name, 0.0) for name in joint_names])
        self._reach: dict[tuple[str, int, int], bool] = {}

    def _full(self, joints: Joints) -> Vector:
        full = np.zeros(self.plant.num_positions())
        full[self._index] = joints
        return full

    def hand_pose(self, hand: str, joints: Joints) -> RigidTransform:
        """X_WH at `joints`."""
        return self.link_pose(f"{SIDES[hand]}_hand_dh_frame", joints)

    def link_pose(self, link: str, joints: Joints) -> RigidTransform:
        """X_WL of a link of the robot at `joints`."""
        self.plant.SetPositions(self._context, self._full(joints))
        return self.plant.GetFrameByName(link).CalcPoseInWorld(self._context)

    def solve(
        self,
        hand: str,
        target: HandTarget,
        near: Joints,
        *,
        idle: HandTarget | None = None,
        restarts: int = RESTARTS,
        accept: Callable[[Joints], bool] = lambda joints: True,
    ) -> Joints | None:
        """Joints close to `near` that meet `target` and that `accept` takes, or None. Fingers keep their
        position.

        The other arm meets `idle` if that is given (it carries something, and a lean of the torso must not
        lower it onto the table). Else it keeps its joints if that is possible.

        Restarts draw from a generator of their own, seeded by the attempt, so that the answer depends on
        the arguments only.
        """
        lower, upper = self.plant.GetPositionLowerLimits(), self.plant.GetPositionUpperLimits()
        # Fingers that press are commanded beyond their limit.
        start = np.clip(self._full(near), lower, upper)
        for attempt in range(restarts):
            problem = self._problem(hand, target, idle, start, still=idle is None and attempt == 0)
            guess = start
            if attempt:
                shaken = start + np.random.default_rng(attempt).normal(0, 0.3, len(start))
                guess = np.clip(shaken, lower, upper)
            problem.get_mutable_prog().SetInitialGuess(problem.q(), guess)
            result = SnoptSolver().Solve(problem.prog())
            if result.is_success():
                solution = self._with_fingers_of(near, result.GetSolution(problem.q())[self._index])
                if accept(solution):
                    return solution
        return None

    def _problem(
        self, hand: str, target: HandTarget, idle: HandTarget | None, start: Vector, *, still: bool
    ) -> InverseKinematics:
        problem = InverseKinematics(self.plant, True)
        world = self.plant.world_frame()
        other = next(h for h in HANDS if h != hand)
        self._constrain(problem, hand, target)
        if idle is not None:
            self._constrain(problem, other, idle)
        # A torso lean lowers the idle arm: the tips of its fingers and both forearms stay above the table.
        low_points = [(f"{SIDES[other]}_hand_dh_frame", tip, TIP_CLEARANCE) for tip in open_tips(other)]
        for side in SIDES.values():
            low_points += [(f"{side}_forearm", end, FOREARM_CLEARANCE) for end in forearm_ends(side)]
        for link, point, clearance in low_points:
            low = np.array([-2.0, -2.0, self._table_height + clearance])
            frame = self.plant.GetFrameByName(link)
            problem.AddPositionConstraint(frame, point, world, low, np.full(3, 2.0))
        q, program = problem.q(), problem.get_mutable_prog()
        for name, index in zip(self._names, self._index, strict=True):
            if (still and name.startswith(f"{SIDES[other]}_")) or is_hand_joint(name):
                program.AddBoundingBoxConstraint(start[index], start[index], q[index])
        weights = np.zeros((len(start), len(start)))
        for name, index in zip(self._names, self._index, strict=True):
            weights[index, index] = TORSO_COST if "torso" in name else ARM_COST
        program.AddQuadraticErrorCost(weights, start, q)
        return problem

    def _constrain(self, problem: InverseKinematics, hand: str, target: HandTarget) -> None:
        world = self.plant.world_frame()
        frame = self.plant.GetFrameByName(f"{SIDES[hand]}_hand_dh_frame")
        margin = np.full(3, target.tolerance)
        problem.AddPositionConstraint(frame, target.p_HP, world, target.p_WP - margin, target.p_WP + margin)
        problem.AddAngleBetweenVectorsConstraint(frame, target.axis_H, world, target.axis_W, 0, target.tilt)
        if target.fingers_W is not None:
            problem.AddAngleBetweenVectorsConstraint(
                frame, np.array([0.0, 1.0, 0.0]), world, target.fingers_W, 0, target.yaw_tolerance
            )

    def _with_fingers_of(self, near: Joints, solution: Joints) -> Joints:
        keep = [is_hand_joint(name) for name in self._names]
        return np.where(keep, near, solution)

    def line(
        self,
        hand: str,
        target: HandTarget,
        end: Vector,
        start: Joints,
        *,
        idle: HandTarget | None = None,
        pieces: int = 4,
    ) -> list[Joints] | None:
        """Waypoints of a straight line from `target.p_WP` (where the hand is at `start`) to `end`."""
        path, joints = [], start
        for fraction in np.linspace(0, 1, pieces + 1)[1:]:
            place = target.p_WP + fraction * (end - target.p_WP)
            step = self.solve(hand, target.at(place), joints, idle=idle, restarts=2)
            if step is None:
                return None
            path.append(step)
            joints = step
        return path

    def raised(self, hand: str, joints: Joints, height: float) -> HandTarget:
        """The hand `height` metres above where it is at `joints`, turned about as there."""
        X_WH = self.hand_pose(hand, joints)
        _, y_W, z_W = X_WH.rotation().matrix().T
        place = X_WH.translation() + np.array([0.0, 0.0, height])
        up = np.array([0.0, 0.0, 1.0])
        return HandTarget(np.zeros(3), place, up, z_W, RAISED_TILT, y_W, RAISED_TILT, tolerance=0.01)

    def reaches(self, hand: str, x: float, y: float) -> bool:
        """Whether `hand` can come down on something on the table at (x, y), metres; remembered per 5 mm."""
        key = (hand, round(x / 0.005), round(y / 0.005))
        if x < OUT_OF_REACH:
            return False
        if key not in self._reach:
            place = np.array([key[1] * 0.005 - REACH_MARGIN, key[2] * 0.005, self._table_height + 0.003])
            target = HandTarget(fingertip(hand), place, palm_axis(hand), DOWN, tilt=0.30)
            above = target.at(place + np.array([0.0, 0.0, APPROACH]))
            start = self.solve(hand, above, self._home)
            self._reach[key] = start is not None and self.solve(hand, target, start) is not None
        return self._reach[key]


def finger_directions(yaws: Sequence[float]) -> list[Vector]:
    """Unit vectors of the closing direction for hand yaws (radians), each both ways round."""
    directions = []
    for yaw in yaws:
        direction = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        directions += [direction, -direction]
    return directions
