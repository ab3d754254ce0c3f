"""What an environment lets the robot perceive in one look.

An observation names only what is perceived now. Turning it into a world state, with memory of what is
out of sight, is the work of `world.anchoring`. Positions are in the robot's root frame, in metres: the
robot looks along -x, its left is y < 0, z is up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal as OneOf

HANDS: tuple[str, str] = ("LeftHand", "RightHand")


@dataclass(frozen=True, slots=True)
class ObjectObservation:
    """One object in view, or one that is known to be hidden somewhere (not `visible`).

    `below` lists the objects it rests on directly (its supports other than the table); `reachable_with`
    the hands and tools that can act on it where it is, `pullable_with` the tools that can draw it closer.
    `desc` are the shape descriptors of all of it, `tooldesc` those of its two halves; none if not seen.
    """

    name: str
    kind: OneOf["object", "tool"]
    position: tuple[float, float, float]
    below: tuple[str, ...] = ()
    reachable_with: tuple[str, ...] = ()
    pullable_with: tuple[str, ...] = ()
    yaw: float = 0.0
    visible: bool = True
    desc: tuple[float, ...] = ()
    tooldesc: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class HandObservation:
    """One hand, by proprioception: what it holds, if anything."""

    name: str
    holding: str | None = None


@dataclass(frozen=True, slots=True)
class Observation:
    """One look at the world.

    `objects` are those in view or known to be hidden, sorted by name; `absent` are objects whose last known
    place is in view and empty (as opposed to merely hidden); `properties` are further true atoms that a
    domain defines, written `isCut(Cake)`.
    """

    time: float
    objects: tuple[ObjectObservation, ...]
    hands: tuple[HandObservation, ...]
    absent: tuple[str, ...] = ()
    properties: tuple[str, ...] = ()
