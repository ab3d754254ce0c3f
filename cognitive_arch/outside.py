"""What happens to the world without the robot's doing: a thing is taken, moved, added, toppled, or slips.

An event is written `STEP:KIND:NAME[:X,Y]` on the command line and in scene files, and happens before the
robot decides on its action number STEP.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from cognitive_arch.errors import ConfigError, one_line, unknown
from cognitive_arch.world.observation import HANDS

Place = tuple[float, float]

TABLE_X, TABLE_Y = (-0.82, -0.18), (-0.42, 0.42)  # m; the table's top but for a rim of 3 cm
MAX_STEP = 999
FORM = "STEP:KIND:NAME or STEP:KIND:NAME:X,Y, as in 3:remove:Tomato or 2:move:Ham:-0.35,0.10"


class Happening(StrEnum):
    """The kinds of outside events."""

    REMOVE = "remove"  # the object is taken away
    MOVE = "move"  # the object is taken and put on the table elsewhere
    ADD = "add"  # an object that was not there is put on the table
    TOPPLE = "topple"  # the object, and what is on top of it, falls off what it lies on
    EMPTY = "empty"  # what the hand holds slips from it


PLACED = (Happening.MOVE, Happening.ADD)


@dataclass(frozen=True, slots=True)
class OutsideEvent:
    """One thing that happens before action number `step`; `position` is a place on the table, metres."""

    step: int
    kind: Happening
    name: str
    position: Place | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.step <= MAX_STEP:
            raise ConfigError(f"{self._named()}: step {self.step} is out of range; valid: 1 to {MAX_STEP}")
        if self.kind in PLACED and self.position is None:
            raise ConfigError(f"{self._named()}: {self.kind} needs a place; valid: {FORM}")
        if self.kind not in PLACED and self.position is not None:
            raise ConfigError(f"{self._named()}: {self.kind} takes no place; valid: {FORM}")
        if self.position is not None and not on_table(self.position):
            raise ConfigError(
                f"{self._named()}: that place is not on the table; valid: x from {TABLE_X[0]:g} to "
                f"{TABLE_X[1]:g}, y from {TABLE_Y[0]:g} to {TABLE_Y[1]:g} (metres)"
            )

    def __str__(self) -> str:
        where = "" if self.position is None else f":{self.position[0]!r},{self.position[1]!r}"
        return f"{self.step}:{self.kind}:{self.name}{where}"

    def _named(self) -> str:
        return f"event '{one_line(self)}'"

    @classmethod
    def parse(cls, text: str) -> OutsideEvent:
        """Read `STEP:KIND:NAME[:X,Y]`, the inverse of `str`; raises `ConfigError`."""
        quoted = f"event '{one_line(text)}'"
        parts = [part.strip() for part in text.split(":")]
        if not 3 <= len(parts) <= 4 or not all(parts):
            raise ConfigError(f"{quoted} cannot be read; valid: {FORM}")
        step, kind, name, *place = parts
        if not re.fullmatch(r"-?[0-9]{1,6}", step, re.ASCII):
            raise ConfigError(f"{quoted}: '{one_line(step)}' is not a step; valid: 1 to {MAX_STEP}")
        if kind not in set(Happening):
            raise ConfigError(f"{quoted}: {unknown('kind of event', kind, Happening)}")
        return cls(int(step), Happening(kind), name, _place(place[0], quoted) if place else None)


def _place(text: str, quoted: str) -> Place:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            f"{quoted}: '{one_line(text)}' is not a place; valid: X,Y in metres, as in -0.35,0.10"
        ) from None
    return x, y


def on_table(place: Place) -> bool:
    """Whether something can be put down there (a NaN is nowhere)."""
    return TABLE_X[0] <= place[0] <= TABLE_X[1] and TABLE_Y[0] <= place[1] <= TABLE_Y[1]


def in_order(events: Iterable[OutsideEvent]) -> tuple[OutsideEvent, ...]:
    """The events as they happen: by step, those of one step as they were given."""
    return tuple(sorted(events, key=lambda event: event.step))


def check_events(events: Iterable[OutsideEvent], there: Collection[str], known: Collection[str]) -> None:
    """Raise `ConfigError` for an event that cannot happen: only what is there can be taken or moved.

    `there` are the objects of the scene, `known` all that the domain has.
    """
    present = set(there)
    for event in in_order(events):
        quoted, name = f"event '{one_line(event)}'", event.name
        if event.kind is Happening.EMPTY:
            if name not in HANDS:
                raise ConfigError(f"{quoted}: {unknown('hand', name, HANDS)}")
        elif event.kind is Happening.ADD:
            if name in present:
                absent = ", ".join(sorted(set(known) - present)) or "none"
                raise ConfigError(f"{quoted}: {name} is there already by then; valid: {absent}")
            if name not in known:
                raise ConfigError(f"{quoted}: {unknown('object', name, set(known) - present)}")
            present.add(name)
        elif name not in present:
            raise ConfigError(f"{quoted}: {unknown('object by then', name, present)}")
        elif event.kind is Happening.REMOVE:
            present.remove(name)


class Schedule:
    """The events that have not happened yet."""

    def __init__(self, events: Iterable[OutsideEvent] = ()) -> None:
        self._pending = list(in_order(events))

    def due(self, step: int, kinds: Collection[Happening]) -> tuple[OutsideEvent, ...]:
        """Take out the events of these kinds that happen before action number `step`."""
        due = tuple(event for event in self._pending if event.step <= step and event.kind in kinds)
        self._pending = [event for event in self._pending if event not in due]
        return due

    @property
    def pending(self) -> tuple[OutsideEvent, ...]:
        """What is still to come."""
        return tuple(self._pending)


_NOTHING = {Happening.TOPPLE: "lay on nothing to fall from", Happening.ADD: "was there already"}


def told(event: OutsideEvent, changed: Sequence[str]) -> str:
    """The event for the log; `changed` are the objects it changed, none if it came to nothing."""
    things = " and ".join(changed)
    if event.kind is Happening.EMPTY:
        return f"{things} slipped from {event.name}" if changed else f"{event.name} held nothing to lose"
    if not changed:
        return f"{event.name} {_NOTHING.get(event.kind, 'was not there')}"
    if event.kind is Happening.TOPPLE:
        return f"{things} fell to the table"
    if event.kind is Happening.REMOVE:
        return f"{event.name} was taken away"
    assert event.position is not None
    x, y = event.position
    what = "moved to" if event.kind is Happening.MOVE else "put on the table at"
    return f"{event.name} was {what} ({x:.3f}, {y:.3f})"
