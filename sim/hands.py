"""What a hand of the robot is: its parts, joints and measures, and the postures its fingers take.

icub-models has no movable fingers on its full robots, so the mesh is cut off at the knuckles and each hand
gets four fingers of three phalanges, all bent alike by three motors, a rigid thumb, and in its palm a
gripper: two pads that close on each other, on a carriage that draws them in when they are not needed.
The hand frame is the robot's own `[lr]_hand_dh_frame`: x runs along the fingers, y away from the thumb, z
through the palm (out of it on the right hand, into it on the left one). One hand is the other's mirror
image in z.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

SIDES: dict[str, str] = {"LeftHand": "l", "RightHand": "r"}
PALM_SIGN: dict[str, float] = {"l": -1.0, "r": 1.0}
"""Which way the palm faces along z of the hand frame."""

FINGER_LENGTH = 0.055  # m, of a pad that is out, from the palm to the tip
FINGER_WIDTH = 0.042  # m, along x of the hand
FINGER_THICKNESS = 0.008  # m, along y of the hand
FINGER_OFFSET = 0.020  # m, of the pads in front of the hand frame
STROKE = 0.050  # m, travel of one pad from the middle
FINGER_FORCE = 10.0  # N, at most
DRAWN_IN = 0.050  # m that the carriage takes the pads into the palm
PAD_RADIUS = 0.002  # m, of the small spheres that carry contact
PAD_STIFFNESS = 5.0e4  # N/m
FINGER_FRICTION = 1.0
HANDLE = (0.030, 0.050, 0.080, 0.110)  # m from a tool's end, where it may be held, best first

KNUCKLE = (0.036, 0.011)  # m, along x and behind the palm's surface
PHALANGES = (0.027, 0.018, 0.012)  # m, between the joints and from the last one to the tip's middle
FINGER_RADIUS = 0.0075  # m
FINGERS_AT = (-0.024, -0.008, 0.008, 0.024)  # m, along y: index, middle, ring, little finger
THUMB = ((-0.040, -0.030, 0.006), (-0.022, -0.052, 0.003), (-0.010, -0.066, -0.002))
"""The thumb's joints: x, y and depth behind the palm's surface, metres."""
THUMB_RADIUS = 0.008  # m
PALM = (-0.060, 0.036, 0.064, 0.030)  # m, from x to x, width along y, depth
HOUSING = ((0.020, 0.0, 0.037), (0.020, 0.072, 0.030))
"""On the back of the hand, for the pads that are drawn in: centre (x, y, depth) and size, metres."""

_HAND_JOINT = re.compile(r"[lr]_(finger_[ab]|carriage|knuckle_\d)")


class Posture(StrEnum):
    """What the four fingers do (thesis Fig. 42)."""

    STRAIGHT = "straight"
    BENT = "bent"
    ARCHED = "arched"


BENDS: Mapping[Posture, tuple[float, float, float]] = {  # rad, of the three joints of every finger
    Posture.STRAIGHT: (0.0, 0.0, 0.0),
    Posture.BENT: (1.2, 0.15, 0.05),
    Posture.ARCHED: (0.5, 0.6, 0.6),
}


def finger_names(side: str) -> tuple[str, str]:
    """The two pad links (and joints) of side `l` or `r`."""
    return (f"{side}_finger_a", f"{side}_finger_b")


def carriage_name(side: str) -> str:
    """The joint (and link) that draws the pads in: 0 is out, `DRAWN_IN` is in."""
    return f"{side}_carriage"


def knuckle_names(side: str) -> tuple[str, ...]:
    """The joints of the four fingers, from the palm to the tips."""
    return tuple(f"{side}_knuckle_{n + 1}" for n in range(len(PHALANGES)))


def phalanx_names(side: str) -> tuple[str, ...]:
    """The links that these joints move."""
    return tuple(f"{side}_phalanx_{n + 1}" for n in range(len(PHALANGES)))


def hand_links(side: str) -> frozenset[str]:
    """All links of a hand that can touch something."""
    return frozenset({f"{side}_hand_dh_frame", *finger_names(side), *phalanx_names(side)})


def is_hand_joint(name: str) -> bool:
    """Whether a joint belongs to a hand: where the hand goes does not depend on it, and inverse kinematics
    leaves it alone."""
    return _HAND_JOINT.fullmatch(name) is not None


@dataclass(frozen=True)
class Limb:
    """A rounded part of a hand, a finger's or not: all points within `radius` of the segment from `a` to
    `b`, metres, in the hand frame."""

    a: tuple[float, float, float]
    b: tuple[float, float, float]
    radius: float
    finger: bool = False


def finger_line(posture: Posture) -> list[tuple[float, float]]:
    """The joints of a finger from the knuckle to the tip: along x, and behind the palm's surface, metres."""
    x, depth = KNUCKLE
    points, angle = [(x, depth)], 0.0
    for length, bend in zip(PHALANGES, BENDS[posture], strict=True):
        angle += bend
        x, depth = x + length * math.cos(angle), depth - length * math.sin(angle)
        points.append((x, depth))
    return points


def limbs(side: str, posture: Posture) -> list[Limb]:
    """What a hand with its pads drawn in consists of: phalanges, thumb, the palm's two halves, the pads'
    tips in the palm, and their housing on its back."""
    out = PALM_SIGN[side]
    line = finger_line(posture)
    parts = [
        Limb((x0, y, -out * d0), (x1, y, -out * d1), FINGER_RADIUS, finger=True)
        for y in FINGERS_AT
        for (x0, d0), (x1, d1) in itertools.pairwise(line)
    ]
    for (x0, y0, d0), (x1, y1, d1) in itertools.pairwise(THUMB):
        parts.append(Limb((x0, y0, -out * d0), (x1, y1, -out * d1), THUMB_RADIUS))
    rear, front, width, depth = PALM
    half = width / 4
    for y in (-half, half):
        centre = -out * depth / 2
        parts.append(Limb((rear + half, y, centre), (front - half, y, centre), half))
    pads, end = -out * (DRAWN_IN - FINGER_LENGTH + FINGER_THICKNESS), FINGER_WIDTH / 2 - FINGER_THICKNESS
    parts.append(Limb((FINGER_OFFSET - end, 0, pads), (FINGER_OFFSET + end, 0, pads), FINGER_THICKNESS))
    (x, _, deep), (thick, wide, high) = HOUSING
    end, centre = wide / 2 - thick / 2, -out * (deep + high / 2 - thick / 2)
    parts.append(Limb((x, -end, centre), (x, end, centre), thick / 2))
    return parts
