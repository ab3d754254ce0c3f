"""Physical noise: errors of arms and tools as small values that compose and print themselves.

A noise level (0 to 1, one per capability: `left`, `right`, `pull`, `push`) is meant to be the fraction of
that capability's actions that fail. Nothing fails by decree: every part makes the robot move, grip or aim
worse, and what comes of it is contact and gravity. A part's fields say how large it is at level 1 (errors
of aim: at level 0.5). At level 0 nothing is drawn and nothing changes.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from sim.hands import SIDES
from sim.kinematics import Vector
from sim.world import Joints, World

LARGEST_SPREAD = 0.08  # m; an error of aim at level 1


def spread(level: float, half: float) -> float:
    """Standard deviation (metres, along each of two axes) of a Gaussian error of aim at a level.

    `half` is that at which half of the actions fail, and so it is the spread at level 0.5. The shape is
    fitted to how often grasps and puts were seen to fail; near level 1 hardly anything works any more.
    """
    if not 0 < level < 1:
        return LARGEST_SPREAD if level >= 1 else 0.0
    return min(LARGEST_SPREAD, half * (math.log(0.5) / math.log(level)) ** 0.4)


@dataclass
class ArmState:
    """What an episode has drawn for one arm, and what its joints remember: plain data, that can be saved.

    `offsets` and `play` are per joint of the arm (rad): how far its zero is off, and how far the joint lags
    behind its motor; `friction` is a factor on that of its fingers.
    """

    offsets: list[float] = field(default_factory=list)
    play: list[float] = field(default_factory=list)
    friction: float = 1.0


class ArmPart(ABC):
    """A source of error of one arm; what a part does not touch it leaves as it is."""

    @abstractmethod
    def told(self, level: float) -> str:
        """This part at a level, in one line with units."""

    def begin(self, level: float, arm: ArmState, n_joints: int, rng: np.random.Generator) -> None:  # noqa: B027
        """Draw what holds for an episode; most parts draw nothing."""

    def aim(self, level: float, verb: str, rng: np.random.Generator) -> Vector:
        """Error of where one `grasp` or `put` goes, metres, (2,)."""
        return np.zeros(2)

    def grip(self, level: float, rng: np.random.Generator) -> float:
        """Factor on how hard the fingers close in one grasp."""
        return 1.0

    def set_point(
        self, level: float, joints: Joints, change: Joints, arm: ArmState, rng: np.random.Generator
    ) -> Joints:
        """The arm's set point as it arrives, (n_joints,) rad; `change` is that since the last one."""
        return joints


class ToolPart(ABC):
    """A source of error of pulling or pushing with a tool."""

    @abstractmethod
    def told(self, level: float) -> str:
        """This part at a level, in one line with units."""

    @abstractmethod
    def head(self, level: float, rng: np.random.Generator) -> Vector:
        """Error of where the tool's head is in one sweep: along the shaft, across, up; metres, (3,)."""


@dataclass(frozen=True)
class AimError(ArmPart):
    """The hand goes elsewhere, anew every time: Gaussian in x and y, `grasp` or `put` metres at level 0.5."""

    grasp: float
    put: float

    def told(self, level: float) -> str:
        grasp, put = (1000 * spread(level, half) for half in (self.grasp, self.put))
        return f"aim off by a Gaussian of {grasp:.1f} mm (grasp) or {put:.1f} mm (put) in x and y, every time"

    def aim(self, level: float, verb: str, rng: np.random.Generator) -> Vector:
        return rng.normal(0.0, spread(level, self.grasp if verb == "grasp" else self.put), 2)


@dataclass(frozen=True)
class SightError(ArmPart):
    """An object is seen elsewhere, anew for every look before a grasp or put: Gaussian in x and y, metres."""

    sigma: float

    def told(self, level: float) -> str:
        return (
            f"objects seen off by a Gaussian of {1000 * level * self.sigma:.1f} mm in x and y, at every look"
        )

    def aim(self, level: float, verb: str, rng: np.random.Generator) -> Vector:
        return rng.normal(0.0, level * self.sigma, 2)


@dataclass(frozen=True)
class Calibration(ArmPart):
    """The zeros of the arm's joints are off for a whole episode: Gaussian, rad."""

    sigma: float

    def told(self, level: float) -> str:
        return f"joint zeros off by a Gaussian of {1000 * level * self.sigma:.1f} mrad, once per episode"

    def begin(self, level: float, arm: ArmState, n_joints: int, rng: np.random.Generator) -> None:
        arm.offsets = rng.normal(0.0, level * self.sigma, n_joints).tolist()

    def set_point(
        self, level: float, joints: Joints, change: Joints, arm: ArmState, rng: np.random.Generator
    ) -> Joints:
        return joints + np.array(arm.offsets)


@dataclass(frozen=True)
class Backlash(ArmPart):
    """A joint follows its motor only where the play between them, `width` rad, is used up."""

    width: float

    def told(self, level: float) -> str:
        return f"backlash of {1000 * level * self.width:.1f} mrad in every joint"

    def begin(self, level: float, arm: ArmState, n_joints: int, rng: np.random.Generator) -> None:
        arm.play = [0.0] * n_joints

    def set_point(
        self, level: float, joints: Joints, change: Joints, arm: ArmState, rng: np.random.Generator
    ) -> Joints:
        half = level * self.width / 2
        play = np.clip(np.array(arm.play) - change, -half, half)
        arm.play = play.tolist()
        return joints + play


@dataclass(frozen=True)
class ActuatorNoise(ArmPart):
    """Joints shake while they move: Gaussian, rad, anew for every set point."""

    sigma: float

    def told(self, level: float) -> str:
        return f"set points shaken by a Gaussian of {1000 * level * self.sigma:.1f} mrad while moving"

    def set_point(
        self, level: float, joints: Joints, change: Joints, arm: ArmState, rng: np.random.Generator
    ) -> Joints:
        return joints + rng.normal(0.0, level * self.sigma, len(joints)) if change.any() else joints


@dataclass(frozen=True)
class SlipperyFingers(ArmPart):
    """The fingers' friction is lower for a whole episode: by up to the fraction `loss`, uniformly drawn."""

    loss: float

    def told(self, level: float) -> str:
        return f"finger friction lower by up to {100 * level * self.loss:.0f} %, once per episode"

    def begin(self, level: float, arm: ArmState, n_joints: int, rng: np.random.Generator) -> None:
        arm.friction *= 1.0 - level * self.loss * float(rng.random())


@dataclass(frozen=True)
class WeakGrip(ArmPart):
    """The fingers close with a random fraction of their squeeze, anew for every grasp: u ** (power * level)
    with u uniform in 0..1. Little is left only now and then; then the object slips."""

    power: float

    def told(self, level: float) -> str:
        half = 0.5 ** (self.power * level)
        tenth = 0.1 ** (self.power * level)
        return (
            f"grip weakened, anew for every grasp: below {100 * half:.0f} % of its squeeze in 1 of 2, "
            f"below {100 * tenth:.0f} % in 1 of 10"
        )

    def grip(self, level: float, rng: np.random.Generator) -> float:
        return float(rng.random() ** (self.power * level))


@dataclass(frozen=True)
class HeadError(ToolPart):
    """The robot is wrong about where the tool's head is, anew for every sweep: Gaussian along the shaft and
    across it, of `half` metres at level 0.5."""

    half: float

    def told(self, level: float) -> str:
        sigma = 1000 * spread(level, self.half)
        return f"the tool's head off by a Gaussian of {sigma:.1f} mm along the shaft and across, every time"

    def head(self, level: float, rng: np.random.Generator) -> Vector:
        return np.append(rng.normal(0.0, spread(level, self.half), 2), 0.0)


@dataclass(frozen=True)
class HeadLift(ToolPart):
    """The tool's head is carried too high, anew for every sweep: the amount of a Gaussian, metres."""

    sigma: float

    def told(self, level: float) -> str:
        return f"the tool's head too high by a Gaussian of {1000 * level * self.sigma:.1f} mm, every time"

    def head(self, level: float, rng: np.random.Generator) -> Vector:
        return np.array([0.0, 0.0, abs(rng.normal(0.0, level * self.sigma))])


@dataclass(frozen=True)
class PhysicalNoise:
    """A composition: the parts of each arm, those of pulling and pushing, and the levels they are at."""

    levels: Mapping[str, float]
    arm: tuple[ArmPart, ...] = (
        AimError(grasp=0.0185, put=0.0205),
        SightError(sigma=0.006),
        Calibration(sigma=0.006),
        Backlash(width=0.008),
        ActuatorNoise(sigma=0.002),
        SlipperyFingers(loss=0.5),
        WeakGrip(power=1.5),
    )
    pull: tuple[ToolPart, ...] = (HeadError(half=0.015), HeadLift(sigma=0.008))
    push: tuple[ToolPart, ...] = (HeadError(half=0.0255), HeadLift(sigma=0.020))

    def level(self, capability: str) -> float:
        """The level of `left`, `right`, `pull` or `push`."""
        return self.levels.get(capability, 0.0)

    def told(self) -> tuple[str, ...]:
        """What is injected, one line per part; capabilities that share level and parts share the lines."""
        parts: Mapping[str, tuple[ArmPart | ToolPart, ...]] = {
            "left arm": self.arm,
            "right arm": self.arm,
            "pull": self.pull,
            "push": self.push,
        }
        lines: dict[str, list[str]] = {}
        for name in parts:
            level = self.level(name.removesuffix(" arm"))
            for part in parts[name] if level > 0 else ():
                lines.setdefault(part.told(level), []).append(name)
        return tuple(f"{', '.join(names)}: {line}" for line, names in lines.items())

    def __str__(self) -> str:
        return "; ".join(self.told()) or "none"


class EpisodeNoise:
    """The noise of one episode: what was drawn for it, and what is drawn as it goes on."""

    def __init__(self, noise: PhysicalNoise, world: World, rng: np.random.Generator) -> None:
        self._noise = noise
        self._world = world
        self._rng = rng
        self._arms: dict[str, ArmState] = {}
        self._noisy = [hand for hand in sorted(SIDES) if noise.level(_capability(hand)) > 0]

    def begin(self) -> None:
        """Draw what holds for the episode, and let it take effect."""
        for hand in self._noisy:
            arm = self._arms[hand] = ArmState()
            for part in self._noise.arm:
                part.begin(self._level(hand), arm, len(self._world.arm_joints(hand)), self._rng)
        self.take_effect()

    def take_effect(self) -> None:
        """Change the world's fingers and set points for what was drawn."""
        for hand in SIDES:
            self._world.set_finger_friction(hand, self._arms[hand].friction if hand in self._arms else 1.0)
        self._world.on_send = self._arriving if self._arms else None

    def save(self) -> dict[str, Any]:
        """What was drawn, as plain data."""
        return {hand: asdict(arm) for hand, arm in sorted(self._arms.items())}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """The inverse of `save`; `take_effect` has to follow."""
        if sorted(saved) != self._noisy:
            raise ValueError(f"it has noise of {', '.join(sorted(saved)) or 'no arm'}")
        arms = {hand: ArmState(**arm) for hand, arm in saved.items()}
        for hand, arm in arms.items():
            if {len(arm.offsets), len(arm.play)} - {0, len(self._world.arm_joints(hand))}:
                raise ValueError(f"the noise of {hand} is of other joints")
        self._arms = arms

    def _level(self, hand: str) -> float:
        return self._noise.level(_capability(hand))

    def aim(self, hand: str, verb: str) -> Vector:
        """How far the next `grasp` or `put` goes wrong, metres, (3,)."""
        error = np.zeros(3)
        if hand in self._arms:
            for part in self._noise.arm:
                error[:2] += part.aim(self._level(hand), verb, self._rng)
        return error

    def grip(self, hand: str) -> float:
        """Factor on the squeeze of the next grasp."""
        factor = 1.0
        if hand in self._arms:
            for part in self._noise.arm:
                factor *= part.grip(self._level(hand), self._rng)
        return factor

    def head(self, verb: str) -> Vector:
        """How far off the tool's head is in the next `pull` or `push`: along, across, up; metres, (3,)."""
        error, level = np.zeros(3), self._noise.level(verb)
        if level > 0:
            for part in self._noise.pull if verb == "pull" else self._noise.push:
                error += part.head(level, self._rng)
        return error

    def _arriving(self, joints: Joints, change: Joints) -> Joints:
        """The set point as it arrives at the motors."""
        arriving = joints.copy()
        for hand, arm in self._arms.items():
            own = self._world.arm_joints(hand)
            for part in self._noise.arm:
                arriving[own] = part.set_point(self._level(hand), arriving[own], change[own], arm, self._rng)
        return arriving


def _capability(hand: str) -> str:
    return "left" if hand == "LeftHand" else "right"
