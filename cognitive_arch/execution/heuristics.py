"""The three heuristics of thesis Sec. 6.4.5.4, each switchable, and what the log says when one fires.

`reliability` is one of our own, in place of adaptability and creativity (see `reliability.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from enum import StrEnum

from cognitive_arch.errors import ConfigError, unknown
from cognitive_arch.relational.rules import GroundRule, GroundRules, derived_of
from cognitive_arch.relational.symbols import Goal, GroundAction, Literal, State

PUBLISHED = ("adaptability", "creativity", "goal_maintenance")


@dataclass(frozen=True, slots=True)
class Heuristics:
    """Which heuristics are on."""

    adaptability: bool = True
    creativity: bool = True
    goal_maintenance: bool = True
    reliability: bool = False

    def __post_init__(self) -> None:
        if self.reliability and (self.adaptability or self.creativity):
            raise ConfigError(
                "reliability takes the place of adaptability and creativity; valid with it: goal_maintenance"
            )

    def __str__(self) -> str:
        return ",".join(name for name, on in asdict(self).items() if on) or "none"

    @classmethod
    def parse(cls, text: str) -> Heuristics:
        """Read `all` (the published three), `none`, or a list such as `adaptability,creativity`.

        `+` separates, too.
        """
        names = [f.name for f in fields(cls)]
        word = text.strip().lower()
        if word in ("all", "none"):
            return cls(**dict.fromkeys(PUBLISHED, word == "all"))
        chosen = [part.strip().replace("-", "_") for part in word.replace("+", ",").split(",")]
        for part in chosen:
            if part in ("all", "none"):
                raise ConfigError(
                    f"'{text}': {part} stands alone; valid together: {', '.join(sorted(names))}"
                )
            if part not in names:
                raise ConfigError(unknown("heuristic", part, [*names, "all", "none"]))
        return cls(**{name: name in chosen for name in names})


class EventKind(StrEnum):
    """What may happen between looking and acting."""

    SUBGOAL_REACHED = "subgoal_reached"
    ADAPTABILITY = "adaptability"
    GOAL_MAINTENANCE = "goal_maintenance"
    HORIZON_EXTENDED = "horizon_extended"
    CREATIVITY = "creativity"
    OTHER_HAND = "other_hand"
    GOAL_LOST = "goal_lost"
    OUTSIDE = "outside"
    RELIABILITY = "reliability"


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened, and why, for the log."""

    kind: EventKind
    why: str


@dataclass
class Adaptation:
    """Adaptability: success probabilities that failures have lowered for the time being.

    Each failure multiplies the probability of the action's first outcome by `decay` (sigma of Eq. (24));
    what it loses goes to the noise outcome. The rules themselves are never changed.
    """

    decay: float
    failures: dict[GroundAction, int] = field(default_factory=dict)

    def record(self, action: GroundAction, rules: Sequence[GroundRule]) -> Event:
        """Count one failure of `action`."""
        mine = [rule for rule in self.apply(rules) if rule.action == action]
        self.failures[action] = self.failures.get(action, 0) + 1
        old = max((rule.outcomes[0].probability for rule in mine), default=0.0)
        return Event(
            EventKind.ADAPTABILITY,
            f"{action} failed {_times(self.failures[action])}: its success probability goes "
            f"from {old:.3g} to {old * self.decay:.3g}",
        )

    def reset(self) -> None:
        """Forget all failures."""
        self.failures.clear()

    def apply(self, rules: Sequence[GroundRule]) -> Sequence[GroundRule]:
        """`rules` with the lowered probabilities; they themselves if nothing has failed."""
        if not self.failures:
            return rules
        lowered = (_lowered(rule, self.decay ** self.failures.get(rule.action, 0)) for rule in rules)
        return GroundRules(lowered, derived_of(rules))


def _lowered(rule: GroundRule, factor: float) -> GroundRule:
    return rule if factor == 1.0 else rule.with_first_probability(rule.outcomes[0].probability * factor)


def _times(n: int) -> str:
    return {1: "once", 2: "twice"}.get(n, f"{n} times")


def undone(previous: Goal, current: Goal, state: State) -> tuple[Literal, ...]:
    """Goal maintenance: literals that both sub-goals ask for and that no longer hold."""
    return tuple(lit for lit in current if lit in previous and not lit.holds(state))


def action_worked(rule: GroundRule | None, before: State, after: State) -> bool:
    """Whether an action did what its `rule` is for: something changed, all of its first outcome is there."""
    if rule is None or before == after:
        return False
    return all(literal.holds(after) for literal in rule.outcomes[0].literals)
