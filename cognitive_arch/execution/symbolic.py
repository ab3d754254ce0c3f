"""The symbolic environment: a coin decides whether an action works (thesis Sec. 6.4.6).

Positions follow simple geometry, reach follows the scene's published constants. An action succeeds if a
uniform draw is at least the noise level of its capability; a failed one changes nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from cognitive_arch.domain import Domain, Placement, Scene, jittered
from cognitive_arch.execution.environment import FailureReason, Outcome, SkillResult
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.execution.placing import Place, footprint, nearest_free
from cognitive_arch.execution.saving import SavedState, restore_rng, restoring, save_rng
from cognitive_arch.footprint import gets_behind
from cognitive_arch.outside import Happening, OutsideEvent
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import GroundAction, Literal, State, parse_literal
from cognitive_arch.relational.transition import covering_rule
from cognitive_arch.shapes import Shape, ToolShape
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import HANDS, HandObservation, ObjectObservation, Observation

PULL_DISTANCE = 0.20  # metres that a pull brings an object closer (published)
CLEARANCE = 0.075  # metres between the centres of two things on the table
FORMAT = 1  # of saved states

_REASONS = {
    ("on", False): FailureReason.COVERED,
    ("isClear", True): FailureReason.HAND_BUSY,
    ("inHand", True): FailureReason.HAND_EMPTY,
    ("inHand", False): FailureReason.HAND_BUSY,
    ("reachableWith", True): FailureReason.OUT_OF_REACH,
    ("pullableWith", True): FailureReason.OUT_OF_REACH,
}


@dataclass(frozen=True)
class _Thing:
    """Where one object is: on the table at `place`, on `support`, or in `hand`."""

    place: tuple[float, float]
    yaw: float = 0.0
    support: str | None = None
    hand: str | None = None


_THINGS = TypeAdapter(list[tuple[str, _Thing]])


@dataclass
class SymbolicEnvironment:
    """Implements `Environment`; `jitter` (metres) moves the objects at the start of each episode.

    With `quiet_release` an action whose rule empties a hand (put, drop) never fails by noise, as in the
    published runs; the text has it as noisy as its arm. With `shapes_seen` observations hold shape
    descriptors: those of the domain's shapes, seen from above.
    """

    domain: Domain
    scene: Scene
    rules: RuleSet
    noise: NoiseLevels = NoiseLevels()
    jitter: float = 0.0
    quiet_release: bool = False
    shapes_seen: bool = False
    _things: dict[str, _Thing] = field(default_factory=dict)
    _properties: frozenset[str] = frozenset()
    _steps: int = 0

    def __post_init__(self) -> None:
        self.skills = frozenset(rule.action for rule in self.rules.rules)
        self.noise_told = tuple(
            f"{capability}: an action fails with probability {level:g} and then changes nothing"
            for capability, level in asdict(self.noise).items()
            if level > 0
        )
        self._rng = np.random.default_rng(0)
        self._ground: tuple[GroundRule, ...] = ()

    def reset(self, seed: int) -> Observation:
        """See `Environment.reset`."""
        self._rng = np.random.default_rng(seed)
        placements: dict[str, Placement] = jittered(self.scene, self.jitter, self._rng, self.domain)
        self._things = {name: _Thing(p.position, p.yaw) for name, p in sorted(placements.items())}
        self._properties = frozenset()
        self._steps = 0
        self._reground()
        return self.observe()

    def _reground(self) -> None:
        """The rules over what is there now."""
        entities = [Entity(hand, "hand") for hand in HANDS]
        entities += [Entity(name, self.domain.objects[name].kind) for name in sorted(self._things)]
        self._ground = self.rules.ground(entities)

    def observe(self) -> Observation:
        """See `Environment.observe`."""
        objects = tuple(self._see(name) for name in sorted(self._things))
        hands = tuple(HandObservation(hand, self._held_by(hand)) for hand in HANDS)
        absent = tuple(name for name in self.scene.things if name not in self._things)
        return Observation(float(self._steps), objects, hands, absent, tuple(sorted(self._properties)))

    def truth(self) -> Observation | None:
        """See `Environment.truth`: `observe` tells it."""
        return None

    def execute(self, action: GroundAction) -> SkillResult:
        """See `Environment.execute`."""
        self._steps += 1
        reason = self._obstacle(action)
        if reason is not None:
            return SkillResult(Outcome.FAILURE, reason)
        rule = covering_rule(self._ground, action, self._atoms())
        if rule is None:
            return SkillResult(Outcome.FAILURE, FailureReason.NO_EFFECT)
        level = self.noise.of(action, self.domain.capabilities)
        if self._rng.random() < (0.0 if self.quiet_release and releases(rule) else level):
            return SkillResult(Outcome.FAILURE, FailureReason.NOISE)
        before = self._xy(action.args[0])
        self._apply(rule)
        after = self._xy(action.args[0])
        effect = {"displacement_x": after[0] - before[0], "displacement_y": after[1] - before[1]}
        return SkillResult(Outcome.SUCCESS, FailureReason.NONE, effect)

    def disturb(self, event: OutsideEvent) -> tuple[str, ...]:
        """See `Environment.disturb`."""
        changed = self._touched(event)
        if event.kind in (Happening.EMPTY, Happening.TOPPLE):
            x_y = {name: self._xy(name) for name in changed}
            for n, name in enumerate(changed):
                place = self._free_spot(name, x_y[name], ignoring=changed[n:])
                self._things[name] = replace(self._things[name], place=place, support=None, hand=None)
        elif changed:
            self._take_out(event.name)
            if event.position is not None:
                place = self._free_spot(event.name, event.position)
                self._things[event.name] = _Thing(place)
            self._reground()
        return changed

    def _touched(self, event: OutsideEvent) -> tuple[str, ...]:
        """The objects that an event changes, from the bottom up."""
        name, there = event.name, event.name in self._things
        if event.kind is Happening.EMPTY:
            held = self._held_by(name)
            return (held,) if held else ()
        if event.kind is Happening.ADD:
            known = name in self.domain.objects and not there
            return (name,) if known else ()
        if event.kind is Happening.TOPPLE and there:
            above = self._above(name)
            return (name, *above) if self._things[name].support else tuple(above)
        return (name,) if there else ()

    def _above(self, name: str) -> list[str]:
        """What lies on `name`, and on that, from the bottom up."""
        above = [n for n in self._things if n != name and name in self._below(n)]
        return sorted(above, key=self._bottom)

    def _take_out(self, name: str) -> None:
        """Remove an object; what lies on it sinks to what it lay on."""
        taken = self._things.pop(name, None)
        if taken is None:
            return
        for other, thing in list(self._things.items()):
            if thing.support == name:
                self._things[other] = replace(thing, place=taken.place, support=taken.support)

    def _free_spot(self, name: str, wanted: Place, ignoring: Sequence[str] = ()) -> Place:
        """The free place on the table nearest to `wanted`."""
        others = [
            (self._xy(other)[0] + x, self._xy(other)[1] + y)
            for other, thing in self._things.items()
            if other != name and other not in ignoring and thing.hand is None
            for x, y in footprint(self.domain.objects[other].shape, thing.yaw)
        ]
        yaw = self._things[name].yaw if name in self._things else 0.0
        return nearest_free(wanted, others, footprint(self.domain.objects[name].shape, yaw))

    def settle(self, seconds: float) -> None:
        """Nothing moves by itself here."""

    def save(self) -> SavedState:
        """See `Environment.save`."""
        return {
            "kind": "symbolic",
            "format": FORMAT,
            "things": [[name, asdict(thing)] for name, thing in self._things.items()],
            "properties": sorted(self._properties),
            "steps": self._steps,
            "rng": save_rng(self._rng),
        }

    def restore(self, saved: SavedState) -> Observation:
        """See `Environment.restore`."""
        with restoring(saved, "symbolic", FORMAT):
            things = dict(_THINGS.validate_python(saved["things"]))
            self._check(things)
            properties = frozenset(str(parse_literal(text).atom) for text in saved["properties"])
            rng, steps = restore_rng(saved["rng"]), int(saved["steps"])
        self._rng, self._steps, self._things, self._properties = rng, steps, things, properties
        self._reground()
        return self.observe()

    def _check(self, things: Mapping[str, _Thing]) -> None:
        """Raise `ValueError` for things that are not of this scene or rest on each other in a circle."""
        where = {thing.hand for thing in things.values()} | {thing.support for thing in things.values()}
        strangers = set(things) - set(self.scene.things) | where - {None, *HANDS, *things}
        if strangers:
            raise ValueError(f"{', '.join(sorted(map(str, strangers)))} is not in this scene")
        for name in things:
            below = {name}
            support = things[name].support
            while support is not None:
                if support in below:
                    raise ValueError(f"{name} rests on itself")
                below.add(support)
                support = things[support].support

    def record_into(self, folder: Path) -> None:
        """Nothing to show: there are no pictures of symbols."""

    def keep_step(self, number: int) -> None:
        """Nothing to show."""

    def save_artifacts(self) -> tuple[str, ...]:
        """Nothing to show."""
        return ()

    def close(self) -> None:
        """Nothing to release."""

    # -- looking ------------------------------------------------------------------------------------

    def _atoms(self) -> State:
        return WorldModel().update(self.observe()).atoms()

    def _held_by(self, hand: str) -> str | None:
        return next((name for name, thing in self._things.items() if thing.hand == hand), None)

    def _xy(self, name: str) -> tuple[float, float]:
        thing = self._things[name]
        return self._xy(thing.support) if thing.support else thing.place

    def _below(self, name: str) -> set[str]:
        """`name` and everything it rests on."""
        support = self._things[name].support
        return {name} | (self._below(support) if support else set())

    def _bottom(self, name: str) -> float:
        support = self._things[name].support
        if support is None:
            return self.scene.table.height
        return self._bottom(support) + self.domain.objects[support].shape.height

    def _see(self, name: str) -> ObjectObservation:
        thing, spec = self._things[name], self.domain.objects[name]
        x, y = self._xy(name)
        hands = HANDS if thing.hand else self.scene.reach.hands(x, y)
        tools: tuple[str, ...] = ()
        if self.scene.reach.with_tool(x):
            tools = tuple(t for t in self._things if self.domain.objects[t].kind == "tool" and t != name)
        pullers = tuple(t for t in tools if self._pulls(t, name))
        desc, tooldesc = _described(spec.shape) if self.shapes_seen else ((), ())
        return ObjectObservation(
            name=name,
            kind=spec.kind,
            position=(x, y, self._bottom(name) + spec.shape.height / 2),
            below=(thing.support,) if thing.support else (),
            reachable_with=(*hands, *tools),
            pullable_with=() if hands else pullers,
            yaw=thing.yaw,
            desc=desc,
            tooldesc=tooldesc,
        )

    def _pulls(self, tool: str, name: str) -> bool:
        """Whether the tool can pull the thing: as its domain says, or else by its shape."""
        spec = self.domain.objects[tool]
        if spec.can_pull is not None or not isinstance(spec.shape, ToolShape):
            return bool(spec.can_pull)
        return gets_behind(spec.shape, self.domain.objects[name].shape)

    # -- acting -------------------------------------------------------------------------------------

    def _obstacle(self, action: GroundAction) -> FailureReason | None:
        """Why `action` cannot even be tried now, if so."""
        if action.name not in self.skills:
            return FailureReason.UNKNOWN_SKILL
        if not action.args or action.args[0] not in self._things:
            return FailureReason.UNKNOWN_OBJECT
        mine = [rule for rule in self._ground if rule.action == action]
        named = {arg for rule in mine for lit in rule.outcomes[0].literals for arg in lit.atom.args}
        if not mine or not named <= {*self._things, *HANDS}:
            return FailureReason.UNKNOWN_OBJECT
        state = self._atoms()
        if any(rule.applies(state) for rule in mine):
            return None
        missing = next(lit for lit in mine[0].context if not lit.holds(state))
        return _REASONS.get((missing.atom.predicate, missing.positive), FailureReason.NO_EFFECT)

    def _apply(self, rule: GroundRule) -> None:
        """Make the first outcome true: geometry for what geometry decides, properties for the rest."""
        moved_by_reach: set[str] = set()
        placed = {lit.atom.args[0] for lit in rule.outcomes[0].literals if _puts(lit)}
        for literal in rule.outcomes[0].literals:
            name, args = literal.atom
            if name == "inHand" and literal.positive:
                self._things[args[0]] = replace(
                    self._things[args[0]], place=self._xy(args[0]), support=None, hand=args[1]
                )
            elif name == "on" and literal.positive and args[0] not in self._below(args[1]):
                self._things[args[0]] = replace(self._things[args[0]], support=args[1], hand=None)
            elif name == "inHand" and args[0] not in placed:
                self._drop(args[0], args[1])
            elif name == "reachableWith" and args[0] not in moved_by_reach and not self._was_held(rule):
                moved_by_reach.add(args[0])
                self._shift(args[0], closer=literal.positive)
            elif name not in ("inHand", "on", "isClear", "reachableWith"):
                change = frozenset({str(literal.atom)})
                self._properties = (
                    self._properties | change if literal.positive else self._properties - change
                )

    @staticmethod
    def _was_held(rule: GroundRule) -> bool:
        """Whether the action releases its object (then reach follows from where it is dropped)."""
        return any(lit.atom.predicate == "inHand" for lit in rule.outcomes[0].literals)

    def _shift(self, name: str, closer: bool) -> None:
        """A pull brings a thing closer by a fixed way; a push ends, as its rule says, out of all reach."""
        x, y = self._xy(name)
        reach = self.scene.reach
        x = x + PULL_DISTANCE if closer else min(x, reach.min_x - reach.tool - 0.01)
        self._things[name] = replace(self._things[name], place=(x, y), support=None)

    def _drop(self, name: str, hand: str) -> None:
        self._things[name] = replace(self._things[name], place=self._free_place(name, hand), hand=None)

    def _free_place(self, name: str, hand: str) -> tuple[float, float]:
        """The free place on the table nearest to where the object was taken up, within the hand's reach."""
        x0, y0 = self._things[name].place
        others = [self._xy(n) for n, t in self._things.items() if n != name and t.hand is None]
        step = CLEARANCE / 2
        offsets = [(i * step, j * step) for i, j in itertools.product(range(-12, 13), repeat=2)]
        for dx, dy in sorted(offsets, key=lambda d: (math.hypot(*d), d)):
            place = (x0 + dx, y0 + dy)
            free = all(math.dist(place, other) >= CLEARANCE for other in others)
            if free and place[0] <= -0.2 and hand in self.scene.reach.hands(*place):
                return place
        return x0, y0


def _described(shape: Shape) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Descriptors of the whole and of both halves; what draws shapes is loaded when it is needed."""
    from cognitive_arch.perception.top_view import described

    return described(shape)


def releases(rule: GroundRule) -> bool:
    """Whether the action is for emptying a hand."""
    return any(lit.atom.predicate == "inHand" and not lit.positive for lit in rule.outcomes[0].literals)


def _puts(literal: Literal) -> bool:
    return literal.atom.predicate == "on" and literal.positive
