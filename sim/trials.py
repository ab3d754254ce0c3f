"""What the robot is tried with: single skills, whole tasks and scenarios, each a function of hand and seed.

Tests take some of them, `benchmarks/robot.py` counts them all. Whether a trial is good is measured on the
poses and contacts of the simulator, never taken from what a skill says of itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cognitive_arch.demos import load_demos
from cognitive_arch.domain import Placement, Scene, load_domain
from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.runlog.store import RunStore
from cognitive_arch.runs import run_task
from cognitive_arch.scenes import load_scene
from cognitive_arch.session import RunConfig
from sim.environment import DrakeEnvironment
from sim.hands import Posture

MOVED = 0.10  # m that a tool has to move an object
TAPPED, STILL, LIFTED = 0.025, 0.010, 0.05  # m
SIDEWAYS = 0.5  # m aside per metre along the course, at most
UPRIGHT = math.cos(0.1)
HAND_NAMES = {"left": "LeftHand", "right": "RightHand"}
HAND_PAIRS = {
    "left": ("LeftHand", "LeftHand"),
    "right": ("RightHand", "RightHand"),
    "mixed": ("LeftHand", "RightHand"),
}


@dataclass(frozen=True)
class Trial:
    """How one trial went: was it good, what was said, and what was measured, if it is a number."""

    ok: bool
    said: tuple[str, ...]
    measured: float | None = None


@dataclass(frozen=True)
class TrialKind:
    """A kind of trial: `run` takes hands, seed and jitter (m); `wanted` says how many should be good."""

    run: Callable[[str, int, float], Trial]
    wanted: str
    seeds: int = 20
    jitter: float = 0.02
    hands: tuple[str, ...] = ("left", "right")
    unit: str = field(default="cm", kw_only=True)


@lru_cache(maxsize=4)
def environment(scene: str, mirror: bool, jitter: float) -> DrakeEnvironment:
    """An environment for a scene, or for its mirror image, used again by the next trial."""
    loaded = load_scene(scene)
    return DrakeEnvironment(load_domain(loaded.domain), mirrored(loaded) if mirror else loaded, jitter=jitter)


def mirrored(scene: Scene) -> Scene:
    """The scene with left and right swapped, so that what is easy for one hand is so for the other."""
    places = {
        name: place.model_copy(
            update={"position": (place.position[0], -place.position[1]), "yaw": -place.yaw}
        )
        for name, place in scene.objects.items()
    }
    return scene.model_copy(update={"objects": places})


def do(world: DrakeEnvironment, *calls: tuple[str, ...]) -> list[str]:
    """Carry out actions, each a name and its arguments; returns what each said."""
    return [str(world.execute(GroundAction(call[0], call[1:])).reason) for call in calls]


# -- single skills ------------------------------------------------------------------------------------


def grasp_trial(hand: str, seed: int, jitter: float) -> Trial:
    """Is the ham in the hand, and still there after a second?"""
    world, name = environment("simple", False, jitter), HAND_NAMES[hand]
    world.reset(seed)
    said = do(world, ("graspWith", "Ham", name))
    world.settle(1.0)
    return Trial(world.robot.truth.held(name) == "Ham", tuple(said))


def put_trial(hand: str, seed: int, jitter: float) -> Trial:
    """Does the ham lie on the bun, a second after it was put there?"""
    world, name = environment("simple", False, jitter), HAND_NAMES[hand]
    world.reset(seed)
    said = do(world, ("graspWith", "Ham", name), ("putOnWith", "Ham", "Bun-bottom", name))
    world.settle(1.0)
    return Trial("Bun-bottom" in world.robot.truth.supports("Ham"), tuple(said))


def drop_trial(hand: str, seed: int, jitter: float) -> Trial:
    """Does the ham lie flat on the table, touching nothing else, where the hand could take it again?"""
    world, name = environment("simple", False, jitter), HAND_NAMES[hand]
    world.reset(seed)
    said = do(world, ("graspWith", "Ham", name), ("dropWith", "Ham", name))
    world.settle(1.0)
    touching = {b for a, b in world.world.contacts() if a == "Ham"}
    up = float(world.world.pose("Ham").rotation().matrix()[2, 2])
    again = {obj.name: obj.reachable_with for obj in world.observe().objects}["Ham"]
    return Trial(touching == {"table"} and up > UPRIGHT and name in again and said[-1] == "none", tuple(said))


def tool_trial(verb: str, tool: str, obj: str, hand: str, seed: int, jitter: float) -> Trial:
    """Did the object come 10 cm closer (pull), or go as far away (push), the tool staying in the hand?

    In the complex scene, or in its mirror image where the tool lies far from the hand.
    """
    name = HAND_NAMES[hand]
    far = (name == "LeftHand") == (load_scene("complex").objects[tool].position[1] > 0)
    world = environment("complex", far, jitter)
    world.reset(seed)
    said = do(world, ("graspWith", tool, name))
    before = world.world.pose(obj).translation()[0]
    said += do(world, (verb, obj, tool, name))
    moved = (world.world.pose(obj).translation()[0] - before) * (1 if verb == "pull" else -1)
    kept = world.robot.truth.held(name) == tool
    said += [f"{100 * moved:.1f} cm", "kept" if kept else "tool lost"]
    return Trial(moved >= MOVED and kept, tuple(said), 100 * moved)


BARE_COURSES: dict[str, tuple[float, float] | None] = {  # which way (x, y) the object is to move, if it is
    "tapFromLeft": (0.0, 1.0),
    "tapFromRight": (0.0, -1.0),
    "push": (-1.0, 0.0),
    "pull": (1.0, 0.0),
    "touch": None,
    "lift": None,
}
BARE_OBJECTS = ("Bun-bottom", "Ham", "Cheese")  # in turn, by the seed: high and low, round and square
BARE_PLACE = (-0.36, 0.10)  # m, x and |y| on the hand's side
BYSTANDER = Placement(position=(-0.58, 0.0))  # a tomato, not to be touched


def bare_scene(obj: str, hand: str) -> Scene:
    """One object in front of the hand, and one that is none of its business."""
    side = -1.0 if hand == "LeftHand" else 1.0
    place = Placement(position=(BARE_PLACE[0], side * BARE_PLACE[1]))
    return Scene(name="bare", objects={obj: place, "Tomato": BYSTANDER})


@lru_cache(maxsize=6)
def _bare_environment(obj: str, hand: str, jitter: float) -> DrakeEnvironment:
    return DrakeEnvironment(load_domain("sandwich"), bare_scene(obj, hand), jitter=jitter)


def bare_trial(verb: str, posture: Posture, hand: str, seed: int, jitter: float) -> Trial:
    """Did the bare hand move the object its way, or touch it only, or lift it and put it back?"""
    obj = BARE_OBJECTS[seed % len(BARE_OBJECTS)]
    return use_hand(
        _bare_environment(obj, HAND_NAMES[hand], jitter), verb, posture, obj, HAND_NAMES[hand], seed
    )


def use_hand(world: DrakeEnvironment, verb: str, posture: Posture, obj: str, hand: str, seed: int) -> Trial:
    """One trial on one object; measured is how far it moved along its course, or up, or at all (cm)."""
    world.reset(seed)
    world.set_posture(hand, posture)
    before = {name: world.world.pose(name).translation() for name in (obj, "Tomato")}
    result = world.execute(GroundAction(verb, (obj, hand)))
    world.settle(0.3)
    dx, dy, _ = world.world.pose(obj).translation() - before[obj]
    aside = math.dist(world.world.pose("Tomato").translation(), before["Tomato"])
    course, fine = BARE_COURSES[verb], result.reason is FailureReason.NONE
    if course is not None:
        measured = dx * course[0] + dy * course[1]
        across = abs(dx * course[1] - dy * course[0])
        ok = measured >= TAPPED and across <= SIDEWAYS * measured
    elif verb == "lift":
        measured = result.effect.get("lift", 0.0)
        ok = fine and measured >= LIFTED and math.hypot(dx, dy) <= STILL
    else:
        measured = math.hypot(dx, dy)
        ok = fine and measured <= STILL
    said = (obj, str(result.reason), f"{100 * dx:.1f}, {100 * dy:.1f} cm")
    return Trial(ok and aside < STILL, said, 100 * measured)


# -- whole tasks --------------------------------------------------------------------------------------


def sandwich(first: str, second: str) -> list[GroundAction]:
    """The four actions of a ham sandwich, the ham by one hand, the top by another."""
    return [
        GroundAction("graspWith", ("Ham", first)),
        GroundAction("putOnWith", ("Ham", "Bun-bottom", first)),
        GroundAction("graspWith", ("Bun-top", second)),
        GroundAction("putOnWith", ("Bun-top", "Ham", second)),
    ]


def stacked(world: DrakeEnvironment) -> bool:
    """Whether contact and pose say that the sandwich is there."""
    supports = world.robot.truth.supports
    return "Bun-bottom" in supports("Ham") and "Ham" in supports("Bun-top")


def attempt(world: DrakeEnvironment, seed: int, hands: tuple[str, str]) -> tuple[bool, list[str]]:
    """The four actions without a planner: is the sandwich there afterwards, and what each action said."""
    world.reset(seed)
    reasons = [str(world.execute(action).reason) for action in sandwich(*hands)]
    world.settle(1.0)
    return stacked(world), reasons


def run_logged(sentence: str, config: RunConfig) -> tuple[dict[str, Any], list[str]]:
    """One whole run: its result, and the kinds of events that its log tells of."""
    with TemporaryDirectory() as folder:
        result = run_task(sentence, config, Path(folder))
        with RunStore(Path(folder)) as store:
            steps = store.steps(result["run_id"])
    return result, [event["kind"] for step in steps for event in step["events"]]


def task_trial(sentence: str, scene: str, _: str, seed: int, jitter: float) -> Trial:
    """From the sentence to the goal, as `cogarch run` does it; what is measured are the actions."""
    config = RunConfig(scene=scene, seed=seed, jitter=jitter, record=False)
    result, _events = run_logged(sentence, config)
    return Trial(result["success"] and result["goal_holds"], _told(result), float(result["total"]))


DEMO_EVENTS = {  # what the log of a demo must tell of, besides its end
    "out-of-reach": (),
    "sabotage": ("goal_maintenance",),
    "slip": ("adaptability", "creativity"),
    "missing": ("horizon_extended",),
    "missing-spare": ("creativity",),
}


def demo_trial(name: str, _: str, seed: int, jitter: float) -> Trial:
    """Does a named scenario end as the thesis says, and does the log say why?"""
    demo = load_demos().find(name)
    config = demo.model_copy(update={"jitter": jitter}).config(seed=seed, record=False)
    result, events = run_logged(demo.sentence, config)
    tools = [a for a in result["actions"] if a["action"] == "pull"]
    told = set(DEMO_EVENTS[name]) <= set(events) and (name != "out-of-reach" or bool(tools))
    explained = demo.succeeds or bool(result["explanation"])
    ok = result["success"] is demo.succeeds is result["goal_holds"] and told and explained
    return Trial(ok, (*_told(result), *sorted(set(events))), float(result["total"]))


def _told(result: dict[str, Any]) -> tuple[str, ...]:
    return (
        str(result["reason"]),
        *(f"{a['action']}({','.join(a['args'])}) {a['reason']}" for a in result["actions"]),
    )


_ALL = ("planned",)
TRIALS: dict[str, TrialKind] = {
    "grasp": TrialKind(grasp_trial, ">= 19"),
    "put": TrialKind(put_trial, ">= 19"),
    "drop": TrialKind(drop_trial, "20"),
    "pull-rake": TrialKind(partial(tool_trial, "pull", "Rake", "Ham"), ">= 18"),
    "push-rake": TrialKind(partial(tool_trial, "push", "Rake", "Ham"), ">= 18"),
    "push-stick": TrialKind(partial(tool_trial, "push", "Stick", "Ham"), ">= 18"),
    "tapFromLeft": TrialKind(partial(bare_trial, "tapFromLeft", Posture.STRAIGHT), ">= 19"),
    "tapFromRight": TrialKind(partial(bare_trial, "tapFromRight", Posture.STRAIGHT), ">= 19"),
    "push-hand": TrialKind(partial(bare_trial, "push", Posture.STRAIGHT), ">= 19"),
    "pull-straight": TrialKind(partial(bare_trial, "pull", Posture.STRAIGHT), "few"),
    "pull-bent": TrialKind(partial(bare_trial, "pull", Posture.BENT), "most"),
    "pull-arched": TrialKind(partial(bare_trial, "pull", Posture.ARCHED), "most"),
    "touch": TrialKind(partial(bare_trial, "touch", Posture.STRAIGHT), ">= 19"),
    "lift": TrialKind(partial(bare_trial, "lift", Posture.STRAIGHT), ">= 19"),
    "simple": TrialKind(
        partial(task_trial, "make a ham sandwich", "simple"), ">= 19, 20 s", hands=_ALL, unit="actions"
    ),
    "complex": TrialKind(
        partial(task_trial, "make a ham sandwich", "complex"),
        ">= 17, 45 s",
        jitter=0.01,
        hands=_ALL,
        unit="actions",
    ),
    "four-layers": TrialKind(
        partial(task_trial, "make a sandwich with ham, cheese and tomato", "kitchen"),
        ">= 8",
        seeds=10,
        jitter=0.01,
        hands=_ALL,
        unit="actions",
    ),
    **{
        f"demo-{name}": TrialKind(
            partial(demo_trial, name), "10", seeds=10, jitter=0.01, hands=_ALL, unit="actions"
        )
        for name in DEMO_EVENTS
    },
}
"""Everything there is to try, by name, in the order of the table."""
