"""Action grounding (thesis Sec. 6.4.5.3): the rules over what is there, and where their numbers come from.

Three ways: the domain's rules with their own numbers; the same, with what tools are good for left open; and
numbers that follow from the shapes of tool and object, by what was learned.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from cognitive_arch.relational.rules import Entity, GroundRule, GroundRules, RuleSet, derived_of
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.resources import learned_affordances
from cognitive_arch.world.observation import HANDS, ObjectObservation, Observation
from cognitive_arch.world.state import ObjectEntity, WorldState

if TYPE_CHECKING:  # with what it needs it takes a while to load, and not everyone asks it
    from cognitive_arch.affordances.judgement import Judge, Question

LEARNED_ACTIONS = ("pull", "push")
"""Actions with a tool whose effects are learned; others keep the numbers of their rules."""
PULLS = 0.5
"""A tool is taken to pull what it brings closer more likely than not."""
KEPT = 8
"""So many groundings are kept: the world comes back to where it was, or stays there."""


@dataclass(frozen=True)
class Grounded:
    """Ground rules, and for actions whose number is not the rule's own what it was told from."""

    rules: Sequence[GroundRule]
    sources: Mapping[GroundAction, str] = field(default_factory=dict)


class Grounding(Protocol):
    """What the planning cycle asks for the rules of a world.

    Law: it answers by what it is given alone, so that a run that is gone on with is told the same.
    """

    def perceive(self, observation: Observation) -> Observation:
        """The observation with what tools are good for as the robot believes it."""
        ...

    def ground(self, world: WorldState) -> Grounded:
        """The rules over what is there."""
        ...


class RuleGrounding:
    """The rules with their own numbers; what tools are good for is told by the environment."""

    def __init__(self, rules: RuleSet, skills: frozenset[str]) -> None:
        self._rules, self._skills = rules, skills
        self._kept: dict[tuple[Entity, ...], Grounded] = {}

    def perceive(self, observation: Observation) -> Observation:
        """See `Grounding.perceive`: as it is."""
        return observation

    def ground(self, world: WorldState) -> Grounded:
        """See `Grounding.ground`; grounding again only when what is there changed."""
        if world.entities not in self._kept:
            self._kept = {world.entities: Grounded(self._rules.ground(world.entities, self._skills))}
        return self._kept[world.entities]


class UntoldGrounding(RuleGrounding):
    """The same for a robot that knows nothing of tools: any of them may pull, at the rule's own number."""

    def perceive(self, observation: Observation) -> Observation:
        """See `Grounding.perceive`."""
        return _with_pullers(observation, lambda obj, tools: tools)


class AffordanceGrounding(RuleGrounding):
    """Numbers of `LEARNED_ACTIONS` follow from the shapes of tool and object, as far as both were seen."""

    def __init__(self, rules: RuleSet, skills: frozenset[str], judge: Judge) -> None:
        super().__init__(rules, skills)
        self._judge = judge
        self._numbered: dict[tuple[object, ...], Grounded] = {}

    def perceive(self, observation: Observation) -> Observation:
        """See `Grounding.perceive`: what comes closer at least as likely as `PULLS` can be pulled."""
        halves = {o.name: o.tooldesc for o in observation.objects if o.tooldesc}

        def pullers(obj: ObjectObservation, tools: tuple[str, ...]) -> tuple[str, ...]:
            if not obj.desc:
                return tuple(tool for tool in tools if tool in obj.pullable_with)
            asked = {
                tool: self._judge.question("pull", halves[tool], obj.desc, obj.position[:2])
                for tool in tools
                if tool in halves
            }
            chances = self._judge.chances(list(asked.values()))
            return tuple(
                tool
                for tool in tools
                if (chances[asked[tool]] >= PULLS if tool in asked else tool in obj.pullable_with)
            )

        return _with_pullers(observation, pullers)

    def ground(self, world: WorldState) -> Grounded:
        """See `Grounding.ground`."""
        base = super().ground(world).rules
        asked = self._questions(base, world)
        chances = self._judge.chances(list(asked.values()))
        key = (world.entities, *(chances[question] for question in asked.values()))
        if key not in self._numbered:
            if len(self._numbered) >= KEPT:
                self._numbered.clear()
            rules = (_numbered(rule, asked, chances) for rule in base)
            self._numbered[key] = Grounded(GroundRules(rules, derived_of(base)))
        sources = {action: self._judge.explained(question) for action, question in asked.items()}
        return replace(self._numbered[key], sources=sources)

    def _questions(self, rules: Sequence[GroundRule], world: WorldState) -> dict[GroundAction, Question]:
        """What there is to ask, by action: `action(object, tool, hand)` of what has been seen."""
        seen = {obj.name: obj for obj in world.objects if obj.desc}
        found: dict[GroundAction, Question] = {}
        for action in dict.fromkeys(rule.action for rule in rules):
            pair = _object_and_tool(action, seen)
            if pair is not None:
                obj, tool = pair
                found[action] = self._judge.question(action.name, tool.tooldesc, obj.desc, obj.position[:2])
        return found


def _object_and_tool(
    action: GroundAction, seen: Mapping[str, ObjectEntity]
) -> tuple[ObjectEntity, ObjectEntity] | None:
    """What a learned action is done to and with; None for any other. Tools were never acted on."""
    if action.name not in LEARNED_ACTIONS or len(action.args) < 2:
        return None
    obj, tool = (seen.get(name) for name in action.args[:2])
    if obj is None or tool is None or obj.kind == "tool" or tool.kind != "tool" or not tool.tooldesc:
        return None
    return obj, tool


def _numbered(
    rule: GroundRule, asked: Mapping[GroundAction, Question], chances: Mapping[Question, float]
) -> GroundRule:
    """The rule with the learned number of its first outcome; what is left goes to noise."""
    if rule.action not in asked or not rule.outcomes:
        return rule
    others = sum(outcome.probability for outcome in rule.outcomes[1:])
    return rule.with_first_probability(min(chances[asked[rule.action]], 1.0 - others))


def make_grounding(source: str, rules: RuleSet, skills: frozenset[str]) -> Grounding:
    """The grounding for one of `backends.AFFORDANCES`, or for a file with a model. Raises
    `AffordanceError` for a file that is none."""
    judge = judge_of(source)
    if judge is not None:
        return AffordanceGrounding(rules, skills, judge)
    return UntoldGrounding(rules, skills) if source == "none" else RuleGrounding(rules, skills)


def judge_of(source: str) -> Judge | None:
    """What was learned, if `source` says to use it. Raises `AffordanceError`."""
    if source in ("default", "none"):
        return None
    path = learned_affordances() if source == "learned" else Path(source)
    try:
        changed = path.stat().st_mtime_ns
    except OSError:
        changed = 0  # to read it tells what is wrong
    return _judge(path, changed)


@lru_cache(maxsize=4)
def _judge(path: Path, changed: int) -> Judge:
    """The model in a file as it was when it was last `changed`."""
    from cognitive_arch.affordances.judgement import Judge

    return Judge.load(path)


def _with_pullers(
    observation: Observation, choose: Callable[[ObjectObservation, tuple[str, ...]], tuple[str, ...]]
) -> Observation:
    """The observation with other tools that can pull; `choose` picks them among those that get there.

    What a hand can take, and what a hand holds, is not to be pulled.
    """
    kinds = {obj.name: obj.kind for obj in observation.objects}
    held = {hand.holding for hand in observation.hands}
    objects = []
    for obj in observation.objects:
        tools = tuple(name for name in obj.reachable_with if kinds.get(name) == "tool")
        free = obj.name not in held and obj.kind != "tool" and not set(obj.reachable_with) & set(HANDS)
        objects.append(replace(obj, pullable_with=choose(obj, tools) if free else obj.pullable_with))
    return replace(observation, objects=tuple(objects))
