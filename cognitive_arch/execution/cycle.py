"""The planning cycle, Algorithm 1 of the thesis (Sec. 6.4.5.4): observe, adapt, maintain, plan, act."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from cognitive_arch.execution.beliefs import Belief, beliefs
from cognitive_arch.execution.environment import Environment, FailureReason, Outcome, SkillResult
from cognitive_arch.execution.episode import CycleSettings, CycleState, EpisodeResult, Step
from cognitive_arch.execution.explain import EndReason, absent_entities, explain_failure
from cognitive_arch.execution.grounding import Grounding, RuleGrounding
from cognitive_arch.execution.heuristics import (
    Adaptation,
    Event,
    EventKind,
    Heuristics,
    action_worked,
    undone,
)
from cognitive_arch.execution.reliability import Reliability
from cognitive_arch.execution.weighing import Weighing, priors
from cognitive_arch.outside import Happening, OutsideEvent, Schedule, told
from cognitive_arch.planning.base import Planner, PlanResult
from cognitive_arch.relational.rules import GroundRule, RuleSet
from cognitive_arch.relational.symbols import Goal, GroundAction, State, satisfied
from cognitive_arch.relational.transition import covering_rule
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import Observation
from cognitive_arch.world.state import WorldState


class PlanningCycle:
    """Drives an environment through a list of sub-goals; `outside` is what happens to it meanwhile.

    `grounding` gives the rules over what is there; without one they are `rules` with their own numbers.
    """

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
        grounding: Grounding | None = None,
        on_act: Callable[[GroundAction], None] = lambda action: None,
        on_step: Callable[[Step], None] = lambda step: None,
    ) -> None:
        self._environment = environment
        self._world = world
        self._planner = planner
        self._grounding = grounding or RuleGrounding(rules, environment.skills)
        self._rng = rng
        self._heuristics = heuristics
        self._settings = settings
        self._outside = tuple(outside)
        self._on_act = on_act
        self._on_step = on_step

    def run(
        self, goals: Sequence[Goal], observation: Observation, alternatives: Sequence[Sequence[Goal]] = ()
    ) -> EpisodeResult:
        """Work through `goals` until the last one holds, or until nothing is left to try.

        `alternatives` are other lists that mean the same, tried (with creativity) when `goals` fail.
        """
        self.state = CycleState(
            self._settings.horizon,
            Adaptation(self._settings.decay),
            Schedule(self._outside),
            Reliability(self._settings.reliability),
        )
        self._world.update(self._grounding.perceive(observation))
        return self._work(goals, alternatives)

    def resume(
        self, state: CycleState, goals: Sequence[Goal], alternatives: Sequence[Sequence[Goal]] = ()
    ) -> EpisodeResult:
        """Go on with what `run` was called for, after the step that left `state`.

        Environment, world model and generator must be as they were then.
        """
        self.state = state
        return self._work(goals, alternatives)

    def _work(self, goals: Sequence[Goal], alternatives: Sequence[Sequence[Goal]]) -> EpisodeResult:
        self._ways = (tuple(goals), *map(tuple, alternatives))
        while True:
            before = self._meddle()
            plan, end = self._decide(before)
            if end is EndReason.GOAL_REACHED and not self._lasts():
                continue
            if end is not None:
                return self._finish(plan, end)
            assert plan is not None
            assert plan.action is not None
            self._act(plan, plan.action, before)

    def _act(self, plan: PlanResult, action: GroundAction, before: WorldState) -> None:
        """Do the plan's first action, look what came of it, learn from that."""
        state = self.state
        so_far, state.events = state.events, []
        self._on_act(action)
        result = self._slip(action, self._environment.execute(action))
        after = self._look()
        worked = self._judge(action, before, after)
        state.total, state.good = state.total + 1, state.good + worked
        step = self._step(state.total, so_far, before, plan, result, worked, after)
        state.tried.append((action, worked))
        self._learn(action, worked, step.reason, self._ground(before))
        self._on_step(step)  # last, so that whoever listens finds all that the next step begins with

    def _finish(self, plan: PlanResult | None, end: EndReason) -> EpisodeResult:
        """Tell how it ended, as a step without an action."""
        state, world = self.state, self._world.state
        never = [f"{event}: the run was over before" for event in state.outside.pending]
        events = [*state.events, *(Event(EventKind.OUTSIDE, why) for why in never)]
        self._on_step(self._step(state.total + 1, events, world, plan, None, None, world))
        return self._result(end, world)

    def _lasts(self) -> bool:
        """Look again after a while: what holds for a moment only (a stack that topples) is not reached."""
        self._environment.settle(self._settings.confirm_seconds)
        state = self._look().atoms()
        lost = [str(literal) for literal in self._goal if not literal.holds(state)]
        if lost:
            self._tell(EventKind.GOAL_LOST, f"{', '.join(lost)} did not last")
        return not lost

    @property
    def _goals(self) -> tuple[Goal, ...]:
        return self._ways[self.state.way]

    @property
    def _goal(self) -> Goal:
        return self._goals[self.state.index]

    def _tell(self, kind: EventKind, why: str) -> None:
        self.state.events.append(Event(kind, why))

    # -- what others do -----------------------------------------------------------------------------

    def _slip(self, action: GroundAction, result: SkillResult) -> SkillResult:
        """Let slip what slips before the next action: at once, so that it counts against the one just done.

        The robot only sees that its hand is empty after all; it cannot tell why.
        """
        emptied = self._happen(self.state.total + 2, (Happening.EMPTY,))
        if result.outcome is Outcome.SUCCESS and emptied & set(action.args):
            return replace(result, outcome=Outcome.FAILURE, reason=FailureReason.SLIPPED)
        return result

    def _meddle(self) -> WorldState:
        """Let others meddle before the next action, and look again if anything changed."""
        if self._happen(self.state.total + 1, tuple(Happening)):
            return self._look()
        return self._world.state

    def _happen(self, step: int, kinds: Collection[Happening]) -> set[str]:
        """Outside events of these kinds; returns the hands and objects they changed."""
        touched: set[str] = set()
        for event in self.state.outside.due(step, kinds):
            changed = self._environment.disturb(event)
            self._tell(EventKind.OUTSIDE, told(event, changed))
            touched.update((event.name, *changed) if changed else ())
        return touched

    # -- deciding -----------------------------------------------------------------------------------

    def _decide(self, world: WorldState) -> tuple[PlanResult | None, EndReason | None]:
        """Lines 8 to 33 of Algorithm 1: either a plan whose first action is next, or the end."""
        plan: PlanResult | None = None
        state = self.state
        while True:
            self._maintain_goals(world.atoms())
            if satisfied(self._goal, world.atoms()):
                self._tell(EventKind.SUBGOAL_REACHED, f"sub-goal {state.index + 1} holds")
                state.reached.add(state.index)
                if state.index == len(self._goals) - 1:
                    return None, EndReason.GOAL_REACHED
                self._move_to(state.index + 1)
                state.adaptation.reset()
                state.tried.clear()
                continue
            if state.total >= self._settings.max_actions:
                return None, EndReason.ACTION_LIMIT
            if self._heuristics.reliability:
                return self._weigh(world)
            rules = state.adaptation.apply(self._ground(world))
            plan = self._planner.plan(world.atoms(), self._goal, rules, state.horizon, self._rng)
            if plan.action is not None:
                return plan, None
            if state.horizon < self._settings.max_horizon:
                state.horizon += 1
                why = f"no plan within {state.horizon - 1} actions: looking {state.horizon} ahead"
                self._tell(EventKind.HORIZON_EXTENDED, why)
            elif not self._another_way():
                return plan, self._missing(world)

    def _weigh(self, world: WorldState) -> tuple[PlanResult | None, EndReason | None]:
        """Reliability: the plan, and the sub-goal it goes for, by expected cost instead of by horizon."""
        state = self.state
        weighing = Weighing(world.atoms(), self._ways, self._ground(world), state.reliability)
        choice = weighing.choose(state.way, state.index, max(state.reached, default=0))
        state.events.extend(choice.events)
        if choice.way != state.way:
            state.way = choice.way
            state.reached.clear()
        self._move_to(choice.index)
        state.horizon = max(self._settings.horizon, len(choice.plan.actions) if choice.plan else 0)
        return choice.plan, self._missing(world) if choice.end is EndReason.NO_PLAN else choice.end

    def _missing(self, world: WorldState) -> EndReason:
        """Why there is no plan: perhaps for lack of an object."""
        gone = absent_entities(self._goal, [entity.name for entity in world.entities])
        return EndReason.MISSING_OBJECT if gone else EndReason.NO_PLAN

    def _maintain_goals(self, atoms: State) -> None:
        """Step back while something that was reached, and is still asked for, has been undone.

        Only sub-goals that were reached count: one that creativity skipped was never true, and stepping
        back to it would undo the jump for ever.
        """
        state = self.state
        while self._heuristics.goal_maintenance:
            last = max((i for i in state.reached if i < state.index), default=None)
            if last is None:
                return
            lost = undone(self._goals[last], self._goal, atoms)
            if not lost:
                return
            why = f"{', '.join(map(str, lost))} no longer holds: back to sub-goal {last + 1}"
            self._tell(EventKind.GOAL_MAINTENANCE, why)
            state.reached.discard(last)
            self._move_to(last)

    def _another_way(self) -> bool:
        """Creativity: skip a sub-goal that cannot be planned for, or let the other hand try."""
        state = self.state
        if not self._heuristics.creativity:
            return False
        if state.index < len(self._goals) - 1:
            why = f"no plan for sub-goal {state.index + 1}: trying sub-goal {state.index + 2} directly"
            self._tell(EventKind.CREATIVITY, why)
            self._move_to(state.index + 1)
            return True
        if state.way < len(self._ways) - 1:
            why = "no plan for the last sub-goal: nobody said which hand, so the other one may try"
            self._tell(EventKind.OTHER_HAND, why)
            state.way += 1
            state.reached.clear()
            self._move_to(0)
            return True
        return False

    def _move_to(self, index: int) -> None:
        self.state.index = index
        self.state.horizon = self._settings.horizon

    # -- learning from what happened ----------------------------------------------------------------

    def _look(self) -> WorldState:
        """The world as it is now, with what its things are believed to be good for."""
        return self._world.update(self._grounding.perceive(self._environment.observe()))

    def _ground(self, state: WorldState) -> Sequence[GroundRule]:
        return self._grounding.ground(state).rules

    def _learn(
        self, action: GroundAction, worked: bool, reason: FailureReason, rules: Sequence[GroundRule]
    ) -> None:
        event: Event | None = None
        if self._heuristics.reliability:
            event = self.state.reliability.record(action, worked, reason, priors(rules)[action])
        elif not worked and self._heuristics.adaptability:
            event = self.state.adaptation.record(action, rules)
        if event is not None:
            self.state.events.append(event)

    def _judge(self, action: GroundAction, before: WorldState, after: WorldState) -> bool:
        rule = covering_rule(self._ground(before), action, before.atoms())
        return action_worked(rule, before.atoms(), after.atoms())

    # -- telling ------------------------------------------------------------------------------------

    def _step(
        self,
        number: int,
        events: Sequence[Event],
        before: WorldState,
        plan: PlanResult | None,
        result: SkillResult | None,
        worked: bool | None,
        after: WorldState,
    ) -> Step:
        reason = FailureReason.NONE
        if result is not None and not worked:
            changed = before.atoms() != after.atoms()
            reason = result.reason
            if reason is FailureReason.NONE:
                reason = FailureReason.UNEXPECTED_EFFECT if changed else FailureReason.NO_EFFECT
        return Step(
            number=number,
            before=before,
            subgoal=self.state.index + 1,
            goal=self._goal,
            horizon=self.state.horizon,
            events=tuple(events),
            plan=plan,
            action=plan.action if plan and result is not None else None,
            outcome=None if worked is None else Outcome.SUCCESS if worked else Outcome.FAILURE,
            reason=reason,
            effect=dict(sorted(result.effect.items())) if result else {},
            after=after,
            probabilities=self._beliefs(plan, before),
        )

    def _beliefs(self, plan: PlanResult | None, world: WorldState) -> tuple[Belief, ...]:
        """What the plan was made with: to be told before the robot learns from what came of it."""
        if plan is None:
            return ()
        reliability = self.state.reliability if self._heuristics.reliability else None
        return beliefs(plan.actions, self._grounding.ground(world), self.state.adaptation, reliability)

    def _result(self, end: EndReason, world: WorldState) -> EpisodeResult:
        state, report = self.state, None
        if end is not EndReason.GOAL_REACHED:
            report = explain_failure(
                end,
                state.index + 1,
                self._goal,
                world.atoms(),
                self._ground(world),
                state.tried,
                state.horizon,
                absent_entities(self._goal, [entity.name for entity in world.entities]),
            )
        return EpisodeResult(report is None, end, state.good, state.total, report, world)
