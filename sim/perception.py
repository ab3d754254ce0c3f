"""What the robot knows of its surroundings, whatever it knows it by, and what follows for reach.

`Perception` is what skills and observations ask. `OraclePerception` reads the simulator's poses and
contacts: the truth, for experiments and for those who judge the robot. Cameras are in `sight`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cognitive_arch.domain import Domain, ReachLimits
from cognitive_arch.footprint import gets_behind
from cognitive_arch.perception.strangers import Stranger
from cognitive_arch.perception.top_view import described
from cognitive_arch.world.observation import HANDS, HandObservation, ObjectObservation, Observation
from sim.hands import HANDLE, SIDES, finger_names, hand_links
from sim.kinematics import Kinematics
from sim.rendering import Pixels
from sim.world import World

BEYOND = 0.05  # m by which a tool's head must get beyond the middle of an object
FALLEN = 0.05  # m below the table's top


class Perception(ABC):
    """Where things are, as far as the robot knows; what is within reach follows from the arms' kinematics, or
    from `limits`. Poses are X_WO, of whatever is believed to be there."""

    def __init__(self, domain: Domain, kinematics: Kinematics, limits: ReachLimits | None = None) -> None:
        self._domain = domain
        self._limits = limits
        self._kinematics = kinematics

    # -- what each way of knowing answers ---------------------------------------------------------------

    @property
    @abstractmethod
    def time(self) -> float:
        """Seconds of the episode."""

    @abstractmethod
    def look(self) -> None:
        """Take in how things are now; costs nothing where no time has passed since the last look."""

    def feel(self) -> None:  # noqa: B027 (nothing to note where all is known)
        """Take in what the hands hold at this moment."""

    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """The things believed to be there, seen or remembered, sorted."""

    @abstractmethod
    def visible(self) -> tuple[str, ...]:
        """Those of them that are perceived now."""

    @abstractmethod
    def absent(self) -> tuple[str, ...]:
        """Things that are known to be gone from where they were."""

    @abstractmethod
    def pose(self, name: str) -> RigidTransform:
        """X_WO of something that is believed to be there; raises `KeyError` for anything else."""

    @abstractmethod
    def held(self, hand: str) -> str | None:
        """What a hand holds."""

    @abstractmethod
    def supports(self, name: str) -> tuple[str, ...]:
        """The objects that `name` rests on."""

    @abstractmethod
    def on_table(self, name: str) -> bool:
        """Whether it rests on the table itself."""

    @abstractmethod
    def feels(self, what: str, name: str) -> bool:
        """Whether a hand, or a tool in a hand, presses on an object at this moment."""

    def take_hold(self, hand: str, name: str) -> None:  # noqa: B027 (nothing to note where all is known)
        """Note that the fingers of `hand` close around an object at this moment."""

    def strangers(self) -> Mapping[str, Stranger]:
        """What is seen and not known, by made-up names: it is in the way."""
        return {}

    def picture(self) -> Pixels | None:
        """The last look as an image, with what was made of it; None where there are no eyes."""
        return None

    def descriptors(self, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Shape descriptors of a thing as it was last seen well: of all of it, and of its two halves."""
        return (), ()

    def save(self) -> dict[str, Any]:
        """What is remembered from one look to the next, as plain data."""
        return {}

    def restore(self, saved: Mapping[str, Any]) -> None:  # noqa: B027
        """The inverse of `save`."""

    # -- what follows ---------------------------------------------------------------------------------

    def covered_by(self, name: str) -> tuple[str, ...]:
        """The objects that rest on `name`."""
        return tuple(other for other in self.names() if name in self.supports(other))

    def place(self, name: str) -> tuple[float, float, float]:
        """x, y (metres) and yaw (radians) of an object."""
        X_WO = self.pose(name)
        x, y, _ = X_WO.translation()
        return float(x), float(y), float(X_WO.rotation().ToRollPitchYaw().yaw_angle())

    def radius(self, name: str) -> float:
        """Half the smaller horizontal extent of an object, metres."""
        shape = self._domain.objects[name].shape
        return shape.width / 2 if shape.type == "tool" else min(shape.extent) / 2

    def observe(self) -> Observation:
        """One look, and what it tells. What has fallen off the table is absent from where it was."""
        self.look()
        holding = {hand: self.held(hand) for hand in HANDS}
        hands = tuple(HandObservation(hand, name) for hand, name in holding.items())
        holders = {name: hand for hand, name in holding.items() if name is not None}
        seen = set(self.visible())
        objects = tuple(self._describe(name, holders.get(name), name in seen) for name in self.names())
        return Observation(self.time, objects, hands, self.absent())

    def can_take(self, hand: str, name: str) -> bool:
        """Whether the hand gets to where the object is held: its middle, or a tool's handle."""
        shape, X_WO = self._domain.objects[name].shape, self.pose(name)
        if self._limits is not None:
            return hand in self._limits.hands(float(X_WO.translation()[0]), float(X_WO.translation()[1]))
        if shape.type != "tool":
            x, y, _ = X_WO.translation()
            return self._kinematics.reaches(hand, float(x), float(y))
        ends = (1.0,) if shape.bar > 0 else (1.0, -1.0)
        handles = (X_WO @ np.array([end * (shape.length / 2 - HANDLE[0]), 0.0, 0.0]) for end in ends)
        return any(self._kinematics.reaches(hand, float(p[0]), float(p[1])) for p in handles)

    def _tool_reaches(self, tool: str, x: float, y: float) -> bool:
        """Whether some hand gets to where it would hold the tool with its head beyond (x, y), metres."""
        if self._limits is not None:
            return self._limits.with_tool(x)
        shape = self._domain.objects[tool].shape
        assert shape.type == "tool"
        added = shape.length - HANDLE[0] - BEYOND
        for angle in (-0.4, 0.0, 0.4):
            place = (x + added * math.cos(angle), y + added * math.sin(angle))
            if any(self._kinematics.reaches(hand, *place) for hand in HANDS):
                return True
        return False

    def _hooks(self, tool: str, name: str) -> bool:
        """Whether the tool has a bar that gets behind the middle of the object, the shaft beside it."""
        shape = self._domain.objects[tool].shape
        assert shape.type == "tool"
        return gets_behind(shape, self._domain.objects[name].shape)

    def _describe(self, name: str, holder: str | None, visible: bool) -> ObjectObservation:
        x, y, z = (float(v) for v in self.pose(name).translation())
        spec = self._domain.objects[name]
        tools = [t for t in self.names() if self._domain.objects[t].kind == "tool" and t != name]
        hands = [hand for hand in HANDS if holder or self.can_take(hand, name)]
        desc, tooldesc = self.descriptors(name)
        by_tool = [tool for tool in tools if hands or self._tool_reaches(tool, x, y)]
        return ObjectObservation(
            name=name,
            kind=spec.kind,
            position=(x, y, z),
            below=() if holder else self.supports(name),
            reachable_with=(*hands, *by_tool),
            pullable_with=() if hands else tuple(t for t in by_tool if self._hooks(t, name)),
            yaw=self.place(name)[2],
            visible=visible,
            desc=desc,
            tooldesc=tooldesc,
        )


class OraclePerception(Perception):
    """The truth of a world: poses and contacts of the simulator."""

    def __init__(self, world: World, kinematics: Kinematics, limits: ReachLimits | None = None) -> None:
        super().__init__(world.domain, kinematics, limits)
        self._world = world

    @property
    def time(self) -> float:
        return self._world.time

    def look(self) -> None:
        """See `Perception.look`: there is nothing that is not known already."""

    def names(self) -> tuple[str, ...]:
        return tuple(name for name in self._world.scenario.objects if not self._fallen(name))

    def visible(self) -> tuple[str, ...]:
        return self.names()

    def absent(self) -> tuple[str, ...]:
        return tuple(name for name in self._world.scenario.objects if self._fallen(name))

    def pose(self, name: str) -> RigidTransform:
        return self._world.pose(name)

    def held(self, hand: str) -> str | None:
        """What both fingers of `hand` press on and nothing else carries."""
        contacts = self._world.contacts()
        fingers = finger_names(SIDES[hand])
        for name in self._world.scenario.objects:
            touched = all((finger, name) in contacts for finger in fingers)
            if touched and not self._carried(name, contacts):
                return name
        return None

    def supports(self, name: str) -> tuple[str, ...]:
        """See `Perception.supports`: in contact, lower, and overlapping it sideways."""
        contacts = self._world.contacts()
        return tuple(o for o in self._world.scenario.objects if self._rests_on(name, o, contacts))

    def on_table(self, name: str) -> bool:
        return ("table", name) in self._world.contacts()

    def descriptors(self, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """See `Perception.descriptors`: those of its shape as seen from above."""
        return described(self._domain.objects[name].shape)

    def feels(self, what: str, name: str) -> bool:
        links = hand_links(SIDES[what]) if what in SIDES else {what}
        return any(a in links and b == name for a, b in self._world.contacts())

    def _carried(self, name: str, contacts: frozenset[tuple[str, str]]) -> bool:
        if ("table", name) in contacts:
            return True
        return any(self._rests_on(name, o, contacts) for o in self._world.scenario.objects)

    def _rests_on(self, upper: str, lower: str, contacts: frozenset[tuple[str, str]]) -> bool:
        if upper == lower or (upper, lower) not in contacts:
            return False
        p_WU, p_WL = (self._world.pose(n).translation() for n in (upper, lower))
        sideways = math.hypot(p_WU[0] - p_WL[0], p_WU[1] - p_WL[1])
        apart = (self._world.height(upper) + self._world.height(lower)) / 2
        return bool(p_WU[2] - p_WL[2] > 0.6 * apart and sideways < self.radius(lower))

    def _fallen(self, name: str) -> bool:
        return bool(self._world.pose(name).translation()[2] < self._world.scene.table.height - FALLEN)
