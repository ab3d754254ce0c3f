"""One trial of the robot's own exploration: a tool or a bare hand moves an object, and where it went is seen.

Each of the four actions is one fixed movement in a straight line, whatever is in the hand: nothing is
refused because a tool does not suit. Taps and pushes begin beside or before the object, pulls behind it:
the shaft of a tool lies beside the object then, on the side where more of the tool's head is, and a bare
hand reaches over it. The middle of the tool's head, or the finger tips, are taken to a fixed place near
where the object's middle was; so it depends on the shapes of both how far the object goes,
if it goes at all. A little of everything is left to chance: where the object stands and how it is turned,
how well the robot aims, how far it moves, friction.

The arm follows inverse kinematics with its controllers; contact and friction decide the rest. A trial begins
with the hand already beside the object, and a tool is fixed to the hand: grips that slip are another subject.
"""

from __future__ import annotations

import gc
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from cognitive_arch.affordances.trials import ACTIONS, KINDS
from cognitive_arch.domain import Domain, Placement, Scene
from cognitive_arch.footprint import Point, footprint
from cognitive_arch.shapes import Box, Compound, Shape, ToolShape
from cognitive_arch.world.observation import HANDS
from sim.exploration_things import HELD_OUT, OBJECTS, TOOLS, exploration_domain
from sim.exploration_views import VIEWS, Descriptors, descriptors_of, hand_descriptors
from sim.hands import PALM_SIGN, SIDES, Posture
from sim.kinematics import HandTarget, Kinematics
from sim.scenario import FRICTION, TABLE_CENTRE_X, TABLE_SIZE
from sim.skills import bare, tap
from sim.skills.tool import FLOAT, HARDLY, HeldTool, Sweep, discomfort
from sim.world import Joints, World

DIRECTIONS: Mapping[str, float] = {  # rad, of the world; the robot looks along -x
    "tapFromLeft": math.pi / 2,
    "tapFromRight": -math.pi / 2,
    "pull": 0.0,
    "push": math.pi,
}
TOOL_END: Mapping[str, float] = {
    "tapFromLeft": -0.020,
    "tapFromRight": -0.020,
    "pull": 0.015,
    "push": 0.015,
}
"""How far beyond the place of the object's middle the middle of a tool's head is taken, metres."""
HAND_END: Mapping[str, float] = {"tapFromLeft": 0.01, "tapFromRight": 0.01, "pull": 0.015, "push": 0.015}
"""The same for the tips of the fingers."""
END_SPREAD = 0.005  # m
GAP = 0.008  # m between effector and object at first, at least
GAP_SPREAD = 0.008  # m
AIM_SPREAD = 0.008  # m across the course
COURSE_SPREAD, SKEW_SPREAD = 0.10, 0.07  # rad
OVERLAP = 0.012  # m that a tapping tool reaches beyond the object's middle
FRICTION_SPREAD = 0.25  # of friction, up or down
SPEED = 0.12  # m/s
INSET = 0.05  # m from the end of its handle, where a tool is held
DEPTH = 0.047  # m from the palm to the middle of the shaft between the pads
TOOL_X, HAND_X = (-0.68, -0.45), (-0.46, -0.28)  # m
TOOL_Y, HAND_Y = (-0.06, 0.26), (0.02, 0.28)  # m towards the side of the hand
SETTLE, REST = 0.1, 0.5  # s before and after the movement
PIECE = 0.03  # m between two waypoints
DRAWS = 200
CARDS, TRIALS = 0, 1  # what random numbers are for
HELD_OUT_CARDS = 9  # for one of every other object: 30 % of the trials, as in thesis Sec. 5.4.1.1


@dataclass(frozen=True)
class Setup:
    """What is tried: with which hand, with what in it (a tool's name, or the posture of a bare hand), which
    action, on which object."""

    hand: str
    manipulator: str
    action: str
    object: str

    @property
    def kind(self) -> str:
        """`tool` or `hand`."""
        return "tool" if self.manipulator in TOOLS else "hand"


@dataclass(frozen=True)
class Attempt:
    """How it is tried: where the object stands and how it is turned, friction, and the movement."""

    placement: Placement
    friction: float
    path: tuple[Joints, ...]
    seconds: float


@dataclass(frozen=True)
class Outcome:
    """Where the object stood and where it came to rest, or left the table, metres; how it was turned at
    first, radians; which views of the things were described, and how often a place was drawn that the arm
    does not reach."""

    setup: Setup
    start: Point
    end: Point
    yaw: float
    fell: bool
    view: int
    draws: int

    @property
    def descriptors(self) -> Descriptors:
        """`m_*`, `h_*` and `o_*`."""
        return {
            **_manipulator(self.setup.manipulator, self.setup.hand, self.view),
            **descriptors_of(OBJECTS[self.setup.object], self.view, self.yaw),
        }


@cache
def _manipulator(name: str, hand: str, view: int) -> Descriptors:
    if name in TOOLS:
        return descriptors_of(TOOLS[name], view)
    return hand_descriptors(Posture(name), hand, view)


def explore(kind: str, seed: int, block: int, place: int, picture: Path | None = None) -> Outcome:
    """A trial of `kind` (`hand` or `tool`): that at `place` within a block of trials with the same things.

    What it is follows from `seed` and these numbers alone. `picture` is where to keep a picture (PNG) of
    before and after.
    """
    rng = _stream(kind, seed, TRIALS, block, place)
    return try_out(draw_setup(kind, seed, block, place), rng, picture)


def try_out(setup: Setup, rng: np.random.Generator, picture: Path | None = None) -> Outcome:
    """One trial, all that is left to chance drawn from `rng`."""
    bench = Bench.of(setup.hand, setup.manipulator, setup.object)
    for draws in range(DRAWS):
        attempt = bench.draw(setup, rng)
        if attempt is not None and bench.prepare(attempt):
            before = bench.world.positions()
            start, end, fell = bench.carry_out(attempt)
            if picture is not None:
                bench.save_picture([before, bench.world.positions()], picture)
            return Outcome(setup, start, end, attempt.placement.yaw, fell, int(rng.integers(VIEWS)), draws)
    raise AssertionError(f"no place found for {setup}")


def _stream(kind: str, seed: int, use: int, *numbers: int) -> np.random.Generator:
    """Random numbers for one use (`CARDS` or `TRIALS`) and nothing else, of trials of `kind`."""
    return np.random.default_rng([seed, KINDS.index(kind), use, *numbers])


def draw_setup(kind: str, seed: int, block: int, place: int) -> Setup:
    """What to try: things as a shuffled pack of cards deals them to the blocks, actions in turn."""
    known = tuple(TOOLS) if kind == "tool" else tuple(posture.value for posture in Posture)
    objects = [*OBJECTS, *[HELD_OUT] * (HELD_OUT_CARDS - 1)]
    cards = list(itertools.product(HANDS, known, objects))
    pack, card = divmod(block, len(cards))
    dealt = _stream(kind, seed, CARDS, pack).permutation(len(cards))[card]
    hand, manipulator, obj = cards[int(dealt)]
    return Setup(hand, manipulator, ACTIONS[place % len(ACTIONS)], obj)


class Bench:
    """A world with one object, and something to move it with, used for many trials."""

    def __init__(self, hand: str, manipulator: str, obj: str) -> None:
        self.domain: Domain = exploration_domain()
        self.hand, self.manipulator, self.object = hand, manipulator, obj
        self.shape: Shape = OBJECTS[obj]
        placements = {obj: Placement(position=(-0.4, 0.0))}
        self.fixed: dict[str, tuple[str, RigidTransform]] = {}
        self.tool: HeldTool | None = None
        if manipulator in TOOLS:
            placements[manipulator] = Placement(position=(-0.4, 0.0))
            self.tool = held(hand, manipulator)
            self.fixed[manipulator] = (f"{SIDES[hand]}_hand_dh_frame", self.tool.X_HT)
        self.scene = Scene(name="exploration", objects=placements)
        self.world = World(self.domain, self.scene, fixed=self.fixed)
        self.kinematics = _kinematics(self.world.joint_names, self.scene.table.height)
        self._rest = self._at_rest()

    @staticmethod
    @lru_cache(maxsize=1)
    def of(hand: str, manipulator: str, obj: str) -> Bench:
        """The bench for these; it is used until there is to be another."""
        gc.collect()  # a world is few objects of many megabytes: the collector would wait too long
        return Bench(hand, manipulator, obj)

    def _at_rest(self) -> Joints:
        world = self.world
        if self.tool is None:
            return world.with_posture(world.home, self.hand, Posture(self.manipulator))
        return world.with_fingers(world.home, self.hand, self.tool.shape.width / 2)

    # -- what is to be done -----------------------------------------------------------------------------

    def draw(self, setup: Setup, rng: np.random.Generator) -> Attempt | None:
        """A place for the object, and the movement there; None if the arm cannot do it."""
        side = -1.0 if self.hand == "LeftHand" else 1.0
        bounds_x, bounds_y = (TOOL_X, TOOL_Y) if self.tool else (HAND_X, HAND_Y)
        place = (float(rng.uniform(*bounds_x)), side * float(rng.uniform(*bounds_y)))
        yaw = float(rng.uniform(-math.pi, math.pi))
        course = DIRECTIONS[setup.action] + float(rng.normal(0.0, COURSE_SPREAD))
        chance = Chance(
            gap=GAP + abs(float(rng.normal(0.0, GAP_SPREAD))),
            aside=float(rng.normal(0.0, AIM_SPREAD)),
            skew=float(rng.normal(0.0, SKEW_SPREAD)),
            side=1.0 if rng.uniform() < 0.5 else -1.0,
            further=float(rng.normal(0.0, END_SPREAD)),
            pitch=float(rng.uniform(-0.12, 0.12)),
        )
        friction = FRICTION * float(rng.uniform(1 - FRICTION_SPREAD, 1 + FRICTION_SPREAD))
        made = self._with_tool if self.tool else self._with_hand
        ends = made(setup.action, place, yaw, course, chance)
        path = self._path(*ends) if ends else None
        if path is None or ends is None:
            return None
        length = float(np.linalg.norm(ends[1].p_WP - ends[0].p_WP))
        return Attempt(Placement(position=place, yaw=yaw), friction, tuple(path), length / SPEED)

    def _with_tool(
        self, action: str, place: Point, yaw: float, course: float, chance: Chance
    ) -> tuple[HandTarget, HandTarget] | None:
        assert self.tool is not None
        shaft = course if action == "pull" else course - DIRECTIONS[action]
        head, end = tool_course(self.tool.shape, self.shape, action, place, yaw, course, chance)
        sweep = Sweep(shaft + chance.skew, head, end)
        if discomfort(self.tool, sweep) > HARDLY:
            return None
        low = self.scene.table.height + self.tool.shape.width / 2 + FLOAT
        first, last = (self.tool.target(np.array([*p, low]), sweep.yaw) for p in (head, end))
        return first, last

    def _with_hand(
        self, action: str, place: Point, yaw: float, course: float, chance: Chance
    ) -> tuple[HandTarget, HandTarget] | None:
        posture = Posture(self.manipulator)
        heading, pitch, roll = _hand_held(action, posture)
        stance = bare.stance(self.hand, posture, course + heading + chance.skew, pitch + chance.pitch, roll)
        across = (-math.sin(course), math.cos(course))
        aimed = (place[0] + chance.aside * across[0], place[1] + chance.aside * across[1])
        X_WO = RigidTransform(RotationMatrix.MakeZRotation(yaw), [*aimed, 0.0])
        xy = X_WO.translation()
        body = footprint(self.shape, (float(xy[0]), float(xy[1])), yaw)
        start = bare.aimed(stance, body, aimed, self.shape.height, course, GAP)
        ahead = (math.cos(course), math.sin(course))
        to_middle = (aimed[0] - start.start[0]) * ahead[0] + (aimed[1] - start.start[1]) * ahead[1]
        way = to_middle + HAND_END[action] + chance.further
        end = (start.start[0] + way * ahead[0], start.start[1] + way * ahead[1])
        low = self.scene.table.height + stance.radius + start.height
        return stance.target(np.array([*start.start, low])), stance.target(np.array([*end, low]))

    def _path(self, first: HandTarget, last: HandTarget) -> list[Joints] | None:
        """Joints along the straight line between two targets."""
        solve = self.kinematics.solve
        if solve(self.hand, last, self._rest, restarts=1) is None:
            return None
        start = solve(self.hand, first, self._rest, restarts=2)
        if start is None:
            return None
        pieces = max(2, math.ceil(float(np.linalg.norm(last.p_WP - first.p_WP)) / PIECE))
        along = self.kinematics.line(self.hand, first, last.p_WP, start, pieces=pieces)
        return None if along is None else [start, *along]

    # -- doing it ---------------------------------------------------------------------------------------

    def prepare(self, attempt: Attempt) -> bool:
        """Put everything where it begins; false where the arm would be in the object or in the table."""
        world = self.world
        world.set_friction(self.object, friction=attempt.friction)
        world.reset({self.object: attempt.placement}, attempt.path[0])
        return all({a, b} == {self.object, "table"} for a, b in world.overlaps())

    def carry_out(self, attempt: Attempt) -> tuple[Point, Point, bool]:
        """Where the object stood, where it came to rest (or left the table), and whether it left it."""
        world = self.world
        world.hold(SETTLE)
        start = last = self._place()
        fell = False

        def watch() -> None:
            nonlocal last, fell
            fell = fell or not _on_table(self._place())
            last = last if fell else self._place()

        world.on_tick = watch
        world.follow(attempt.path[1:], attempt.seconds)
        world.hold(REST)
        world.on_tick = lambda: None
        return start, last, fell

    def save_picture(self, looks: Sequence[NDArray[np.float64]], path: Path) -> None:
        """What is to be seen at some positions of the plant, side by side."""
        from sim.pictures import Stage, View, save_picture

        stage, seen = Stage(self.domain, self.scene, fixed=self.fixed), []
        for positions in looks:
            stage.show(positions)
            seen.append(stage.picture(View.SIDE))
        save_picture(np.hstack(seen), path)

    def _place(self) -> Point:
        x, y, _ = self.world.pose(self.object).translation()
        return (float(x), float(y))


@dataclass(frozen=True)
class Chance:
    """What differs from one movement to the next: metres between effector and object at first, metres off
    across the course, radians of the effector to its course, the side of the shaft where it is all one,
    metres by which the movement is longer, radians by which a bare hand points lower."""

    gap: float
    aside: float
    skew: float
    side: float
    further: float
    pitch: float


def tool_course(
    tool: ToolShape, obj: Shape, action: str, place: Point, yaw: float, course: float, chance: Chance
) -> tuple[Point, Point]:
    """Where the middle of a tool's head begins and ends, metres.

    `place` and `yaw` are the object's, `course` is the direction of the movement, radians.
    """
    ahead, across = (math.cos(course), math.sin(course)), (-math.sin(course), math.cos(course))
    behind, aside = half_width(obj, course - yaw), half_width(obj, course + math.pi / 2 - yaw)
    half, (low, high) = tool.width / 2, tool.sides
    if action == "pull":
        # More of the head is on this side of the shaft, so the object is to be there.
        side = math.copysign(1.0, high + low) if abs(high + low) > 1e-6 else chance.side
        offset = -side * (half + aside + 0.5 * GAP + abs(chance.aside))
        back = half + behind + chance.gap
    elif action == "push":
        # The middle of the head is to meet the object; seen along the course left and right are swapped.
        offset, back = (low + high) / 2 + chance.aside, half + behind + chance.gap
    else:
        # The head's end leads; the shaft is across the course, its far end beyond the object.
        towards_right = action == "tapFromLeft"
        back = (high if towards_right else -low) + behind + chance.gap
        beyond = OVERLAP + chance.aside
        offset = beyond if towards_right else -beyond
    start = (
        place[0] - back * ahead[0] + offset * across[0],
        place[1] - back * ahead[1] + offset * across[1],
    )
    way = back + TOOL_END[action] + chance.further
    return start, (start[0] + way * ahead[0], start[1] + way * ahead[1])


def half_width(shape: Shape, angle: float) -> float:
    """How far a thing reaches from its middle in the direction `angle` of its own frame (radians), metres."""
    if isinstance(shape, Compound):
        toward = (math.cos(angle), math.sin(angle))
        return max(
            part.place[0] * toward[0] + part.place[1] * toward[1] + half_width(part.solid, angle)
            for part in shape.parts
        )
    x, y = shape.extent
    if isinstance(shape, Box | ToolShape):
        return abs(x / 2 * math.cos(angle)) + abs(y / 2 * math.sin(angle))
    return x / 2


def held(hand: str, name: str) -> HeldTool:
    """A tool as the explorer holds it: its shaft along the stretched fingers, its head ahead of them."""
    shape, out = TOOLS[name], PALM_SIGN[SIDES[hand]]
    x, z = np.array([-1.0, 0.0, 0.0]), np.array([0.0, 0.0, -out])
    R_HT = RotationMatrix(np.column_stack([x, np.cross(z, x), z]))
    p_HF = np.array([0.020, 0.0, out * DEPTH])  # between the pads
    p_TF = np.array([shape.length / 2 - INSET, 0.0, 0.0])
    return HeldTool(hand, name, shape, RigidTransform(R_HT, p_HF - R_HT @ p_TF))


def _hand_held(action: str, posture: Posture) -> tuple[float, float, float]:
    """Heading from the course, pitch and roll of a bare hand, radians."""
    upright = bare.upright_pitch(posture)
    if action == "push":
        return 0.0, upright, 0.0
    if action == "pull":
        return math.pi, 0.06, 0.0
    return DIRECTIONS[action], max(tap.LEAST, upright), math.pi / 2


def _on_table(place: Point) -> bool:
    return abs(place[0] - TABLE_CENTRE_X) <= TABLE_SIZE[0] / 2 and abs(place[1]) <= TABLE_SIZE[1] / 2


@lru_cache(maxsize=2)
def _kinematics(joint_names: tuple[str, ...], table: float) -> Kinematics:
    return Kinematics(joint_names, table)
