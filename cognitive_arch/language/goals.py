"""The goal compiler: semantic instructions -> sub-goals (thesis Sec. 6.4.5.2).

Each semantic instruction is matched by its verb against the lifted rules ("grasp" and `graspWith` share
the word); the most likely outcome of that rule, over the named entities, is applied to the previous
sub-goal. Effects accumulate; a literal that a later effect contradicts leaves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cognitive_arch.errors import InstructionError, unknown
from cognitive_arch.language.semantic_memory import SemanticInstruction
from cognitive_arch.relational.rules import Entity, GroundRule, NIDRule, RuleSet
from cognitive_arch.relational.symbols import Goal, Literal
from cognitive_arch.world.observation import HANDS

REACH = "reach"
PLACES = frozenset({"on", "inHand", "reachableWith"})


class GoalCompiler:
    """Compiles for one rule set."""

    def __init__(self, rules: RuleSet) -> None:
        self._rules = rules

    def compile(
        self,
        instructions: Sequence[SemanticInstruction],
        entities: Sequence[Entity],
        held: Mapping[str, str] | None = None,
        hands: Sequence[str] = HANDS,
    ) -> tuple[Goal, ...]:
        """One sub-goal per instruction that matches a rule; "X reach Y" names the place of the next one.

        `held` maps an object to the hand it is in when the instruction is given; `hands` are in order of
        preference where the instruction leaves the choice. Raises `InstructionError` for a verb that no
        rule shares, or entities that are not there.
        """
        in_hand = dict(held or {})
        goals: list[Goal] = []
        current: Goal = ()
        reaching: SemanticInstruction | None = None
        for instruction in instructions:
            if instruction.verb == REACH:
                reaching = instruction
                continue
            rule = self._match(instruction)
            hand = self._hand(rule, instruction, in_hand, hands)
            ground = self._ground(rule, instruction, reaching, hand, entities)
            effect = ground.outcomes[0].literals
            # What was held before may be put down on the way; what this instruction takes may not.
            taken = {obj: where for obj, where in in_hand.items() if obj not in (held or {})}
            _check_hands(instruction, effect, taken)
            current = _accumulate(current, effect)
            goals.append(current)
            _track(effect, in_hand)
            reaching = None
        if not goals:
            raise InstructionError("the instruction asks for nothing that any rule could do")
        return tuple(goals)

    def alternatives(
        self,
        instructions: Sequence[SemanticInstruction],
        entities: Sequence[Entity],
        held: Mapping[str, str] | None = None,
    ) -> tuple[tuple[Goal, ...], ...]:
        """The same instruction with the other hand first, where it ends with something in a hand that
        nobody named: "pick up the ham" is met by either hand, though the first choice is the left one."""
        first = self.compile(instructions, entities, held)
        if not any(lit.positive and lit.atom.predicate == "inHand" for lit in first[-1]):
            return ()
        other = self.compile(instructions, entities, held, tuple(reversed(HANDS)))
        return () if other == first else (other,)

    def actions(self, instructions: Sequence[SemanticInstruction]) -> tuple[str, ...]:
        """Names of the actions whose effects the sub-goals are made of, sorted."""
        asked = [i for i in instructions if i.verb != REACH]
        return tuple(sorted({self._match(instruction).action for instruction in asked}))

    def _match(self, instruction: SemanticInstruction) -> NIDRule:
        verb = instruction.verb.lower()
        for rule in self._rules.rules:
            if rule.action.lower().startswith(verb):
                return rule
        raise InstructionError(unknown("verb", instruction.verb, {r.action for r in self._rules.rules}))

    def _hand(
        self,
        rule: NIDRule,
        instruction: SemanticInstruction,
        in_hand: Mapping[str, str],
        hands: Sequence[str],
    ) -> str:
        """The hand that acts: the named one, the one that holds the object, else the first free one.

        "hand" means LeftHand (as published) unless the instructions before have filled it.
        """
        if instruction.subject in hands:
            return instruction.subject
        if instruction.object in in_hand:
            return in_hand[instruction.object]
        if rule.action.startswith(("pull", "push")) and in_hand:
            return list(in_hand.values())[-1]
        free = [hand for hand in hands if hand not in in_hand.values()]
        return (free or list(hands))[0]

    def _ground(
        self,
        rule: NIDRule,
        instruction: SemanticInstruction,
        reaching: SemanticInstruction | None,
        hand: str,
        entities: Sequence[Entity],
    ) -> GroundRule:
        """Bind the rule's parameters: the object first, the hand by type, the rest from "X reach Y"."""
        other = None
        if reaching is not None:
            other = reaching.object if reaching.subject == instruction.object else reaching.subject
        args: list[str] = []
        for index, parameter in enumerate(rule.parameters):
            if index == 0:
                args.append(instruction.object)
            elif parameter.type == "hand":
                args.append(hand)
            elif other is not None:
                args.append(other)
            else:
                raise InstructionError(
                    f"'{instruction}' does not say {parameter.name}: it needs "
                    f"'{instruction.object} reach ...' (or '... reach {instruction.object}') before it"
                )
        names = {e.name for e in entities}
        for arg in args:
            if arg not in names:
                raise InstructionError(unknown("object", arg, names))
        if len(set(args)) < len(args):
            raise InstructionError(f"'{instruction}' needs different things, not {args[0]} twice")
        ground = self._rules.ground_call(rule, args, entities)
        if ground is None:
            raise InstructionError(f"'{instruction}' cannot be done: its preconditions contradict each other")
        return ground


def _accumulate(previous: Goal, effect: Goal) -> Goal:
    """The previous sub-goal after the effect: what the effect contradicts or repeats leaves.

    A thing is in one place: once it is taken, or put elsewhere, where it was is no longer asked for
    ("put the ham on the bun, then take the ham" must not demand both).
    """
    new = {literal.atom for literal in effect}
    moved = {lit.atom.args[0] for lit in effect if lit.positive and lit.atom.predicate in ("on", "inHand")}

    def stays(literal: Literal) -> bool:
        place = literal.positive and literal.atom.predicate in PLACES
        return literal.atom not in new and not (place and literal.atom.args[0] in moved)

    return tuple(filter(stays, previous)) + effect


def _check_hands(instruction: SemanticInstruction, effect: Goal, in_hand: Mapping[str, str]) -> None:
    """A hand holds one thing: refuse what would ask for two at once."""
    for literal in effect:
        if literal.positive and literal.atom.predicate == "inHand":
            obj, hand = literal.atom.args
            holding = [held for held, where in in_hand.items() if where == hand and held != obj]
            if holding:
                full = ", ".join(f"{held} in {where}" for held, where in sorted(in_hand.items()))
                raise InstructionError(f"'{instruction}' needs a free hand, but by then there is {full}")


def _track(effect: Goal, in_hand: dict[str, str]) -> None:
    for literal in effect:
        if literal.atom.predicate == "inHand":
            obj, hand = literal.atom.args
            if literal.positive:
                in_hand[obj] = hand
            else:
                in_hand.pop(obj, None)
