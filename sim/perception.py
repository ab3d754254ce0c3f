"""Oracle perception: an observation read from the simulator's poses and contacts, not from images."""

from __future__ import annotations

import math

import numpy as np

from cognitive_arch.domain import ReachLimits
from cognitive_arch.footprint import outer_radius
from cognitive_arch.world.observation import HANDS, HandObservation, ObjectObservation, Observation
from sim.hands import HANDLE, SIDES, finger_names
from sim.kinematics import Kinematics
from sim.world import World

BEYOND = 0.05  # m by which a tool's head must get beyond the middle of an object
FALLEN = 0.05  # m below the table's top


class OraclePerception:
    """Looks at one world. What is within reach follows from the arms' kinematics, or from `limits`."""

    def __init__(self, world: World, kinematics: Kinematics, limits: ReachLimits | None = None) -> None:
        self._world = world
        self._limits = limits
        self._kinematics = kinematics

    def observe(self) -> Observation:
        """One look. What has fallen off the table is reported as absent from where it was."""
        world = self._world
        names = tuple(world.scenario.objects)
        fallen = tuple(n for n in names if self._fallen(n))
        hands = tuple(HandObservation(hand, self.held(hand)) for hand in HANDS)
        objects = tuple(self._see(name) for name in names if name not in fallen)
        return Observation(world.time, objects, hands, fallen)

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
        """The objects that `name` rests on: in contact, lower, and overlapping it sideways."""
        contacts = self._world.contacts()
        return tuple(o for o in self._world.scenario.objects if self._rests_on(name, o, contacts))

    def covered_by(self, name: str) -> tuple[str, ...]:
        """The objects that rest on `name`."""
        contacts = self._world.contacts()
        return tuple(o for o in self._world.scenario.objects if self._rests_on(o, name, contacts))

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

    def radius(self, name: str) -> float:
        """Half the smaller horizontal extent of an object, metres."""
        shape = self._world.domain.objects[name].shape
        return shape.width / 2 if shape.type == "tool" else min(shape.extent) / 2

    def _fallen(self, name: str) -> bool:
        return bool(self._world.pose(name).translation()[2] < self._world.scene.table.height - FALLEN)

    def can_take(self, hand: str, name: str) -> bool:
        """Whether the hand gets to where the object is held: its middle, or a tool's handle."""
        shape, X_WO = self._world.domain.objects[name].shape, self._world.pose(name)
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
        shape = self._world.domain.objects[tool].shape
        assert shape.type == "tool"
        added = shape.length - HANDLE[0] - BEYOND
        for angle in (-0.4, 0.0, 0.4):
            place = (x + added * math.cos(angle), y + added * math.sin(angle))
            if any(self._kinematics.reaches(hand, *place) for hand in HANDS):
                return True
        return False

    def _hooks(self, tool: str, name: str) -> bool:
        """Whether the tool has a bar that gets behind the middle of the object, the shaft beside it."""
        shape = self._world.domain.objects[tool].shape
        assert shape.type == "tool"
        beside = shape.width / 2 + outer_radius(self._world.domain.objects[name].shape)
        return shape.bar / 2 >= beside

    def _see(self, name: str) -> ObjectObservation:
        world = self._world
        X_WO = world.pose(name)
        x, y, z = (float(v) for v in X_WO.translation())
        spec = world.domain.objects[name]
        tools = [
            t
            for t in world.scenario.objects
            if world.domain.objects[t].kind == "tool" and t != name and not self._fallen(t)
        ]
        holder = next((hand for hand in HANDS if self.held(hand) == name), None)
        hands = [hand for hand in HANDS if holder or self.can_take(hand, name)]
        by_tool = [tool for tool in tools if hands or self._tool_reaches(tool, x, y)]
        return ObjectObservation(
            name=name,
            kind=spec.kind,
            position=(x, y, z),
            below=() if holder else self.supports(name),
            reachable_with=(*hands, *by_tool),
            pullable_with=() if hands else tuple(t for t in by_tool if self._hooks(t, name)),
            yaw=float(X_WO.rotation().ToRollPitchYaw().yaw_angle()),
        )
