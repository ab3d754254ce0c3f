"""The bare hand on an object: how it is held, what it covers, and sweeping it over the table.

What `tapFromLeft`, `tapFromRight`, `push` and `pull` without a tool share. A `Stance` is a way to hold the
hand; its lowest point, the tips of some fingers, is what inverse kinematics brings close to the table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.world.observation import HANDS
from sim.footprint import Capsule, Point, footprint, on_table, smallest_gap
from sim.hands import BENDS, PALM_SIGN, SIDES, Posture, limbs
from sim.kinematics import HandTarget, Vector, palm_axis
from sim.robot import Robot
from sim.skills.base import come_down, looked_for
from sim.skills.tool import obstacles
from sim.world import Joints

FLOAT = 0.002  # m between the lowest finger tips and the table
GAP = 0.015  # m between hand and object where a sweep begins
LIFT = 0.09  # m above the table's level at which the hand comes and goes
SPEED = 0.12  # m/s of a sweep
MARGIN = 0.006  # m that the hand keeps from what it is not to touch
OVER = 0.004  # m that a part of the hand passes over things
RIM = 0.02  # m that stay between a moved object and the table's edge
ROOM = 0.006  # m around a moved object
TILT = 0.04  # rad by which a stance may be missed
MOVED = 0.025  # m that an object has to move; less is no effect to speak of
SLANT = 0.7  # of its way that an object has to move along the course
COURSES = (0.0, 0.25, -0.25)  # rad from the commanded direction
SKEWS = (0.0, 0.3, -0.3)  # rad from the hand's straight position
DISTANCES = (0.085, 0.06)  # m that a sweep goes on from the first contact
FACED = 0.6  # of its height: what meets an object only higher up than that does not move it
_TIE = 0.001  # m; finger tips as low as the lowest
_FACE = 0.008  # m; parts of the hand as far ahead as the first
_PIECE = 0.03  # m between two waypoints, or two looks at what is in the way
_TRIES = 24


@dataclass(frozen=True)
class Part:
    """A limb of the hand as it is held: `a` and `b` from the stance's lowest point, world axes, metres."""

    a: Vector
    b: Vector
    radius: float
    finger: bool

    def points(self) -> Iterator[Vector]:
        """Middles along the limb."""
        for fraction in np.linspace(0.0, 1.0, 5):
            yield self.a + fraction * (self.b - self.a)


@dataclass(frozen=True)
class Stance:
    """A way to hold a hand: its axes x and y and the direction out of its palm in the world, and its parts
    around `p_HL`, the middle of the lowest finger tips in the hand frame (metres)."""

    hand: str
    x_W: Vector
    y_W: Vector
    palm_W: Vector
    p_HL: Vector
    radius: float
    parts: tuple[Part, ...]

    def target(self, p_WL: Vector) -> HandTarget:
        """The hand pose that brings the lowest point to `p_WL`, metres."""
        return HandTarget(
            self.p_HL,
            p_WL,
            palm_axis(self.hand),
            self.palm_W,
            TILT,
            fingers_W=self.y_W,
            yaw_tolerance=TILT,
        )

    def front(self, course: Point, below: float) -> tuple[float, float]:
        """Where the hand meets what is `below` metres high: how far ahead of the lowest point, and how far
        to the left of the course, metres."""
        across = (-course[1], course[0])
        # What is drawn closer is behind the fingers; the palm is over it and has nothing to do with it.
        drawing = self.x_W[0] * course[0] + self.x_W[1] * course[1] < -0.5
        points = [
            (p, part.radius) for part in self.parts if part.finger or not drawing for p in part.points()
        ]
        limit = max(below, min(p[2] - r for p, r in points) + _TIE)
        low = [
            (p[0] * course[0] + p[1] * course[1] + r, p[0] * across[0] + p[1] * across[1])
            for p, r in points
            if p[2] - r <= limit
        ]
        ahead = max(along for along, _ in low)
        face = [aside for along, aside in low if along > ahead - _FACE]
        return ahead, (min(face) + max(face)) / 2

    def covers(self, place: Point, height: float) -> list[tuple[Capsule, float]]:
        """What the hand covers of the table with its lowest point there, each with the height of its
        underside, metres; `height` is that of the lowest point's underside."""
        return [
            (
                Capsule(
                    (place[0] + part.a[0], place[1] + part.a[1]),
                    (place[0] + part.b[0], place[1] + part.b[1]),
                    part.radius,
                ),
                float(min(part.a[2], part.b[2]) - part.radius + self.radius + height),
            )
            for part in self.parts
        ]


def stance(hand: str, posture: Posture, heading: float, pitch: float, roll: float) -> Stance:
    """Fingers pointing to `heading` (radians, of the world) and down by `pitch`; the palm faces the table
    with `roll` 0 and the robot's middle with pi/2."""
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    out = PALM_SIGN[SIDES[hand]]
    x_W = math.cos(pitch) * ahead - math.sin(pitch) * up
    under = -math.sin(pitch) * ahead - math.cos(pitch) * up
    palm_W = math.cos(roll) * under - out * math.sin(roll) * np.cross(ahead, up)
    y_W = np.cross(out * palm_W, x_W)
    R_WH = np.column_stack([x_W, y_W, out * palm_W])
    shape = limbs(SIDES[hand], posture)
    ends = [(np.array(end), limb.radius) for limb in shape for end in (limb.a, limb.b)]
    undersides = [float((R_WH @ p)[2]) - radius for p, radius in ends]
    lowest = [end for end, z in zip(ends, undersides, strict=True) if z < min(undersides) + _TIE]
    p_HL = np.mean([p for p, _ in lowest], axis=0)
    parts = tuple(
        Part(R_WH @ (np.array(limb.a) - p_HL), R_WH @ (np.array(limb.b) - p_HL), limb.radius, limb.finger)
        for limb in shape
    )
    return Stance(hand, x_W, y_W, palm_W, p_HL, lowest[0][1], parts)


def upright_pitch(posture: Posture) -> float:
    """The pitch (radians) of a hand, palm down, with its finger tips as upright as may be."""
    return min(0.45, max(0.0, math.pi / 2 - sum(BENDS[posture])))


@dataclass(frozen=True)
class Sweep:
    """The hand goes from `start` to `end` (places of its lowest point, metres), its tips `height` metres
    above the table; the object then goes by `shift`."""

    stance: Stance
    start: Point
    end: Point
    height: float
    shift: Point

    def places(self) -> Iterator[tuple[Point, float]]:
        """Places along the way, both ends included, and the fraction of the way."""
        n = max(1, math.ceil(math.dist(self.start, self.end) / _PIECE))
        for i in range(n + 1):
            t = i / n
            yield (
                (
                    self.start[0] + (self.end[0] - self.start[0]) * t,
                    self.start[1] + (self.end[1] - self.start[1]) * t,
                ),
                t,
            )


@dataclass(frozen=True)
class Motion:
    """The way to above the start and waypoints down, along, and away again."""

    way: list[Joints]
    down: list[Joints]
    along: list[Joints]
    away: list[Joints]
    seconds: float


def unusable(robot: Robot, obj: str, hand: str) -> FailureReason | None:
    """Why a bare hand cannot be used on the object, if so."""
    if robot.perception.held(hand) is not None or obj in {robot.perception.held(h) for h in HANDS}:
        return FailureReason.HAND_BUSY
    return FailureReason.COVERED if robot.perception.covered_by(obj) else None


def sweep_object(
    robot: Robot, obj: str, hand: str, towards: float, stances: Sequence[tuple[float, float, float]]
) -> FailureReason:
    """Move an object on the table with the bare hand in the direction `towards` (radians).

    `stances` are the ways to hold the hand, best first: its heading from `towards`, pitch and roll, radians.
    """
    reason = unusable(robot, obj, hand)
    if reason is None and robot.perception.supports(obj):
        reason = FailureReason.COVERED
    if reason is not None:
        return reason
    motion, reason = _plan(robot, obj, hand, towards, stances)
    if motion is None:
        return reason
    before = robot.perception.pose(obj).translation()
    touched = _perform(robot, obj, hand, motion)
    return judge(robot, obj, before, towards, touched)


def _plan(
    robot: Robot, obj: str, hand: str, towards: float, stances: Sequence[tuple[float, float, float]]
) -> tuple[Motion | None, FailureReason]:
    aim = robot.noise.aim(hand, "grasp")
    others = obstacles(robot, obj)
    robot.look()
    free: list[Sweep] = []
    reasons = []
    for sweep in _sweeps(robot, obj, hand, towards, stances, aim):
        reason = _in_the_way(robot, obj, sweep, others)
        if reason is None:
            free.append(sweep)
        else:
            reasons.append(reason)
    # A hand whose tips must stay high to come down behind the object hardly gets hold of it.
    for sweep in sorted(free, key=lambda sweep: sweep.height)[:_TRIES]:
        motion = _solve(robot, obj, sweep)
        if isinstance(motion, Motion):
            return motion, FailureReason.NONE
        reasons.append(motion)
    told = (FailureReason.BLOCKED, FailureReason.OUT_OF_REACH, FailureReason.OFF_TABLE)
    return None, next(reason for reason in told if reason in reasons)


def _sweeps(
    robot: Robot,
    obj: str,
    hand: str,
    towards: float,
    stances: Sequence[tuple[float, float, float]],
    aim: Vector,
) -> Iterator[Sweep]:
    """Ways to sweep the object, the straightest first."""
    believed = RigidTransform(aim) @ robot.perception.pose(obj)
    body = footprint(robot.domain.objects[obj].shape, believed)
    x, y, _ = believed.translation()
    height = robot.world.height(obj)
    for distance in DISTANCES:
        for skew in SKEWS:
            for heading, pitch, roll in stances:
                for turn in COURSES:
                    angle = towards + turn
                    held = stance(hand, robot.postures[hand], angle + heading + skew, pitch, roll)
                    yield aimed(held, body, (float(x), float(y)), height, angle, distance)


def aimed(
    held: Stance, body: tuple[Capsule, ...], place: Point, height: float, angle: float, distance: float
) -> Sweep:
    course = (math.cos(angle), math.sin(angle))
    behind = max(
        (place[0] - p[0]) * course[0] + (place[1] - p[1]) * course[1] + part.radius
        for part in body
        for p in (part.a, part.b)
    )

    def at(along: float, aside: float) -> Point:
        return (
            place[0] + along * course[0] - aside * course[1],
            place[1] + along * course[1] + aside * course[0],
        )

    ahead, aside = held.front(course, FACED * height - held.radius - FLOAT)
    start = at(-behind - GAP - ahead, -aside)
    # Straight fingers reach over the object: where they would come down on it, the whole hand stays higher.
    over = [
        underside
        for part, underside in held.covers(start, FLOAT)
        if underside < height + OVER and smallest_gap([part], body) < OVER
    ]
    rise = height + 2 * OVER - min(over) if over else 0.0
    end = at(-behind + distance - ahead, -aside)
    return Sweep(held, start, end, FLOAT + rise, (distance * course[0], distance * course[1]))


def _in_the_way(
    robot: Robot, obj: str, sweep: Sweep, others: dict[str, tuple[Capsule, ...]]
) -> FailureReason | None:
    """What speaks against a sweep: the object would fall, or hand or object would hit something."""
    body = footprint(robot.domain.objects[obj].shape, robot.perception.pose(obj))
    low = [capsule for capsules in others.values() for capsule in capsules]
    if not all(on_table(part.moved(*sweep.shift), RIM) for part in body):
        return FailureReason.OFF_TABLE
    for place, t in sweep.places():
        moved = [part.moved(sweep.shift[0] * t, sweep.shift[1] * t) for part in body]
        if smallest_gap(moved, low) < ROOM or not clear(
            robot, sweep.stance.covers(place, sweep.height), others
        ):
            return FailureReason.BLOCKED
    return None


def clear(
    robot: Robot, parts: Iterable[tuple[Capsule, float]], others: dict[str, tuple[Capsule, ...]]
) -> bool:
    """Whether parts of the arm, with their undersides' heights above the table, keep clear of things."""
    parts = list(parts)
    for name, capsules in others.items():
        top = robot.top_of(name) - robot.scene.table.height
        if smallest_gap([part for part, underside in parts if underside < top + OVER], capsules) < MARGIN:
            return False
    return True


def _solve(robot: Robot, obj: str, sweep: Sweep) -> Motion | FailureReason:
    hand, kinematics = sweep.stance.hand, robot.kinematics
    idle, rest = robot.idle_target(hand), robot.rest(hand)
    low = robot.scene.table.height + sweep.stance.radius + sweep.height

    def at(place: Point, above: float = 0.0) -> HandTarget:
        return sweep.stance.target(np.array([*place, low + above]))

    # Both ends are asked for first to give up early: sweeps that fail, fail there.
    for place in (sweep.end, sweep.start):
        if kinematics.solve(hand, at(place), rest, idle=idle, restarts=1) is None:
            return FailureReason.OUT_OF_REACH
    above = kinematics.solve(hand, at(sweep.start, LIFT), rest, idle=idle, accept=robot.clearance.free)
    if above is None:
        return FailureReason.OUT_OF_REACH
    length = math.dist(sweep.start, sweep.end)
    back = GAP / length
    # The hand leaves the object before it goes up: fingers bent behind it would lift its rim.
    left = (
        sweep.end[0] + back * (sweep.start[0] - sweep.end[0]),
        sweep.end[1] + back * (sweep.start[1] - sweep.end[1]),
    )
    legs: list[list[Joints]] = []
    joints = above
    for begin, goal, pieces in (
        (at(sweep.start, LIFT), at(sweep.start), 4),
        (at(sweep.start), at(sweep.end), max(2, math.ceil(length / _PIECE))),
        (at(sweep.end), at(left), 1),
        (at(left), at(left, LIFT), 3),
    ):
        leg = kinematics.line(hand, begin, goal.p_WP, joints, idle=idle, pieces=pieces)
        if leg is None:
            return FailureReason.OUT_OF_REACH
        legs.append(leg)
        joints = leg[-1]
    down, along, back_off, up = legs
    away = [*back_off, *up]
    with robot.clearance.touching(hand, [obj]):
        if not robot.clearance.free_path([above, *down, *along, *away]):
            return FailureReason.BLOCKED
    way = robot.way(hand, above)
    return FailureReason.BLOCKED if way is None else Motion(way, down, along, away, max(0.5, length / SPEED))


def _perform(robot: Robot, obj: str, hand: str, motion: Motion) -> bool:
    """Carry out a sweep and go home; returns whether the hand ever touched the object."""
    world, touched = robot.world, False

    def watch() -> bool:
        nonlocal touched
        touched = touched or robot.perception.feels(hand, obj)
        return False

    robot.go(motion.way)
    if come_down(robot, hand, obj, motion.down, 0.8):
        world.follow(motion.along, motion.seconds, watch)
        world.follow(motion.away, 1.0, watch)
    else:
        touched = True
        world.follow([world.command, motion.way[-1]], 0.6)
    robot.go_home(hand)
    return touched


def judge(robot: Robot, obj: str, before: Vector, towards: float, touched: bool) -> FailureReason:
    """What the observed displacement says of a sweep."""
    if not looked_for(robot, obj):
        return FailureReason.OFF_TABLE
    if not touched:
        return FailureReason.NO_CONTACT
    dx, dy, _ = robot.perception.pose(obj).translation() - before
    way = math.hypot(dx, dy)
    along = dx * math.cos(towards) + dy * math.sin(towards)
    if way < MOVED:
        return FailureReason.NO_EFFECT
    return FailureReason.NONE if along > max(MOVED, SLANT * way) else FailureReason.UNEXPECTED_EFFECT
