"""Semantic memory: what a command takes, as semantic instructions (thesis Sec. 6.4.1, PRAXICON's part).

"make a ham sandwich" becomes "hand grasp Ham, Ham reach Bun-bottom, hand put Ham, ..." from what the
domain knows of the recipe and of the objects that are there. Where things lie, what is within reach and
what may fail is not its business.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

from cognitive_arch.domain import Domain, Recipe
from cognitive_arch.errors import InstructionError, unknown
from cognitive_arch.language.commands import (
    Command,
    Drop,
    Grasp,
    Instruction,
    Make,
    Pull,
    Push,
    Put,
    Semantic,
)

HAND = "hand"
VERBS = ("grasp", "reach", "put", "drop", "pull", "push")


class SemanticInstruction(NamedTuple):
    """One step in the language of semantic memory, e.g. `hand grasp Ham`."""

    subject: str
    verb: str
    object: str

    def __str__(self) -> str:
        return f"{self.subject} {self.verb} {self.object}"


class SemanticMemory:
    """Knows the recipes and tools of one domain."""

    def __init__(self, domain: Domain) -> None:
        self._domain = domain

    def expand(
        self,
        instruction: Instruction,
        scene_objects: Sequence[str],
        held: Mapping[str, str] = MappingProxyType({}),
    ) -> tuple[SemanticInstruction, ...]:
        """Semantic instructions for `instruction` among `scene_objects`.

        `held` maps an object to the hand it is in when the instruction is given. Raises
        `InstructionError` if a needed thing or tool is not there.
        """
        run = _Expansion(self._domain, tuple(scene_objects), held)
        for command in instruction.commands:
            run.add(command)
        if not run.steps:
            raise InstructionError(f"there is nothing to do for that; {run.offer()}")
        return tuple(run.steps)


class _Expansion:
    """The steps so far, and which hand holds what after them."""

    def __init__(self, domain: Domain, scene: tuple[str, ...], held: Mapping[str, str]) -> None:
        self._domain = domain
        self._scene = scene
        self._held = {name: held[name] for name in sorted(held)}
        self._taken: dict[
            str, str
        ] = {}  # by a step of this instruction; what was held before may be put down
        self._placed: set[str] = set()
        self.steps: list[SemanticInstruction] = []

    def offer(self) -> str:
        return f"this scene has {', '.join(sorted(self._scene)) or 'nothing'}"

    def add(self, command: Command) -> None:
        """Append the steps of one command."""
        match command:
            case Make():
                self._make(command)
            case Grasp():
                self._grasp(command.obj, command.hand)
            case Put():
                self._put(self._of_held(command.obj, command.hand, "put"), command.target, command.hand)
            case Drop():
                self._drop(command)
            case Pull() | Push():
                self._move(command)
            case Semantic():
                self._as_given(command)

    def _step(self, subject: str, verb: str, obj: str) -> None:
        self.steps.append(SemanticInstruction(subject, verb, obj))

    def _need(self, *names: str) -> None:
        missing = [n for n in names if n not in self._scene]
        if missing:
            raise InstructionError(f"there is no {' and no '.join(missing)} in this scene; {self.offer()}")

    def _of_held(self, obj: str | None, hand: str | None, action: str) -> str:
        """`obj`, or if it was not named what the hand (any, if None) took last."""
        names = [n for n, holder in self._held.items() if hand in (None, holder)]
        if obj is None and not names:
            raise InstructionError(f"nothing is held to {action}; say what to {action}: {self.offer()}")
        return obj if obj is not None else names[-1]

    def _grasp(self, obj: str, hand: str | None) -> str:
        """Have `obj` in a hand; returns the hand as later steps name it."""
        self._need(obj)
        holder = self._held.get(obj)
        if holder is not None:
            if hand is not None and holder not in (hand, HAND):
                raise InstructionError(f"{obj} is in {holder} already, not in {hand}")
            return hand or holder
        self._take(obj, hand or HAND)
        return hand or HAND

    def _take(self, obj: str, hand: str) -> None:
        same = [n for n, holder in self._taken.items() if hand != HAND and holder == hand and n != obj]
        if same:
            raise InstructionError(
                f"I have two hands, one thing in each: {hand} holds {same[0]} and cannot take {obj} too"
            )
        full = [n for n in self._taken if n != obj]
        if len(full) > 1:
            raise InstructionError(
                f"I have two hands, one thing in each: they hold {' and '.join(full)}, not {obj} too"
            )
        self._step(hand, "grasp", obj)
        self._held[obj] = self._taken[obj] = hand

    def _release(self, obj: str) -> None:
        self._held.pop(obj, None)
        self._taken.pop(obj, None)

    def _put(self, obj: str, target: str, hand: str | None) -> None:
        self._need(obj, target)
        subject = self._grasp(obj, hand)
        self._step(obj, "reach", target)
        self._step(subject, "put", obj)
        self._release(obj)
        self._placed.add(obj)

    def _drop(self, command: Drop) -> None:
        obj = self._of_held(command.obj, command.hand, "drop")
        self._need(obj)
        if obj not in self._held and (command.take or obj in self._placed):
            self._grasp(obj, command.hand)
        self._step(command.hand or self._held.get(obj, HAND), "drop", obj)
        self._release(obj)
        self._placed.discard(obj)

    def _move(self, command: Pull | Push) -> None:
        action = "pull" if isinstance(command, Pull) else "push"
        self._need(command.obj)
        tool = command.tool or self._choose_tool(action, command.obj)
        if tool == command.obj:
            raise InstructionError(f"I cannot {action} {tool} with itself")
        specs = self._domain.objects
        if action == "pull" and not specs[tool].may_pull:
            able = [n for n in specs if n in self._scene and specs[n].may_pull and n != command.obj]
            other = f"the {able[0]} can" if able else "nothing here can"
            raise InstructionError(f"the {tool} cannot pull; {other}")
        subject = self._grasp(tool, command.hand)
        self._step(tool, "reach", command.obj)
        self._step(subject, action, command.obj)

    def _choose_tool(self, action: str, obj: str) -> str:
        """One already in a hand, else one that can pull, else (to push) any; in the order of the domain."""
        specs = self._domain.objects
        tools = [n for n, s in specs.items() if s.kind == "tool" and n in self._scene and n != obj]
        if action == "pull":
            tools = [n for n in tools if specs[n].may_pull]
        if not tools:
            raise InstructionError(f"there is no tool in this scene to {action} {obj} with; {self.offer()}")
        return min(tools, key=lambda n: (n not in self._held, not specs[n].can_pull))

    def _make(self, command: Make) -> None:
        if command.recipe not in self._domain.recipes:
            raise InstructionError(unknown("recipe", command.recipe, self._domain.recipes))
        recipe = self._domain.recipes[command.recipe]
        layers = self._layers(command, recipe)
        self._need(*layers)
        for below, layer in pairwise(layers):
            self._put(layer, below, command.hand)

    def _layers(self, command: Make, recipe: Recipe) -> list[str]:
        """From the bottom up. What is named must be there; a default only as far as it is."""
        left_out = [n for n in recipe.base if n in command.without]
        if left_out:
            raise InstructionError(f"a {command.recipe} needs {left_out[0]}, it cannot go without")
        fillings = command.fillings or self._default(recipe)
        kept = [n for n in fillings if n not in command.without]
        if not kept and not command.without:
            raise InstructionError(
                f"nothing of what goes into a {command.recipe} is here "
                f"({', '.join(recipe.default)}); {self.offer()}"
            )
        lid = [n for n in recipe.lid if n not in command.without]
        return [*recipe.base, *kept, *lid]

    def _default(self, recipe: Recipe) -> tuple[str, ...]:
        return tuple(n for n in recipe.default if n in self._scene)

    def _as_given(self, command: Semantic) -> None:
        for subject, verb, obj in command.triples:
            if verb not in VERBS:
                raise InstructionError(unknown("verb", verb, VERBS))
            self._need(obj)
            if verb == "grasp":
                self._take(obj, subject)
                continue
            self._step(subject, verb, obj)
            if verb in ("put", "drop"):
                self._release(obj)
