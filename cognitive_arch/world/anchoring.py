"""Anchoring: from one observation after another to entities that last (thesis Sec. 6.4.4).

An entity keeps its id. An object that is out of sight is remembered as it was last seen; it is forgotten
when its place is seen to be empty, or when a new instruction starts while it is neither seen nor held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from cognitive_arch.world.observation import ObjectObservation, Observation
from cognitive_arch.world.state import HandEntity, ObjectEntity, WorldState

FIRST_ID = 11


class WorldModel:
    """The robot's short-term memory of its surroundings."""

    def __init__(self) -> None:
        self._ids: dict[str, int] = {}
        self._state: WorldState | None = None

    @property
    def state(self) -> WorldState:
        """The latest world state; raises `RuntimeError` before the first update."""
        if self._state is None:
            raise RuntimeError("the world has not been observed yet")
        return self._state

    def begin_instruction(self) -> None:
        """Start afresh for a new instruction, keeping what is in view and what is in the hands."""
        if self._state is not None:
            kept = tuple(obj for obj in self._state.objects if obj.visible or obj.in_hand)
            self._state = replace(self._state, objects=kept, _cache={})

    def update(self, observation: Observation) -> WorldState:
        """Fold one observation in; returns the new state, one version further."""
        for name in [h.name for h in observation.hands] + [o.name for o in observation.objects]:
            self._ids.setdefault(name, FIRST_ID + len(self._ids))
        holder = {hand.holding: hand.name for hand in observation.hands if hand.holding}
        seen = {seen.name: self._anchor(seen, holder) for seen in observation.objects}
        for old in self._state.objects if self._state else ():
            if old.name not in seen and old.name not in observation.absent:
                seen[old.name] = _remember(old, holder)
        objects = sorted(seen.values(), key=lambda obj: obj.id)
        hands = [HandEntity(self._ids[h.name], h.name, h.holding is None) for h in observation.hands]
        self._state = WorldState(
            version=self._state.version + 1 if self._state else 0,
            time=observation.time,
            hands=tuple(sorted(hands, key=lambda hand: hand.id)),
            objects=tuple(_with_stack(obj, seen) for obj in objects),
            properties=tuple(sorted(observation.properties)),
        )
        return self._state

    def to_json(self) -> dict[str, Any]:
        """Plain data; `from_json` reads it back."""
        return {"ids": self._ids, "state": self._state.to_json() if self._state else None}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> WorldModel:
        """The inverse of `to_json`."""
        model = cls()
        model._ids = {str(name): int(n) for name, n in data["ids"].items()}
        model._state = WorldState.from_json(data["state"]) if data["state"] else None
        return model

    def _anchor(self, seen: ObjectObservation, holder: Mapping[str, str]) -> ObjectEntity:
        return ObjectEntity(
            id=self._ids[seen.name],
            name=seen.name,
            kind=seen.kind,
            position=seen.position,
            in_hand=holder.get(seen.name),
            on_top_of=seen.below,
            reachable_with=tuple(sorted(seen.reachable_with)),
            pullable_with=tuple(sorted(seen.pullable_with)),
            visible=seen.visible,
            desc=seen.desc,
            tooldesc=seen.tooldesc,
        )


def _remember(old: ObjectEntity, holder: Mapping[str, str]) -> ObjectEntity:
    hand = holder.get(old.name)
    return replace(old, visible=False, in_hand=hand, on_top_of=() if hand else old.on_top_of)


def _with_stack(obj: ObjectEntity, known: Mapping[str, ObjectEntity]) -> ObjectEntity:
    """`on_top_of` completed downward: what the supports rest on is below, too."""
    below: list[str] = []
    queue = list(obj.on_top_of)
    while queue:
        name = queue.pop(0)
        if name in known and name not in below and name != obj.name and not known[name].in_hand:
            below.append(name)
            queue.extend(known[name].on_top_of)
    return replace(obj, on_top_of=tuple(below))
