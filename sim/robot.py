"""What skills work with: the world, the arms' kinematics, perception, and where the arm believes it aims."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cognitive_arch.domain import Domain, Scene
from cognitive_arch.world.observation import HANDS
from sim.clearance import Clearance
from sim.hands import SIDES, Posture, is_hand_joint
from sim.kinematics import (
    APPROACH,
    DOWN,
    HandTarget,
    Kinematics,
    Vector,
    finger_directions,
    fingertip,
    palm_axis,
)
from sim.noise import EpisodeNoise
from sim.perception import OraclePerception, Perception
from sim.world import Joints, World

LEVEL, TILTS = 0.03, (0.05, 0.15, 0.30)  # rad
YAWS = (0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2)  # rad, of the fingers' closing direction
CARRY_TILT, CARRY_TOLERANCE = 0.12, 0.03  # rad and m by which a full hand may be moved meanwhile
TOOL_TILT, TOOL_TURN = 0.06, 0.15  # rad, the same for a hand with a tool
POSTURE_TIME = 0.6  # s to bend the fingers
ASIDE = 1.3  # rad of the shoulder of an idle arm that is to leave room
DETOURS = (0.12, 0.06)  # m by which a hand rises to get over what is in its way
TRANSIT_SPEED, TOOL_SPEED = 1.5, 1.3  # rad/s of the fastest joint between poses, and with a tool in a hand


@dataclass
class Grip:
    """How a hand holds its object: how far the fingers opened before (metres), the target they close to,
    the hand yaws that fit the object (radians), and the joints with which the arm carries it."""

    opening: float
    closed: float
    yaws: tuple[float, ...]
    carrying: Joints

    def to_json(self) -> dict[str, Any]:
        """Plain data; `from_json` reads it back."""
        return asdict(self) | {"yaws": list(self.yaws), "carrying": self.carrying.tolist()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Grip:
        """The inverse of `to_json`."""
        return cls(**{**data, "yaws": tuple(data["yaws"]), "carrying": np.array(data["carrying"], float)})


@dataclass(frozen=True)
class Descent:
    """The way to above a place, its last waypoint being there, and the waypoints straight down to it."""

    way: list[Joints]
    down: list[Joints]

    @property
    def back(self) -> list[Joints]:
        """The waypoints up again."""
        return [*self.down[-2::-1], self.way[-1]]


def _other(hand: str) -> str:
    return next(h for h in HANDS if h != hand)


@dataclass
class Robot:
    """The iCub as skills see it. `perception` is all that they know of things; `truth` is for whoever plays
    the world or judges the robot. `grips` says how each full hand holds what it holds, `postures` what the
    fingers of each hand do, `measured` what the skill at work has measured (SI units)."""

    domain: Domain
    scene: Scene
    world: World
    noise: EpisodeNoise
    rng: np.random.Generator
    kinematics: Kinematics
    clearance: Clearance
    perception: Perception
    truth: OraclePerception
    grips: dict[str, Grip] = field(default_factory=dict)
    postures: dict[str, Posture] = field(default_factory=lambda: dict.fromkeys(HANDS, Posture.STRAIGHT))
    measured: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._hand_joints = np.array([is_hand_joint(name) for name in self.world.joint_names])

    def save(self) -> dict[str, Any]:
        """What the robot remembers from one action to the next, as plain data."""
        return {
            "grips": {hand: grip.to_json() for hand, grip in sorted(self.grips.items())},
            "noise": self.noise.save(),
            "perception": self.perception.save(),
            "postures": {hand: str(posture) for hand, posture in sorted(self.postures.items())},
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """The inverse of `save`."""
        grips = {hand: Grip.from_json(grip) for hand, grip in saved["grips"].items()}
        if any(grip.carrying.shape != self.world.home.shape for grip in grips.values()):
            raise ValueError("its grips are of other joints")
        self.grips = grips
        self.noise.restore(saved["noise"])
        self.perception.restore(saved["perception"])
        self.postures = {hand: Posture(saved["postures"][hand]) for hand in HANDS}

    def set_posture(self, hand: str, posture: Posture) -> None:
        """Bend the four fingers of a hand; raises `ValueError` if it holds something."""
        if hand in self.grips and posture is not Posture.STRAIGHT:
            raise ValueError(f"{hand} holds something; its fingers stay {Posture.STRAIGHT}")
        if posture is not self.postures[hand]:
            self.world.follow([self.world.with_posture(self.world.command, hand, posture)], POSTURE_TIME)
            self.postures[hand] = posture

    def top_of(self, name: str) -> float:
        """Height of an object's upper face, or of a stranger's, metres."""
        stranger = self.perception.strangers().get(name)
        if stranger is not None:
            return float(stranger.pose[2, 3]) + stranger.shape.height / 2
        return float(self.perception.pose(name).translation()[2] + self.world.height(name) / 2)

    def look(self, supposed: Mapping[str, tuple[str, RigidTransform]] | None = None) -> None:
        """Take in what is in the way now, before a motion is planned.

        `supposed` says of a hand what it holds and its pose in the hand frame, other than it is.
        """
        held = {}
        for hand in HANDS:
            name = self.perception.held(hand)
            if name is not None:
                held[hand] = (name, self.world.hand_pose(hand).inverse() @ self.perception.pose(name))
        poses = {name: self.perception.pose(name) for name in self.perception.names()}
        strangers = self.perception.strangers().values()
        self.clearance.look(poses, held | dict(supposed or {}), strangers)

    def way(self, hand: str, joints: Joints) -> list[Joints] | None:
        """Waypoints of a collision-free way of `hand` to `joints`, or None; as seen by the last `look`.

        If the straight way is not free, the hand first goes up, or waits for the other arm, or goes by its
        home posture, or comes from above.
        """
        here = self.world.command
        here = np.where(self._hand_joints, joints, here)
        if self.clearance.free_from(here, [joints]):
            return [joints]
        aside = [np.where(self._arm_joints(_other(hand)), joints, here)]
        up = self._detour(hand, here)
        over = self._detour(hand, joints)
        home = [np.where(self._hand_joints, joints, self.rest(hand))]
        ways = (up, over, [*up, *over], aside, [*aside, *over], home, [*up, *home], [*home, *over])
        for via in (*ways, [*up, *home, *over]):
            if via and self.clearance.free_from(here, [*via, joints]):
                return [*via, joints]
        return None

    def _detour(self, hand: str, joints: Joints) -> list[Joints]:
        """The hand raised from where it is at `joints`: one waypoint, or none if it cannot be."""
        for height in DETOURS:
            target = self.kinematics.raised(hand, joints, height)
            found = self.kinematics.solve(
                hand, target, joints, idle=self.idle_target(hand), accept=self.clearance.free
            )
            if found is not None:
                return [found]
        return []

    def go(self, waypoints: Sequence[Joints]) -> None:
        """Through waypoints as fast as the fastest joint may (minimum jerk peaks at 1.9 times its mean)."""
        path = [self.world.command, *waypoints]
        length = sum(float(np.abs(b - a).max()) for a, b in itertools.pairwise(path))
        held = [self.perception.held(hand) for hand in self.grips]
        tools = any(name and self.domain.objects[name].kind == "tool" for name in held)
        self.world.follow(waypoints, max(0.6, 1.9 * length / (TOOL_SPEED if tools else TRANSIT_SPEED)))

    def travel(self, hand: str, joints: Joints) -> None:
        """Go to `joints` with `hand` round what is in the way, or straight if there is no way round."""
        self.look()
        self.go(self.way(hand, joints) or [joints])

    def above(self, target: HandTarget) -> HandTarget:
        """The place from which a hand comes down to `target`."""
        return target.at(target.p_WP + np.array([0.0, 0.0, APPROACH]))

    def descent(
        self, hand: str, target: HandTarget, touched: Collection[str], opening: float | None = None
    ) -> Descent | None:
        """A collision-free way down to `target`, where the hand, or what it holds, may touch some objects;
        None if there is none. `opening` is that of the fingers, metres."""
        for near in self.starts(hand):
            if opening is not None:
                near = self.world.with_fingers(near, hand, opening)
            found = self._descent_from(near, hand, target, touched)
            if found is not None:
                return found
        return None

    def _descent_from(
        self, near: Joints, hand: str, target: HandTarget, touched: Collection[str]
    ) -> Descent | None:
        high, idle = self.above(target), self.idle_target(hand)
        start = self.kinematics.solve(hand, high, near, idle=idle, accept=self.clearance.free)
        if start is None:
            return None
        down = self.kinematics.line(hand, high, target.p_WP, start, idle=idle)
        if down is None:
            return None
        with self.clearance.touching(hand, touched):
            if not self.clearance.free_path([start, *down]):
                return None
        way = self.way(hand, start)
        return None if way is None else Descent(way, down)

    def starts(self, hand: str) -> list[Joints]:
        """Where inverse kinematics starts from: `rest`, and the same with an empty idle arm farther out,
        where it leaves room."""
        rest, other = self.rest(hand), _other(hand)
        if other in self.grips:
            return [rest]
        aside = rest.copy()
        aside[self.world.joint_names.index(f"{SIDES[other]}_shoulder_roll")] = ASIDE
        return [rest, aside]

    def rest(self, hand: str) -> Joints:
        """The home posture; if the other arm carries something, it does so, and the torso with it; fingers as
        commanded, the pads of an empty hand drawn in.

        Inverse kinematics starts from here, so that postures do not wander off over many actions.
        """
        other = _other(hand)
        command = self.world.command
        if hand not in self.grips:
            command = self.world.with_pads_in(command, hand)
        if other not in self.grips:
            return np.where(self._hand_joints, command, self.world.home)
        # The torso goes back to where the other arm's posture was solved for: with any other lean the
        # same arm joints may lower a tool onto the table.
        joints = np.where(self._arm_joints(hand), self.world.home, command)
        joints = np.where(self._arm_joints(other, "torso"), self.grips[other].carrying, joints)
        return joints

    def _arm_joints(self, hand: str, *more: str) -> list[bool]:
        prefixes = (f"{SIDES[hand]}_", *more)
        return [n.startswith(prefixes) and not is_hand_joint(n) for n in self.world.joint_names]

    def idle_target(self, hand: str) -> HandTarget | None:
        """Where the other hand stays, level, while `hand` works; None if it holds nothing."""
        other = _other(hand)
        if other not in self.grips:
            return None
        X_WH = self.kinematics.hand_pose(other, self.grips[other].carrying)
        up_W = np.array([0.0, 0.0, 1.0])
        up_H = X_WH.rotation().inverse() @ up_W
        p_WH = X_WH.translation()
        target = HandTarget(np.zeros(3), p_WH, up_H, up_W, CARRY_TILT, tolerance=CARRY_TOLERANCE)
        name = self.perception.held(other)
        if name is None or self.domain.objects[name].kind != "tool":
            return target
        # A tool sticks out far: it must not swing to where the working hand is.
        fingers_W = X_WH.rotation().matrix()[:, 1]
        return replace(target, tilt=TOOL_TILT, fingers_W=fingers_W, yaw_tolerance=TOOL_TURN)

    def go_home(self, hand: str) -> None:
        """Back to the home posture with one arm; an empty hand draws its pads in."""
        self.travel(hand, self.rest(hand))

    def grasp_targets(self, hand: str, p_WP: Vector, yaws: tuple[float, ...]) -> list[HandTarget]:
        """Ways to bring the finger tips of `hand` to `p_WP`, palm down, the most upright ones first."""
        base = HandTarget(fingertip(hand), p_WP, palm_axis(hand), DOWN, tilt=TILTS[0])
        return [
            HandTarget(base.p_HP, p_WP, base.axis_H, DOWN, tilt, direction)
            for tilt in TILTS
            for direction in finger_directions(yaws)
        ]
