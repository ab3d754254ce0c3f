"""The planning cycle, Algorithm 1 of the thesis (Sec. 6.4.5.4): observe, adapt, maintain, plan, act."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cognitive_arch.execution.environment import Environment, FailureReason, Outcome, SkillResult
from cognitive_arch.execution.explain import EndReason, FailureReport, absent_entities, explain_failure
from cognitive_arch.execution.heuristics import (
    Adaptation,
    Event,
    EventKind,
    Heuristics,
    action_worked,
    undone,
)
from cognitive_arch.outside import Happening, OutsideEvent, Schedule, told
from cognitive_arch.planning.base import Planner, PlanResult
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import Goal, GroundAction, State, satisfied
from cognitive_arch.relational.transition import covering_rule
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import Observation
from cognitive_arch.world.state import StateChange, WorldState


@dataclass(frozen=True, slots=True)
class CycleSettings:
    """Horizon 5 up to 10 and decay 0.2 as published; at most 50 attempted actions (t of Sec. 6.4.6.2).

    The goal must still hold after `confirm_seconds` in which the robot does nothing.
    """

    horizon: int = 5
    max_horizon: int = 10
    decay: float = 0.2
    max_actions: int = 50
    confirm_seconds: float = 1.0


@dataclass(frozen=True, slots=True)
class Step:
    """One pass of the cycle: what was true, what was decided and why, what came of it.

    `before` and `after` are the world states around the action (the same one if nothing was done);
    `subgoal` counts from 1. `outcome` is judged from the observation after the action.
    """

    number: int
    before: WorldState
    subgoal: int
    goal: Goal
    horizon: int
    events: tuple[Event, ...]
    plan: PlanResult | None
    action: GroundAction | None
    outcome: Outcome | None
    reason: FailureReason
    effect: dict[str, float]
    after: WorldState

    @property
    def change(self) -> StateChange:
        """What the action changed in the world state."""
        return StateChange.between(self.before.atoms(), self.after.atoms())


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """How the episode ended; `good` and `total` count actions as in Sec. 6.4.6.2."""

    success: bool
    reason: EndReason
    good: int
    total: int
    failure: FailureReport | None
    final: WorldState


@dataclass
class _Progress:
    """Where in the list of sub-goals the cycle is; everything here is reset with each new list."""

    goals: tuple[Goal, ...]
    horizon: int
    index: int = 0
    reached: set[int] = field(default_factory=set)
    tried: list[tuple[GroundAction, bool]] = field(default_factory=list)

    @property
    def goal(self) -> Goal:
        return self.goals[self.index]


SLIPS = (Happening.EMPTY,)
MEDDLING = tuple(kind for kind in Happening if kind not in SLIPS)


class PlanningCycle:
    """Drives an environment through a list of sub-goals; `outside` is what happens to it meanwhile."""

    def __init__(
        self,
        environment: Environment,
        world: WorldModel,
        planner: Planner,
        rules: RuleSet,
        rng: np.random.Generator,
        *,
        heuristics: Heuristics = Heuristics(),
        settings: CycleSettings = CycleSettings(),
        outside: Iterable[OutsideEvent] = (),
        on_act: Callable[[GroundAction], None] = lambda action: None,
        on_step: Callable[[Step], None] = lambda step: None,
    ) -> None:
        self._environment = environment
        self._world = world
        self._planner = planner
        self._rules = rules
        self._rng = rng
        self._heuristics = heuristics
        self._settings = settings
        self._outside = Schedule(outside)
        self._on_act = on_act
        self._on_step = on_step
        self._grounded: dict[tuple[Entity, ...], tuple[GroundRule, ...]] = {}

    def run(
        self, goals: Sequence[Goal], observation: Observation, alternatives: Sequence[Sequence[Goal]] = ()
    ) -> EpisodeResult:
        """Work through `goals` until the last one holds, or until nothing is left to try.

        `alternatives` are other lists that mean the same, tried (with creativity) when `goals` fail.
        """
        self._progress = _Progress(tuple(goals), self._settings.horizon)
        self._alternatives = [tuple(other) for other in alternatives]
        self._adaptation = Adaptation(self._settings.decay)
        good = total = 0
        events: list[Event] = []
        self._world.update(observation)
        state = self._meddle(1, events, tuple(Happening))
        while True:
            plan, end = self._decide(state, events, total)
            if end is EndReason.GOAL_REACHED and not self._lasts(events):
                state = self._world.state
                continue
            if end is not None:
                state = self._world.state
                never = (f"{event}: the run was over before" for event in self._outside.pending)
                events.extend(Event(EventKind.OUTSIDE, why) for why in never)
                self._record(total + 1, state, events, plan, None, None, state)
                return self._result(end, good, total, state)
            assert plan is not None
            assert plan.action is not None
            self._on_act(plan.action)
            result = self._environment.execute(plan.action)
            slips: list[Event] = []
            result = self._slip(total + 2, plan.action, result, slips)
            after = self._world.update(self._environment.observe())
            worked = self._judge(plan.action, state, after)
            total, good = total + 1, good + worked
            self._record(total, state, events, plan, result, worked, after)
            self._progress.tried.append((plan.action, worked))
            events = slips + ([] if worked else self._adapt(plan.action, state))
            state = self._meddle(total + 1, events)

    def _lasts(self, events: list[Event]) -> bool:
        """Look again after a while: what holds for a moment only (a stack that topples) is not reached."""
        self._environment.settle(self._settings.confirm_seconds)
        state = self._world.update(self._environment.observe()).atoms()
        lost = [str(literal) for literal in self._progress.goal if not literal.holds(state)]
        if lost:
            events.append(Event(EventKind.GOAL_LOST, f"{', '.join(lost)} did not last"))
        return not lost

    # -- what others do -----------------------------------------------------------------------------

    def _slip(self, step: int, action: GroundAction, result: SkillResult, events: list[Event]) -> SkillResult:
        """Let slip what slips before action `step`: at once, so that it counts against the action just done.

        The robot only sees that its hand is empty after all; it cannot tell why.
        """
        emptied = self._happen(step, SLIPS, events)
        if result.outcome is Outcome.SUCCESS and emptied & set(action.args):
            return replace(result, outcome=Outcome.FAILURE, reason=FailureReason.SLIPPED)
        return result

    def _meddle(self, step: int, events: list[Event], kinds: Collection[Happening] = MEDDLING) -> WorldState:
        """Let others meddle before action `step`, and look again if anything changed."""
        if self._happen(step, kinds, events):
            return self._world.update(self._environment.observe())
        return self._world.state

    def _happen(self, step: int, kinds: Collection[Happening], events: list[Event]) -> set[str]:
        """Outside events of these kinds; returns the hands and objects they changed."""
        touched: set[str] = set()
        for event in self._outside.due(step, kinds):
            changed = self._environment.disturb(event)
            events.append(Event(EventKind.OUTSIDE, told(event, changed)))
            touched.update((event.name, *changed) if changed else ())
        return touched

    # -- deciding -----------------------------------------------------------------------------------

    def _decide(
        self, state: WorldState, events: list[Event], total: int
    ) -> tuple[PlanResult | None, EndReason | None]:
        """Lines 8 to 33 of Algorithm 1: either a plan whose first action is next, or the end."""
        plan: PlanResult | None = None
        while True:
            self._maintain_goals(state.atoms(), events)
            progress = self._progress
            if satisfied(progress.goal, state.atoms()):
                events.append(Event(EventKind.SUBGOAL_REACHED, f"sub-goal {progress.index + 1} holds"))
                progress.reached.add(progress.index)
                if progress.index == len(progress.goals) - 1:
                    return None, EndReason.GOAL_REACHED
                self._move_to(progress.index + 1)
                self._adaptation.reset()
                progress.tried.clear()
                continue
            if total >= self._settings.max_actions:
                return None, EndReason.ACTION_LIMIT
            rules = self._adaptation.apply(self._ground(state))
            plan = self._planner.plan(state.atoms(), progress.goal, rules, progress.horizon, self._rng)
            if plan.action is not None:
                return plan, None
            if progress.horizon < self._settings.max_horizon:
                progress.horizon += 1
                why = f"no plan within {progress.horizon - 1} actions: looking {progress.horizon} ahead"
                events.append(Event(EventKind.HORIZON_EXTENDED, why))
            elif not self._another_way(events):
                gone = absent_entities(progress.goal, [e.name for e in state.entities])
                return plan, EndReason.MISSING_OBJECT if gone else EndReason.NO_PLAN

    def _maintain_goals(self, state: State, events: list[Event]) -> None:
        """Step back while something that was reached, and is still asked for, has been undone.

        Only sub-goals that were reached count: one that creativity skipped was never true, and stepping
        back to it would undo the jump for ever.
        """
        progress = self._progress
        while self._heuristics.goal_maintenance:
            last = max((i for i in progress.reached if i < progress.index), default=None)
            if last is None:
                return
            lost = undone(progress.goals[last], progress.goal, state)
            if not lost:
                return
            why = f"{', '.join(map(str, lost))} no longer holds: back to sub-goal {last + 1}"
            events.append(Event(EventKind.GOAL_MAINTENANCE, why))
            progress.reached.discard(last)
            self._move_to(last)

    def _another_way(self, events: list[Event]) -> bool:
        """Creativity: skip a sub-goal that cannot be planned for, or let the other hand try."""
        progress = self._progress
        if not self._heuristics.creativity:
            return False
        if progress.index < len(progress.goals) - 1:
            why = f"no plan for sub-goal {progress.index + 1}: trying sub-goal {progress.index + 2} directly"
            events.append(Event(EventKind.CREATIVITY, why))
            self._move_to(progress.index + 1)
            return True
        if self._alternatives:
            why = "no plan for the last sub-goal: nobody said which hand, so the other one may try"
            events.append(Event(EventKind.OTHER_HAND, why))
            tried = progress.tried
            self._progress = _Progress(self._alternatives.pop(0), self._settings.horizon, tried=tried)
            return True
        return False

    def _move_to(self, index: int) -> None:
        self._progress.index = index
        self._progress.horizon = self._settings.horizon

    # -- learning from what happened ----------------------------------------------------------------

    def _ground(self, state: WorldState) -> tuple[GroundRule, ...]:
        """The rules over what is there now; grounding again only when that changed."""
        if state.entities not in self._grounded:
            self._grounded = {state.entities: self._rules.ground(state.entities, self._environment.skills)}
        return self._grounded[state.entities]

    def _judge(self, action: GroundAction, before: WorldState, after: WorldState) -> bool:
        rule = covering_rule(self._ground(before), action, before.atoms())
        return action_worked(rule, before.atoms(), after.atoms())

    def _adapt(self, action: GroundAction, state: WorldState) -> list[Event]:
        if not self._heuristics.adaptability:
            return []
        return [self._adaptation.record(action, self._ground(state))]

    # -- telling ------------------------------------------------------------------------------------

    def _record(
        self,
        number: int,
        before: WorldState,
        events: list[Event],
        plan: PlanResult | None,
        result: SkillResult | None,
        worked: bool | None,
        after: WorldState,
    ) -> None:
        reason = FailureReason.NONE
        if result is not None and not worked:
            changed = before.atoms() != after.atoms()
            reason = result.reason
            if reason is FailureReason.NONE:
                reason = FailureReason.UNEXPECTED_EFFECT if changed else FailureReason.NO_EFFECT
        self._on_step(
            Step(
                number=number,
                before=before,
                subgoal=self._progress.index + 1,
                goal=self._progress.goal,
                horizon=self._progress.horizon,
                events=tuple(events),
                plan=plan,
                action=plan.action if plan and result is not None else None,
                outcome=None if worked is None else Outcome.SUCCESS if worked else Outcome.FAILURE,
                reason=reason,
                effect=dict(sorted(result.effect.items())) if result else {},
                after=after,
            )
        )

    def _result(self, end: EndReason, good: int, total: int, state: WorldState) -> EpisodeResult:
        progress = self._progress
        report = None
        if end is not EndReason.GOAL_REACHED:
            report = explain_failure(
                end,
                progress.index + 1,
                progress.goal,
                state.atoms(),
                self._ground(state),
                progress.tried,
                progress.horizon,
                absent_entities(progress.goal, [entity.name for entity in state.entities]),
            )
        return EpisodeResult(report is None, end, good, total, report, state)
