"""What an instruction can ask for: frozen commands that name things of the domain, not words."""

from __future__ import annotations

from dataclasses import dataclass

LEFT, RIGHT = "LeftHand", "RightHand"


@dataclass(frozen=True)
class Make:
    """Assemble a recipe. No `fillings` means the recipe's default; `without` is removed from either."""

    recipe: str
    fillings: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    hand: str | None = None


@dataclass(frozen=True)
class Grasp:
    """Take hold of a thing; `hand` is an entity (`LeftHand`) or None for whichever suits."""

    obj: str
    hand: str | None = None


@dataclass(frozen=True)
class Put:
    """Put a thing on another; `obj` None is "it" with nothing said before: what the hand holds."""

    obj: str | None
    target: str
    hand: str | None = None


@dataclass(frozen=True)
class Drop:
    """Let go of a thing, or of whatever the hand holds; `take` is to take it first if it is not held."""

    obj: str | None = None
    hand: str | None = None
    take: bool = False


@dataclass(frozen=True)
class Pull:
    """Bring a thing closer with a tool; `tool` None leaves the choice to semantic memory."""

    obj: str
    tool: str | None = None
    hand: str | None = None


@dataclass(frozen=True)
class Push:
    """Move a thing away with a tool; `tool` None leaves the choice to semantic memory."""

    obj: str
    tool: str | None = None
    hand: str | None = None


@dataclass(frozen=True)
class Semantic:
    """Semantic instructions given as such: (subject, verb, object) triples."""

    triples: tuple[tuple[str, str, str], ...]


Command = Make | Grasp | Put | Drop | Pull | Push | Semantic


@dataclass(frozen=True)
class Instruction:
    """A sentence and the commands it was understood as, in the order they are to be done."""

    sentence: str
    commands: tuple[Command, ...]
