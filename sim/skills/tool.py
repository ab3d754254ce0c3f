"""A tool in the hand, and sweeping it over the table: what `pull` and `push` share."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.shapes import ToolShape
from cognitive_arch.world.observation import HANDS
from sim.footprint import Capsule, Point, disc, footprint, on_table, slab, smallest_gap, tool_footprint
from sim.hands import FINGER_WIDTH, STROKE
from sim.kinematics import HandTarget, Vector
from sim.robot import Robot
from sim.skills.base import release
from sim.world import Joints

FLOAT = 0.003  # m between a sweeping tool and the table
LIFT = 0.075  # m above that at which a tool travels: over everything but a tall stack
END_LIFT = 0.045  # m that it is lifted at first where a sweep ends, near the body: over what was pulled
SPEED = 0.10  # m/s of a sweep
MARGIN = 0.008  # m that a sweep keeps from what it is not to touch
OVER = 0.008  # m that a raised shaft passes over it
LEVEL = 0.012  # rad; at the far end of a shaft this is 4 mm
YAW_TOLERANCE = 0.03  # rad
PITCHES = (0.0, 0.15, 0.22)  # rad by which the handle may be higher than the head
NEAREST, NEAR, FARTHEST = -0.15, -0.24, -0.47  # m, x of a hand that holds a tool level
HARDLY = 0.8  # of `discomfort`: of what is worse, nothing was ever feasible
PALM_HEIGHT = 0.045  # m above the table: what is taller must not be under the palm
_SHAFT_PARTS = 6
_PIECE = 0.03  # m between two waypoints, or two looks at what is in the way


@dataclass(frozen=True)
class HeldTool:
    """A tool in a hand. Its frame T has its origin mid-shaft and x from the head to the handle."""

    hand: str
    name: str
    shape: ToolShape
    X_HT: RigidTransform

    @property
    def p_TH(self) -> Vector:
        """The middle of the head (bar or tip), metres."""
        return np.array([-self.shape.length / 2 + self.shape.width / 2, 0.0, 0.0])

    @property
    def grip(self) -> float:
        """From the middle of the head to the fingers along the shaft, metres."""
        fingers = self.X_HT.inverse() @ np.array([0.02, 0.0, 0.0])
        return float(fingers[0] - self.p_TH[0])

    def held_at(self, inset: float) -> HeldTool:
        """The same, held `inset` metres from the end of its handle."""
        by = self.shape.length - self.shape.width / 2 - inset - self.grip
        return replace(self, X_HT=self.X_HT @ RigidTransform([-by, 0.0, 0.0]))

    def target(self, head: Vector, yaw: float, pitch: float = 0.0) -> HandTarget:
        """The hand pose that brings the head to `head` (metres), the shaft at `yaw` and `pitch`."""
        R_WT = RollPitchYaw(0.0, -pitch, yaw).ToRotationMatrix()
        R_TH = self.X_HT.rotation().inverse()
        up_H = R_TH.inverse() @ np.array([0.0, 0.0, 1.0])
        fingers_W = R_WT @ (R_TH @ np.array([0.0, 1.0, 0.0]))
        return HandTarget(
            self.X_HT @ self.p_TH,
            head,
            up_H,
            R_WT @ np.array([0.0, 0.0, 1.0]),
            LEVEL,
            fingers_W,
            YAW_TOLERANCE,
        )

    def with_head_off(self, error: Vector) -> HeldTool:
        """The tool as the robot takes it to be whose head will be off by `error`: along the shaft, across it,
        up; metres."""
        return replace(self, X_HT=self.X_HT @ RigidTransform(-error))

    def covers(self, head: Point, yaw: float, pitch: float) -> list[tuple[Capsule, float]]:
        """What tool and finger tips cover of the table with the head there, each with the height of its
        underside above the table (metres): a pitched shaft passes over what is low."""
        cos, sin, rise = math.cos(yaw), math.sin(yaw), math.sin(pitch)
        half = self.shape.width / 2

        def at(along: float, across: float = 0.0) -> Point:
            return (head[0] + along * cos - across * sin, head[1] + along * sin + across * cos)

        low, high = self.shape.sides
        parts = [(Capsule(at(0.0, low + half), at(0.0, high - half), half), FLOAT)]
        ends = np.linspace(0.0, self.shape.length - self.shape.width, _SHAFT_PARTS + 1)
        for near, far in itertools.pairwise(float(end) for end in ends):
            parts.append((Capsule(at(near), at(far), half), FLOAT + near * rise))
        parts.append((disc(at(self.grip), FINGER_WIDTH), FLOAT + self.grip * rise - 0.008))
        return parts

    def palm(self, head: Point, yaw: float) -> Capsule:
        """What is below the palm and the stretched fingers."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        front, back = self.grip - 0.08, self.grip + 0.10
        ends = [(head[0] + along * cos, head[1] + along * sin) for along in (front, back)]
        return Capsule(ends[0], ends[1], 0.045)


@dataclass(frozen=True)
class Sweep:
    """The head goes from `start` to `end` (metres) on the table, the shaft at `yaw` and the handle
    raised by `pitch` (radians)."""

    yaw: float
    start: Point
    end: Point
    pitch: float = 0.0

    @property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    def heads(self) -> Iterator[Point]:
        """Places along the way, both ends included."""
        n = max(1, math.ceil(self.length / _PIECE))
        for i in range(n + 1):
            yield (
                self.start[0] + (self.end[0] - self.start[0]) * i / n,
                self.start[1] + (self.end[1] - self.start[1]) * i / n,
            )


@dataclass(frozen=True)
class Motion:
    """The way to above the start of a sweep, the waypoints down, along and up again, and its direction
    (radians)."""

    way: list[Joints]
    down: list[Joints]
    along: list[Joints]
    up: list[Joints]
    seconds: float
    course: float


def held_tool(robot: Robot, name: str, hand: str) -> HeldTool | None:
    """The tool in the hand; None if the hand does not hold it, or `name` is no tool."""
    shape = robot.domain.objects[name].shape
    if not isinstance(shape, ToolShape) or robot.perception.held(hand) != name:
        return None
    X_HT = robot.world.hand_pose(hand).inverse() @ robot.perception.pose(name)
    if shape.bar <= 0 and X_HT.inverse().translation()[0] < 0:
        X_HT = X_HT @ RigidTransform(RollPitchYaw(0.0, 0.0, math.pi), np.zeros(3))
    return HeldTool(hand, name, shape, X_HT)


def unusable(robot: Robot, obj: str, tool: str, hand: str) -> FailureReason | None:
    """Why the tool in the hand cannot be used on the object, if so."""
    if robot.perception.held(hand) != tool or hand not in robot.grips:
        return FailureReason.HAND_EMPTY
    if obj in {robot.perception.held(h) for h in HANDS}:
        return FailureReason.HAND_BUSY
    if robot.domain.objects[tool].kind != "tool":
        return FailureReason.NOT_A_TOOL
    if robot.perception.covered_by(obj) or robot.perception.supports(obj):
        return FailureReason.COVERED
    return None


def obstacles(robot: Robot, *but: str) -> dict[str, tuple[Capsule, ...]]:
    """What everything else covers of the table: what lies on it, known or not, by name."""
    held = {robot.perception.held(hand) for hand in HANDS}
    known = {
        name: footprint(robot.domain.objects[name].shape, robot.perception.pose(name))
        for name in robot.perception.names()
        if name not in but and name not in held
    }
    strangers = robot.perception.strangers().items()
    return known | {name: slab(one.shape, RigidTransform(one.pose)) for name, one in strangers}


def discomfort(tool: HeldTool, sweep: Sweep) -> float:
    """How far (in 10 cm) the hand leaves the part of the table where it can hold the shaft level at that
    yaw, and how much (in 5 rad) the shaft leaves the most natural direction.

    Inverse kinematics decides; this only says what to ask it first. The limits are read off a map of what
    the left hand reaches; the right one is its mirror image.
    """
    side = 1.0 if tool.hand == "LeftHand" else -1.0
    yaw = side * sweep.yaw
    cost = 0.2 * abs(yaw + 0.3)
    for head in (sweep.start, sweep.end):
        x = head[0] + tool.grip * math.cos(sweep.yaw)
        y = side * (head[1] + tool.grip * math.sin(sweep.yaw))
        far = 0.4 * max(0.0, NEAR - x)
        low = -0.36 - 0.15 * min(0.0, yaw) + far
        high = -0.03 - 0.17 * yaw + far
        cost += 10 * (max(0.0, low - y) + max(0.0, y - high) + max(0.0, FARTHEST - x) + max(0.0, x - NEAREST))
    return cost


def is_free(robot: Robot, tool: HeldTool, sweep: Sweep, others: dict[str, tuple[Capsule, ...]]) -> bool:
    """Whether tool, fingers and palm pass all obstacles on the way, beside them or over them."""
    table = robot.scene.table.height
    tops = {name: robot.top_of(name) - table for name in others}
    for head in sweep.heads():
        palm = tool.palm(head, sweep.yaw)
        parts = tool.covers(head, sweep.yaw, sweep.pitch)
        for name, capsules in others.items():
            low = [part for part, underside in parts if underside < tops[name] + OVER]
            if smallest_gap(low, capsules) < MARGIN:
                return False
            if tops[name] > PALM_HEIGHT + tool.grip * math.sin(sweep.pitch) and (
                smallest_gap([palm], capsules) < 0
            ):
                return False
    return True


def first_feasible(
    robot: Robot, tool: HeldTool, obj: str, sweeps: Iterable[Sweep], limit: int = 60
) -> Motion | None:
    """The motion for the first of the sweeps that the arm can do, touching nothing but the object.

    At most `limit` are tried, and none that the hand can hardly reach.
    """
    robot.look({tool.hand: (tool.name, tool.X_HT)})
    likely = (sweep for sweep in sweeps if discomfort(tool, sweep) <= HARDLY)
    for sweep in itertools.islice(likely, limit):
        motion = _solve(robot, tool, obj, sweep)
        if motion is not None:
            return motion
    return None


def _solve(robot: Robot, tool: HeldTool, obj: str, sweep: Sweep) -> Motion | None:
    # The head's lowest edge is the one away from the handle.
    half = tool.shape.width / 2 * (math.cos(sweep.pitch) + math.sin(sweep.pitch))
    low = robot.scene.table.height + half + FLOAT
    kinematics, hand, idle = robot.kinematics, tool.hand, robot.idle_target(tool.hand)

    def at(place: Point, height: float) -> HandTarget:
        return tool.target(np.array([*place, height]), sweep.yaw, sweep.pitch)

    # Both ends are asked for first to give up early: sweeps that fail, fail there.
    rest = robot.rest(hand)
    for place in (sweep.end, sweep.start):
        if kinematics.solve(hand, at(place, low), rest, idle=idle, restarts=1) is None:
            return None
    corners = [
        at(sweep.start, low + LIFT),
        at(sweep.start, low),
        at(sweep.end, low),
        at(sweep.end, low + END_LIFT),
    ]
    pieces = [4, max(2, math.ceil(sweep.length / _PIECE)), 3]
    path = _through(robot, hand, corners, pieces)
    if path is None:
        # From the other end the arm may come to bend in another way.
        backwards = _through(robot, hand, corners[::-1], pieces[::-1])
        path = backwards[::-1] if backwards else None
    if path is None:
        return None
    with robot.clearance.touching(hand, [obj]):
        if not robot.clearance.free_path(path):
            return None
    way = robot.way(hand, path[0])
    if way is None:
        return None
    down, along, up = pieces[0] + 1, pieces[0] + pieces[1] + 1, len(path)
    seconds = max(0.6, 0.95 * sweep.length / SPEED)
    course = math.atan2(sweep.end[1] - sweep.start[1], sweep.end[0] - sweep.start[0])
    return Motion(way, path[1:down], path[down:along], path[along:up], seconds, course)


def _through(
    robot: Robot, hand: str, corners: Sequence[HandTarget], pieces: Sequence[int]
) -> list[Joints] | None:
    """Joints at the first corner, and waypoints along straight lines from each to the next, in so many
    pieces."""
    kinematics, idle = robot.kinematics, robot.idle_target(hand)
    tried = (
        kinematics.solve(hand, corners[0], start, idle=idle, accept=robot.clearance.free)
        for start in robot.starts(hand)
    )
    joints = next((found for found in tried if found is not None), None)
    if joints is None:
        return None
    path = [joints]
    for (begin, end), n in zip(itertools.pairwise(corners), pieces, strict=True):
        leg = kinematics.line(hand, begin, end.p_WP, path[-1], idle=idle, pieces=n)
        if leg is None:
            return None
        path += leg
    return path


def perform(robot: Robot, tool: HeldTool, obj: str, motion: Motion) -> tuple[FailureReason, bool]:
    """Carry out a sweep and take the tool aside again; says whether the tool was lost, and whether it ever
    touched the object."""
    touched = False

    def watch() -> bool:
        nonlocal touched
        touched = touched or robot.perception.feels(tool.name, obj)
        return False

    robot.go(motion.way)
    if robot.perception.held(tool.hand) != tool.name:
        return _lost(robot, tool.hand), touched
    robot.world.follow(motion.down, 1.0)
    robot.world.hold(0.1)
    robot.world.follow(motion.along, motion.seconds, watch)
    robot.world.hold(0.1)
    robot.world.follow(motion.up, 0.8)
    if robot.perception.held(tool.hand) != tool.name:
        return _lost(robot, tool.hand), touched
    carry_tool(robot, tool.hand, tool.name)
    kept = robot.perception.held(tool.hand) == tool.name
    return FailureReason.NONE if kept else FailureReason.SLIPPED, touched


def _lost(robot: Robot, hand: str) -> FailureReason:
    release(robot, hand, STROKE)
    robot.go_home(hand)
    return FailureReason.SLIPPED


LAY_YAWS = (0.3, 0.0, 0.6, -0.3)  # rad outwards, at which a tool is laid down
LAY_PLACES = ((-0.30, -0.26, -0.34, -0.22), (0.20, 0.15, 0.25, 0.10))  # m, x and |y| of the hand


def lay_targets(robot: Robot, tool: HeldTool, *insets: float) -> Iterator[HandTarget]:
    """Ways to lay the tool flat on a free place of the table, where it could also be held at `insets`
    (metres from the end of its handle)."""
    side = -1.0 if tool.hand == "LeftHand" else 1.0
    low = robot.scene.table.height + tool.shape.width / 2 + FLOAT
    others = [capsule for capsules in obstacles(robot, tool.name).values() for capsule in capsules]
    middle = tool.grip - tool.shape.length / 2 + tool.shape.width / 2
    for outwards, x, y in itertools.product(LAY_YAWS, *LAY_PLACES):
        yaw, y = -side * outwards, side * y
        along = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        centre = np.array([x, y, low]) - middle * along
        covered = tool_footprint(tool.shape, (float(centre[0]), float(centre[1])), yaw)
        if smallest_gap(covered, others) < MARGIN or not all(map(on_table, covered)):
            continue
        head = np.array([x, y, low]) - tool.grip * along
        if all(_can_hold(robot, tool.held_at(inset), head, yaw) for inset in insets):
            yield tool.target(head, yaw)


def _can_hold(robot: Robot, tool: HeldTool, head: Vector, yaw: float) -> bool:
    target = tool.target(head, yaw)
    return robot.kinematics.solve(tool.hand, target, robot.rest(tool.hand)) is not None


CARRY_YAWS: Sequence[float] = (0.7, 0.5, 0.9, 0.3)  # rad outwards
CARRY_PLACE = (-0.22, 0.22)  # m, x and |y| of the hand
CARRY_LIFT = 0.18  # m above the table


def carry_tool(robot: Robot, hand: str, name: str) -> None:
    """Hold the tool up and sideways, where the other hand can work in front of the robot."""
    tool = held_tool(robot, name, hand)
    assert tool is not None
    side = -1.0 if hand == "LeftHand" else 1.0
    x, y = CARRY_PLACE[0], side * CARRY_PLACE[1]
    height = robot.scene.table.height + CARRY_LIFT
    robot.look()
    for outwards in CARRY_YAWS:
        yaw = -side * outwards
        head = np.array([x - tool.grip * math.cos(yaw), y - tool.grip * math.sin(yaw), height])
        joints = robot.kinematics.solve(
            hand,
            tool.target(head, yaw),
            robot.rest(hand),
            idle=robot.idle_target(hand),
            accept=robot.clearance.free,
        )
        if joints is not None:
            robot.travel(hand, joints)
            break
    robot.grips[hand].carrying = robot.world.command
