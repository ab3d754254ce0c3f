"""Learning how reliable the robot is, and deciding by expected cost."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cognitive_arch.errors import ConfigError
from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.execution.episode import CycleSettings, CycleState
from cognitive_arch.execution.explain import EndReason
from cognitive_arch.execution.heuristics import EventKind, Heuristics
from cognitive_arch.execution.reliability import Capability, Reliability, ReliabilitySettings, capability_of
from cognitive_arch.execution.weighing import Weighing
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import State
from tests.conftest import action, literals
from tests.execution.test_cycle import episode, kinds

TAKE_LEFT, TAKE_RIGHT = action("graspWith(Ham,LeftHand)"), action("graspWith(Ham,RightHand)")
attempts = st.lists(st.tuples(st.booleans(), st.booleans()), max_size=30)


def after(*tries: tuple[str, bool], settings: ReliabilitySettings = ReliabilitySettings()) -> Reliability:
    learned = Reliability(settings)
    for text, worked in tries:
        reason = FailureReason.NONE if worked else FailureReason.NOISE
        learned.record(action(text), worked, reason, 0.9)
    return learned


def test_a_capability_is_a_kind_of_action_and_an_arm() -> None:
    assert capability_of(TAKE_LEFT) == Capability("graspWith", "LeftHand")
    assert capability_of(action("pull(Ham,Rake,RightHand)")) == Capability("pull", "RightHand")
    assert capability_of(action("wait()")) == Capability("wait", "")


def test_before_the_first_attempt_the_rule_is_believed() -> None:
    assert Reliability().chance(TAKE_LEFT, 0.9) == pytest.approx(0.9)


@given(attempts, st.floats(0.05, 1.0))
def test_belief_stays_a_probability_and_moves_with_what_is_seen(
    tries: list[tuple[bool, bool]], prior: float
) -> None:
    learned = Reliability()
    for left, worked in tries:
        mine = TAKE_LEFT if left else TAKE_RIGHT
        before = learned.chance(mine, prior)
        learned.record(mine, worked, FailureReason.NOISE, prior)
        now = learned.chance(mine, prior)
        assert 0 < now <= 1
        assert now >= before if worked else now < before


def test_all_objects_share_what_was_learned() -> None:
    learned = after(("graspWith(Ham,LeftHand)", False), ("graspWith(Ham,LeftHand)", False))
    assert learned.chance(action("graspWith(Bun-top,LeftHand)"), 0.9) < 0.5
    assert learned.chance(action("putOnWith(Ham,Bun-bottom,LeftHand)"), 0.7) == pytest.approx(0.7)


def test_the_other_arm_is_doubted_less() -> None:
    learned = after(("graspWith(Ham,LeftHand)", False))
    left, right = (learned.chance(take, 0.9) for take in (TAKE_LEFT, TAKE_RIGHT))
    assert left < right < 0.9


@pytest.mark.parametrize("reason", [FailureReason.BLOCKED, FailureReason.OUT_OF_REACH])
def test_what_stands_in_the_way_of_one_action_says_nothing_of_others(reason: FailureReason) -> None:
    learned = Reliability()
    event = learned.record(TAKE_LEFT, False, reason, 0.9)
    assert event is not None
    assert str(reason) in event.why
    assert learned.chance(TAKE_LEFT, 0.9) < 0.2
    assert learned.chance(action("graspWith(Bun-top,LeftHand)"), 0.9) == pytest.approx(0.9)


def test_it_survives_a_power_cut() -> None:
    learned = after(("graspWith(Ham,LeftHand)", False), ("pull(Ham,Rake,RightHand)", True))
    learned.record(TAKE_RIGHT, False, FailureReason.BLOCKED, 0.9)
    again = Reliability.from_json(json.loads(json.dumps(learned.to_json())), ReliabilitySettings())
    assert again == learned


GOALS = (
    literals("inHand(Ham,LeftHand)", "not isClear(LeftHand)"),
    literals("on(Ham,Bun-bottom)", "not inHand(Ham,LeftHand)", "isClear(LeftHand)"),
)


def test_sub_goals_are_kept_to_while_that_costs_nothing(start: State, ground: tuple[GroundRule, ...]) -> None:
    choice = Weighing(start, (GOALS,), ground, Reliability()).choose(0, 0)
    assert (choice.index, choice.end, choice.events) == (0, None, ())
    assert choice.plan is not None
    assert list(map(str, choice.plan.actions)) == [
        "graspWith(Ham,LeftHand)",
        "putOnWith(Ham,Bun-bottom,LeftHand)",
    ]
    assert choice.plan.goal_probability == pytest.approx(0.95 * 0.7)


def test_a_bad_arm_is_left_out_and_the_log_says_so(start: State, ground: tuple[GroundRule, ...]) -> None:
    learned = after(*[("graspWith(Ham,LeftHand)", False)] * 2)
    choice = Weighing(start, (GOALS,), ground, learned).choose(0, 0)
    assert choice.index == 1
    assert choice.plan is not None
    assert all("RightHand" in step.args for step in choice.plan.actions)
    assert [event.kind for event in choice.events] == [EventKind.RELIABILITY]
    assert "going for sub-goal 2 directly" in choice.events[0].why


def test_when_all_is_bad_help_is_cheaper(start: State, ground: tuple[GroundRule, ...]) -> None:
    tries = [(f"graspWith(Ham,{hand})", False) for hand in ("LeftHand", "RightHand")] * 12
    choice = Weighing(start, (GOALS,), ground, after(*tries)).choose(0, 0)
    assert choice.end is EndReason.HELP_ASKED
    assert "help costs 20: asking for help" in choice.events[0].why
    patient = after(*tries, settings=ReliabilitySettings(help_cost=1000))
    assert Weighing(start, (GOALS,), ground, patient).choose(0, 0).end is None


def test_without_a_way_there_is_no_plan(start: State, ground: tuple[GroundRule, ...]) -> None:
    choice = Weighing(start, ((literals("on(Ham,Cheese)"),),), ground, Reliability()).choose(0, 0)
    assert (choice.plan, choice.end) == (None, EndReason.NO_PLAN)


# -- whole episodes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("scene", "actions"), [("simple", 4), ("complex", 7), ("kitchen", 4)])
def test_without_noise_it_costs_nothing(scene: str, actions: int) -> None:
    result, steps, _ = episode(scene=scene, heuristics="reliability")
    assert (result.success, result.good, result.total) == (True, actions, actions)
    assert EventKind.RELIABILITY not in kinds(steps)


def test_a_useless_left_arm_is_given_up_for_good() -> None:
    result, steps, world = episode(heuristics="reliability", broken=frozenset({"LeftHand"}))
    assert result.success
    assert sum("LeftHand" in call for call in world.log) <= 2
    assert EventKind.RELIABILITY in kinds(steps)


def test_a_useless_robot_asks_for_help() -> None:
    result, steps, _ = episode(heuristics="reliability", broken=frozenset({"graspWith"}))
    assert (result.success, result.reason) == (False, EndReason.HELP_ASKED)
    assert result.total < 20
    assert "asking for help" in steps[-1].events[-1].why
    assert result.failure is not None
    assert "graspWith(Ham,LeftHand)" in str(result.failure)


def test_what_is_missing_is_told() -> None:
    result, *_ = episode(
        heuristics="reliability",
        meddle=lambda env, n: env._take_out("Bun-top") if n == 1 else None,
    )
    assert result.reason in (EndReason.MISSING_OBJECT, EndReason.NO_PLAN)


def test_what_is_undone_is_done_again() -> None:
    def sweep_off(env: object, n: int) -> None:
        if n == 3:
            env._things["Ham"] = env._things["Ham"].__class__((-0.45, 0.067))  # type: ignore[attr-defined]

    result, _, world = episode(heuristics="reliability", meddle=sweep_off)
    assert result.success
    assert sum("putOnWith(Ham,Bun-bottom" in call for call in world.log) == 2


def test_the_cycle_state_keeps_it() -> None:
    learned = after(("graspWith(Ham,LeftHand)", False))
    _, steps, _ = episode(heuristics="reliability")
    assert steps
    state = CycleState.from_json(
        {
            "horizon": 5, "failures": [], "outside": [], "reliability": learned.to_json(), "way": 0,
            "index": 0, "reached": [], "tried": [], "good": 0, "total": 1, "events": [],
        },
        CycleSettings(),
    )  # fmt: skip
    assert state.to_json()["reliability"] == learned.to_json()


def test_it_takes_the_place_of_two_others() -> None:
    assert str(Heuristics.parse("reliability")) == "reliability"
    assert str(Heuristics.parse("reliability+goal_maintenance")) == "goal_maintenance,reliability"
    assert not Heuristics.parse("all").reliability
    with pytest.raises(ConfigError, match="takes the place of"):
        Heuristics.parse("reliability,creativity")
