"""Rules get their numbers from shapes: what was learned of trials decides which tool is taken."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.affordances.judgement import Judge
from cognitive_arch.affordances.registry import Affordances
from cognitive_arch.affordances.trials import from_frame
from cognitive_arch.domain import Domain, ObjectSpec, Scene
from cognitive_arch.errors import AffordanceError
from cognitive_arch.execution.cycle import PlanningCycle
from cognitive_arch.execution.episode import EpisodeResult, Step
from cognitive_arch.execution.explain import EndReason
from cognitive_arch.execution.grounding import (
    LEARNED_ACTIONS,
    PULLS,
    AffordanceGrounding,
    RuleGrounding,
    UntoldGrounding,
)
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.execution.symbolic import SymbolicEnvironment
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.planning.registry import DEFAULT_PLANNER, make_planner
from cognitive_arch.relational.rules import GroundRule, RuleSet
from cognitive_arch.runlog.records import step_record
from cognitive_arch.scenes import domain_of, load_scene
from cognitive_arch.session import Setting
from cognitive_arch.shapes import ToolShape
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import HANDS, Observation
from cognitive_arch.world.state import WorldState
from tests.affordances.synthetic import seen_frame
from tests.conftest import action

SANDWICH = "make a ham sandwich"
HOOK = ToolShape(type="tool", length=0.33, width=0.02, bar=0.1, offset=-0.04)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of synthetic trials, as `cogarch learn networks` keeps it."""
    path = tmp_path_factory.mktemp("learned") / "model.json"
    table = from_frame(seen_frame(), "synthetic trials")
    Affordances.learn(table, "default", np.random.default_rng(0)).save(path)
    return path


@pytest.fixture(scope="module")
def judge(model: Path) -> Judge:
    return Judge.load(model)


def with_shapes(domain: Domain, shapes: Mapping[str, ToolShape]) -> Domain:
    """The domain with tools of other shapes, of which nobody told what they are good for."""
    changed = {
        name: domain.objects[name].model_copy(update={"shape": shape, "can_pull": None})
        for name, shape in shapes.items()
    }
    return domain.model_copy(update={"objects": {**domain.objects, **changed}})


def world_of(scene: Scene, domain: Domain, rules: RuleSet) -> SymbolicEnvironment:
    return SymbolicEnvironment(domain, scene, rules, shapes_seen=True)


def looked(environment: SymbolicEnvironment, grounding: RuleGrounding) -> WorldState:
    return WorldModel().update(grounding.perceive(environment.reset(0)))


def numbers(rules: tuple[GroundRule, ...]) -> dict[str, float]:
    return {str(rule.action): rule.outcomes[0].probability for rule in rules}


def episode(
    judge: Judge,
    domain: Domain,
    rules: RuleSet,
    scene: str = "complex",
    heuristics: str = "all",
    noise: str = "0",
    events: tuple[str, ...] = (),
    untold: bool = False,
) -> tuple[EpisodeResult, list[Step]]:
    """A sandwich, and what was done for it."""
    loaded = load_scene(scene)
    domain = domain.with_strangers(loaded.strangers)
    task = Setting(loaded, domain, rules).understand(SANDWICH)
    environment = SymbolicEnvironment(domain, loaded, rules, NoiseLevels.parse(noise), shapes_seen=True)
    grounding = (
        UntoldGrounding(rules, environment.skills)
        if untold
        else AffordanceGrounding(rules, environment.skills, judge)
    )
    steps: list[Step] = []
    cycle = PlanningCycle(
        environment,
        WorldModel(),
        make_planner(DEFAULT_PLANNER),
        rules,
        np.random.default_rng(0),
        heuristics=Heuristics.parse(heuristics),
        outside=[OutsideEvent.parse(event) for event in events],
        grounding=grounding,
        on_step=steps.append,
    )
    return cycle.run(task.goals, environment.reset(0), task.alternatives), steps


def pulls(steps: list[Step]) -> list[str]:
    return [step.action.args[1] for step in steps if step.action and step.action.name == "pull"]


def test_numbers_follow_from_shapes(judge: Judge, domain: Domain, rules: RuleSet) -> None:
    environment = world_of(load_scene("complex"), domain, rules)
    grounding = AffordanceGrounding(rules, environment.skills, judge)
    world = looked(environment, grounding)
    found = grounding.ground(world)
    learned, default = numbers(tuple(found.rules)), numbers(rules.ground(world.entities, environment.skills))
    assert learned["pull(Ham,Rake,LeftHand)"] > 0.75
    assert learned["pull(Ham,Stick,LeftHand)"] < 0.4
    assert learned["push(Ham,Stick,LeftHand)"] > 0.7
    assert list(learned) == list(default)
    for name, p in learned.items():
        told = action(name) in found.sources
        tools_only = {"Stick", "Rake"} <= set(action(name).args)  # no trial did that
        assert told == (action(name).name in LEARNED_ACTIONS and not tools_only)
        assert told == (p != default[name])
        assert not told or found.sources[action(name)].startswith("affordances: tool half convexity")
    for rule in found.rules:
        assert rule.noise == pytest.approx(1 - sum(o.probability for o in rule.outcomes), abs=1e-9)


def test_what_pulls_is_what_brings_closer_more_likely_than_not(
    judge: Judge, domain: Domain, rules: RuleSet
) -> None:
    shapes = {"Stick": HOOK, "Rake": ToolShape(type="tool", length=0.34, width=0.018, bar=0.0)}
    environment = world_of(load_scene("complex"), with_shapes(domain, shapes), rules)
    grounding = AffordanceGrounding(rules, environment.skills, judge)
    world = looked(environment, grounding)
    chances = numbers(tuple(grounding.ground(world).rules))
    for obj in world.objects:
        for tool in ("Stick", "Rake"):
            if obj.kind == "tool" or set(obj.reachable_with) & set(HANDS):
                assert not obj.pullable_with
            else:
                assert (tool in obj.pullable_with) == (chances[f"pull({obj.name},{tool},LeftHand)"] >= PULLS)
    ham = world.object("Ham")
    assert ham is not None
    assert ham.pullable_with == ("Stick",)


@settings(max_examples=15, deadline=None)
@given(seen=st.sets(st.sampled_from(["Ham", "Bun-top", "Rake", "Stick"])))
def test_what_was_not_seen_keeps_its_own_number(
    seen: set[str], judge: Judge, domain: Domain, rules: RuleSet
) -> None:
    """Laws: only what was seen has learned numbers, only what reaches a thing pulls it, and a second look
    at the same changes nothing."""
    environment = world_of(load_scene("complex"), domain, rules)
    first = environment.reset(0)
    objects = tuple(
        o if o.name in seen else type(o)(**{**_fields(o), "desc": (), "tooldesc": ()}) for o in first.objects
    )
    observation = Observation(first.time, objects, first.hands)
    grounding = AffordanceGrounding(rules, environment.skills, judge)
    perceived = grounding.perceive(observation)
    assert grounding.perceive(perceived) == perceived
    for obj in perceived.objects:
        assert set(obj.pullable_with) <= set(obj.reachable_with)
    for chosen in grounding.ground(WorldModel().update(perceived)).sources:
        assert {*chosen.args[:2]} <= seen


def _fields(value: Any) -> dict[str, Any]:
    return {name: getattr(value, name) for name in value.__slots__}


def test_the_choice_of_a_tool_follows_its_shape_not_its_name(
    judge: Judge, domain: Domain, rules: RuleSet
) -> None:
    result, steps = episode(judge, domain, rules)
    assert result.success
    assert set(pulls(steps)) == {"Rake"}
    shapes = {name: domain.objects[name].shape for name in ("Stick", "Rake")}
    swapped = with_shapes(domain, {"Stick": shapes["Rake"], "Rake": shapes["Stick"]})  # type: ignore[dict-item]
    result, steps = episode(judge, swapped, rules)
    assert result.success
    assert set(pulls(steps)) == {"Stick"}


def test_an_unknown_tool_is_used_without_ever_having_been_tried(
    judge: Judge, domain: Domain, rules: RuleSet
) -> None:
    assert "Crook" not in {*domain.objects, *judge.learned.things_m}
    result, steps = episode(judge, domain, rules, scene="stranger")
    assert result.success
    assert result.good == result.total
    assert set(pulls(steps)) == {"Crook"}


def test_without_the_tool_the_plan_is_another_one(judge: Judge, domain: Domain, rules: RuleSet) -> None:
    result, steps = episode(judge, domain, rules, scene="spare-tool", events=("2:remove:Rake",))
    assert steps[0].action == action(f"graspWith(Rake,{steps[0].action.args[1]})")  # type: ignore[union-attr]
    assert steps[0].plan is not None
    assert steps[1].plan is not None
    assert any("Rake" in a.args for a in steps[0].plan.actions)
    assert not any("Rake" in a.args for a in steps[1].plan.actions)
    assert result.success
    assert set(pulls(steps)) == {"Crook"}
    lost, steps = episode(judge, domain, rules, events=("2:remove:Rake",))
    assert (lost.success, lost.reason, lost.total) == (False, EndReason.NO_PLAN, 1)


def test_who_knows_nothing_of_tools_may_take_any(judge: Judge, domain: Domain, rules: RuleSet) -> None:
    environment = world_of(load_scene("complex"), domain, rules)
    world = looked(environment, UntoldGrounding(rules, environment.skills))
    assert {o.name: o.pullable_with for o in world.objects if o.pullable_with} == {
        "Bun-top": ("Rake", "Stick"),
        "Ham": ("Rake", "Stick"),
        "Tomato": ("Rake", "Stick"),
    }
    result, _ = episode(judge, domain, rules, untold=True)
    assert result.success


def test_heuristics_go_on_top_of_what_was_learned(judge: Judge, domain: Domain, rules: RuleSet) -> None:
    for heuristics, why in (("all", "adaptability: failed once"), ("reliability", "reliability: pull")):
        _, steps = episode(judge, domain, rules, heuristics=heuristics, noise="left=0,right=0,pull=1,push=0")
        told = [{b.action: b for b in step.probabilities} for step in steps]
        first = next(n for n, step in enumerate(steps) if step.action and step.action.name == "pull")
        chosen = steps[first].action
        assert chosen is not None
        before = told[first][chosen]
        after = next(found[chosen] for found in told[first + 1 :] if chosen in found)
        assert before.source.startswith("affordances: ")
        from_shapes = before.source.split("; reliability:")[0]
        assert after.source.startswith(f"{from_shapes}; {why}")
        if heuristics == "all":
            assert after.probability == pytest.approx(0.2 * before.probability)
        else:
            assert after.probability < before.probability


def test_every_step_tells_which_number_came_from_where(judge: Judge, domain: Domain, rules: RuleSet) -> None:
    _, steps = episode(judge, domain, rules)
    record = json.loads(json.dumps(step_record(steps[0])))
    told = {row["action"]: row for row in record["probabilities"]}
    assert set(record["plan"]["actions"]) <= set(told)
    hand = record["args"][1]
    assert told[f"graspWith(Rake,{hand})"] == {
        "action": f"graspWith(Rake,{hand})", "p": 0.95, "from": "default"
    }  # fmt: skip
    chosen, refused = told[f"pull(Ham,Rake,{hand})"], told[f"pull(Ham,Stick,{hand})"]
    assert chosen["p"] > refused["p"]
    assert "tool half convexity" in chosen["from"]
    assert "at (-0.52, -0.06) m" in chosen["from"]


def test_what_cannot_be_seen_cannot_be_judged_by(tmp_path: Path) -> None:
    frame = seen_frame(80).rename(columns={"m_area": "m_smell"})
    path = tmp_path / "model.json"
    learned = Affordances.learn(from_frame(frame, "trials"), "majority", np.random.default_rng(0))
    learned.save(path)
    with pytest.raises(AffordanceError, match=r"does not see: smell; valid: area, convexity"):
        Judge.load(path)


def test_a_run_is_kept_with_what_it_knew(model: Path, tmp_path: Path, cogarch: Any) -> None:
    known = tmp_path / "known.json"
    known.write_bytes(model.read_bytes())
    options = ("--scene", "stranger", "--backend", "symbolic", "--affordances", str(known))
    answer = cogarch("run", SANDWICH, *options, "--json")
    assert (answer.code, answer.json["success"]) == (0, True)
    assert answer.json["affordances"] == str(known)
    kept = cogarch("inspect", "latest", "--json").json
    fingerprint = kept["manifest"]["learned"]["fingerprint"]
    assert len(fingerprint) == 16
    assert kept["manifest"]["learned"] | {"fingerprint": ""} == {
        "model": "default", "trials": 480, "source": "synthetic trials", "fingerprint": ""
    }  # fmt: skip
    text = cogarch("inspect", "latest").out
    assert fingerprint in text
    assert "believed: pull(Ham,Crook,RightHand) works with 0." in text
    assert ", from affordances: tool half convexity" in text
    plain = cogarch("run", "pick up the ham", "--backend", "symbolic", "--json").json
    assert plain["affordances"] == "default"
    assert cogarch("inspect", "latest", "--json").json["manifest"]["learned"] is None


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("guessed", "unknown source of affordances 'guessed'; valid: default, learned, none"),
        ("nowhere.json", "there is no learned model at 'nowhere.json'"),
    ],
)
def test_a_source_that_is_not_there(source: str, why: str, cogarch: Any) -> None:
    answer = cogarch("run", SANDWICH, "--backend", "symbolic", "--affordances", source)
    assert (answer.code, answer.out) == (2, "")
    assert why in answer.err
    assert answer.err.count("\n") == 1


def test_a_stranger_is_no_thing_of_the_domain(tmp_path: Path, cogarch: Any) -> None:
    scene = load_scene("stranger")
    assert set(domain_of(scene).objects) - set(domain_of(load_scene("complex")).objects) == {"Crook"}
    assert isinstance(domain_of(scene).objects["Crook"], ObjectSpec)
    text = Path(__file__).resolve().parents[2] / "domains/sandwich/scenes/stranger.yaml"
    mine = tmp_path / "mine.yaml"
    mine.write_text(text.read_text(encoding="utf-8").replace("Crook:", "Rake:"), encoding="utf-8")
    answer = cogarch("run", SANDWICH, "--scene", str(mine), "--backend", "symbolic")
    assert answer.code == 2
    assert "Rake is no stranger: domain sandwich knows it" in answer.err
