"""The world state: entities and their symbols (thesis Sec. 6.4.4, Tables 13-15), ordered and frozen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from cognitive_arch.relational.rules import Entity
from cognitive_arch.relational.symbols import Atom, State, parse_literal
from cognitive_arch.world.observation import HANDS


@dataclass(frozen=True, slots=True)
class HandEntity:
    """A hand: Tables 13 and 15. `id` counts from 11, as published."""

    id: int
    name: str
    is_clear: bool


@dataclass(frozen=True, slots=True)
class ObjectEntity:
    """An object: Tables 13 and 14.

    `position` in metres, root frame; `on_top_of` lists what is below it, nearest first; the lists name
    entities. `desc` and `tooldesc` are shape descriptors of the whole and of its two halves, empty until
    something has seen them. `visible` is false for what is only remembered.
    """

    id: int
    name: str
    kind: str
    position: tuple[float, float, float]
    in_hand: str | None = None
    on_top_of: tuple[str, ...] = ()
    reachable_with: tuple[str, ...] = ()
    pullable_with: tuple[str, ...] = ()
    desc: tuple[float, ...] = ()
    tooldesc: tuple[float, ...] = ()
    visible: bool = True


@dataclass(frozen=True, slots=True)
class WorldState:
    """Everything the robot believes about the scene at one moment; entities are sorted by id."""

    version: int
    time: float
    hands: tuple[HandEntity, ...]
    objects: tuple[ObjectEntity, ...]
    properties: tuple[str, ...] = ()
    _cache: dict[str, State] = field(default_factory=dict, repr=False, compare=False)

    @property
    def entities(self) -> tuple[Entity, ...]:
        """The entities with the types the rules know."""
        hands = tuple(Entity(hand.name, "hand") for hand in self.hands)
        return hands + tuple(Entity(obj.name, obj.kind) for obj in self.objects)

    @property
    def held(self) -> dict[str, str]:
        """Object -> hand, for everything in a hand."""
        return {obj.name: obj.in_hand for obj in self.objects if obj.in_hand}

    def object(self, name: str) -> ObjectEntity | None:
        """The object called `name`, if it is known."""
        return next((obj for obj in self.objects if obj.name == name), None)

    def atoms(self) -> State:
        """The ground atoms that are true.

        `on` is transitive downward. A place some hand can reach counts as reachable with every other
        object too, since a hand could bring it there (`ALL` in the rule for pull speaks of them). What a
        hand holds is reachable with that hand only: nothing can be put on it, no tool can act on it.
        """
        if "atoms" not in self._cache:
            self._cache["atoms"] = frozenset(self._atoms())
        return self._cache["atoms"]

    def _atoms(self) -> list[Atom]:
        atoms = [parse_literal(text).atom for text in self.properties]
        for hand in self.hands:
            atoms.append(Atom("isHand", (hand.name,)))
            if hand.is_clear:
                atoms.append(Atom("isClear", (hand.name,)))
        names = [obj.name for obj in self.objects]
        for obj in self.objects:
            if obj.in_hand:
                atoms.append(Atom("inHand", (obj.name, obj.in_hand)))
            atoms.extend(Atom("on", (obj.name, below)) for below in obj.on_top_of)
            reach = {obj.in_hand} if obj.in_hand else set(obj.reachable_with)
            if not obj.in_hand and reach & set(HANDS):
                reach.update(names)
            atoms.extend(Atom("reachableWith", (obj.name, entity)) for entity in reach - {obj.name})
            atoms.extend(Atom("pullableWith", (obj.name, tool)) for tool in obj.pullable_with)
        return atoms

    def to_json(self) -> dict[str, Any]:
        """Plain data for the store; `from_json` reads it back."""
        return {
            "version": self.version,
            "time": self.time,
            "hands": [asdict(hand) for hand in self.hands],
            "objects": [asdict(obj) for obj in self.objects],
            "properties": list(self.properties),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> WorldState:
        """The inverse of `to_json`."""

        def tuples(row: Mapping[str, Any]) -> dict[str, Any]:
            return {k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}

        return cls(
            version=data["version"],
            time=data["time"],
            hands=tuple(HandEntity(**row) for row in data["hands"]),
            objects=tuple(ObjectEntity(**tuples(row)) for row in data["objects"]),
            properties=tuple(data["properties"]),
        )


def sorted_atoms(state: State) -> list[str]:
    """The atoms of `state` as text, sorted: the form in which logs and JSON show a state."""
    return sorted(map(str, state))


@dataclass(frozen=True, slots=True)
class StateChange:
    """What became true and what ceased to be, as sorted text."""

    added: tuple[str, ...]
    removed: tuple[str, ...]

    @classmethod
    def between(cls, before: State, after: State) -> StateChange:
        return cls(tuple(sorted_atoms(after - before)), tuple(sorted_atoms(before - after)))

    def __bool__(self) -> bool:
        return bool(self.added or self.removed)
