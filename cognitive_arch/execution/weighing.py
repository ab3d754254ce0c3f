"""Another try, another way, or help? The heuristic set `reliability` decides by expected cost.

The cheapest way to the last sub-goal is what counts. Sub-goals on the way are kept to as long as that costs
nothing; when the belief in what the robot can do changes, so does what is cheapest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cognitive_arch.execution.explain import EndReason
from cognitive_arch.execution.heuristics import Event, EventKind
from cognitive_arch.execution.reliability import Reliability
from cognitive_arch.planning.base import PlanResult, PlanStatus
from cognitive_arch.planning.cheapest import Way, cheapest_way
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import Goal, GroundAction, State
from cognitive_arch.relational.transition import apply_literals, covering_rule

SAME = 1e-6
"""Costs that differ by less are the same."""

DISCOUNT = 0.95


@dataclass(frozen=True, slots=True)
class Choice:
    """A plan and the sub-goal it goes for, of which list; or the end, and why."""

    way: int
    index: int
    plan: PlanResult | None
    end: EndReason | None
    events: tuple[Event, ...] = ()


def priors(rules: Sequence[GroundRule]) -> dict[GroundAction, float]:
    """What the rules say of every action: the probability of its first outcome, at best."""
    found: dict[GroundAction, float] = {}
    for rule in rules:
        if rule.outcomes:
            found[rule.action] = max(found.get(rule.action, 0.0), rule.outcomes[0].probability)
    return found


@dataclass(frozen=True)
class Weighing:
    """One decision in `state`; `rules` are those of the domain, `ways` the lists of sub-goals."""

    state: State
    ways: Sequence[Sequence[Goal]]
    rules: Sequence[GroundRule]
    reliability: Reliability

    def __post_init__(self) -> None:
        prior = priors(self.rules)
        chances = {action: self.reliability.chance(action, p) for action, p in prior.items()}
        object.__setattr__(self, "_chances", chances)

    def choose(self, way: int, index: int, reached: int = 0) -> Choice:
        """What to do, now that sub-goal `index` of list `way` is next; `reached` is the last that held."""
        limit = self.reliability.settings.help_cost
        best, chosen = self._cheapest(self.state, self.ways[way][-1], limit), way
        for other in range(way + 1, len(self.ways)):
            rival = self._cheapest(self.state, self.ways[other][-1], best.cost - SAME if best else limit)
            if rival is not None:
                best, chosen = rival, other
        if best is None:
            return self._give_up(way, index, reached, limit)
        events = []
        if chosen != way:
            index = 0
            why = f"nobody said which hand: the other one is expected to take {best.cost:.1f} attempts only"
            events.append(Event(EventKind.OTHER_HAND, why))
        goal, path = self._along(self.ways[chosen], index, best)
        if goal != index:
            why = f"keeping to sub-goal {index + 1} would take more than {best.cost:.1f} expected attempts: "
            events.append(Event(EventKind.RELIABILITY, f"{why}going for sub-goal {goal + 1} directly"))
        return Choice(chosen, goal, _as_plan(path), None, tuple(events))

    def _give_up(self, way: int, index: int, reached: int, limit: float) -> Choice:
        anyhow = self._cheapest(self.state, self.ways[way][-1], float("inf"))
        if anyhow is None:
            return self._part_of_it(way, index, reached, limit)
        why = (
            f"to go on is expected to take {anyhow.cost:.1f} attempts, help costs {limit:g}: asking for help"
        )
        return Choice(
            way, index, _as_plan(anyhow), EndReason.HELP_ASKED, (Event(EventKind.RELIABILITY, why),)
        )

    def _part_of_it(self, way: int, index: int, reached: int, limit: float) -> Choice:
        """No way to the end is seen: do the last sub-goal that can be done.

        Rules need not tell all that actions change. With a layer in each hand, say, they see no way to put
        one on the other, for what a hand holds is out of the other one's reach; once it lies there is one.
        """
        goals = self.ways[way]
        for n in reversed(range(reached, len(goals) - 1)):  # going back further would undo it
            part = self._cheapest(self.state, goals[n], limit)
            if part is not None and part.actions:
                why = f"no way to the last sub-goal is seen from here: doing sub-goal {n + 1} first"
                events = () if n == index else (Event(EventKind.RELIABILITY, why),)
                return Choice(way, n, _as_plan(part), None, events)
        return Choice(way, index, None, EndReason.NO_PLAN)

    def _along(self, goals: Sequence[Goal], index: int, best: Way) -> tuple[int, Way]:
        """The first sub-goal from `index` on that lies on a cheapest way, and that way."""
        for n in range(index, len(goals) - 1):
            there = self._cheapest(self.state, goals[n], best.cost + SAME)
            if there is None or not there.actions:
                continue
            after = self._after(there.actions)
            rest = self._cheapest(after, goals[-1], best.cost - there.cost + SAME)
            if rest is not None:
                return n, Way(there.actions + rest.actions, there.attempts + rest.attempts)
        return len(goals) - 1, best

    def _cheapest(self, state: State, goal: Goal, limit: float) -> Way | None:
        chances: dict[GroundAction, float] = self._chances  # type: ignore[attr-defined]
        return cheapest_way(state, goal, self.rules, chances.__getitem__, limit)

    def _after(self, actions: Sequence[GroundAction]) -> State:
        """The state once all of `actions` have worked."""
        state = self.state
        for action in actions:
            rule = covering_rule(self.rules, action, state)
            if rule is not None:
                state = apply_literals(state, rule.outcomes[0].literals)
        return state


def _as_plan(way: Way) -> PlanResult:
    """The way as a plan; its probability is that every action works at the first attempt."""
    probability = 1.0
    for attempts in way.attempts:
        probability /= attempts
    return PlanResult(PlanStatus.PLAN, way.actions, DISCOUNT ** len(way.actions) * probability, probability)
