"""Success rates over jittered scenes: `python -m sim.check --what sandwich --what pull --hand left`.

Bare hands: `python -m sim.check --what tapFromLeft --hand right --posture bent`.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from cognitive_arch.domain import Placement, Scene, load_domain, load_scene
from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.session import RunConfig, run_task
from sim.environment import DrakeEnvironment
from sim.hands import Posture

MOVED = 0.10  # m that a tool has to move an object
HAND_PAIRS = {
    "left": ("LeftHand", "LeftHand"),
    "right": ("RightHand", "RightHand"),
    "mixed": ("LeftHand", "RightHand"),
}


def sandwich(first: str, second: str) -> list[GroundAction]:
    """The four actions of a ham sandwich, the ham by one hand, the top by another."""
    return [
        GroundAction("graspWith", ("Ham", first)),
        GroundAction("putOnWith", ("Ham", "Bun-bottom", first)),
        GroundAction("graspWith", ("Bun-top", second)),
        GroundAction("putOnWith", ("Bun-top", "Ham", second)),
    ]


def stacked(environment: DrakeEnvironment) -> bool:
    """Whether contact and pose say that the sandwich is there."""
    below = {obj.name: obj.below for obj in environment.observe().objects}
    return "Bun-bottom" in below.get("Ham", ()) and "Ham" in below.get("Bun-top", ())


def attempt(environment: DrakeEnvironment, seed: int, hands: tuple[str, str]) -> tuple[bool, list[str]]:
    """One episode: is the sandwich there one simulated second afterwards, and what each action said."""
    environment.reset(seed)
    reasons = [str(environment.execute(action).reason) for action in sandwich(*hands)]
    environment.settle(1.0)
    return stacked(environment), reasons


def mirrored(scene: Scene) -> Scene:
    """The scene with left and right swapped, so that what is easy for one hand is so for the other."""
    places = {
        name: place.model_copy(
            update={"position": (place.position[0], -place.position[1]), "yaw": -place.yaw}
        )
        for name, place in scene.objects.items()
    }
    return scene.model_copy(update={"objects": places})


@dataclass(frozen=True)
class ToolTrial:
    """Take `tool`, do `verb` to `obj`; `away` says which way it is to move."""

    verb: str
    tool: str
    obj: str
    away: bool


TOOL_TRIALS = {
    "pull": ToolTrial("pull", "Rake", "Ham", False),
    "pull-far": ToolTrial("pull", "Rake", "Bun-top", False),
    "push": ToolTrial("push", "Rake", "Bun-bottom", True),
    "push-stick": ToolTrial("push", "Stick", "Bun-bottom", True),
}


@dataclass(frozen=True)
class BareTrial:
    """Do `verb` with the bare hand; `course` says which way (x, y) the object is to move, if it is."""

    verb: str
    course: tuple[float, float] | None = None


BARE_TRIALS = {
    "tapFromLeft": BareTrial("tapFromLeft", (0.0, 1.0)),
    "tapFromRight": BareTrial("tapFromRight", (0.0, -1.0)),
    "push-hand": BareTrial("push", (-1.0, 0.0)),
    "pull-hand": BareTrial("pull", (1.0, 0.0)),
    "touch": BareTrial("touch"),
    "lift": BareTrial("lift"),
}
BARE_OBJECTS = ("Bun-bottom", "Ham", "Cheese")  # in turn, by the seed: high and low, round and square
BARE_PLACE = (-0.36, 0.10)  # m, x and |y| on the hand's side
BYSTANDER = Placement(position=(-0.58, 0.0))  # a tomato, not to be touched
TAPPED, STILL, LIFTED = 0.025, 0.010, 0.05  # m
SIDEWAYS = 0.5  # m aside per metre along the course, at most


def bare_scene(obj: str, hand: str) -> Scene:
    """One object in front of the hand, and one that is none of its business."""
    side = -1.0 if hand == "LeftHand" else 1.0
    place = Placement(position=(BARE_PLACE[0], side * BARE_PLACE[1]))
    return Scene(name="bare", objects={obj: place, "Tomato": BYSTANDER}, events=())


def use_hand(
    environment: DrakeEnvironment, trial: BareTrial, obj: str, hand: str, posture: Posture, seed: int
) -> tuple[bool, list[str], float]:
    """One trial: did what is measured fit the skill; what it said; and how far it moved the object along
    its course (lifted it; displaced it by touching), metres."""
    environment.reset(seed)
    environment.set_posture(hand, posture)
    before = {name: environment.world.pose(name).translation() for name in (obj, "Tomato")}
    result = environment.execute(GroundAction(trial.verb, (obj, hand)))
    environment.settle(0.3)
    dx, dy, _ = environment.world.pose(obj).translation() - before[obj]
    aside = math.dist(environment.world.pose("Tomato").translation(), before["Tomato"])
    if trial.course is not None:
        measured = dx * trial.course[0] + dy * trial.course[1]
        across = abs(dx * trial.course[1] - dy * trial.course[0])
        ok = measured >= TAPPED and across <= SIDEWAYS * measured
        said = f"{100 * measured:.1f} cm, {100 * across:.1f} cm aside"
    elif trial.verb == "lift":
        measured = result.effect.get("lift", 0.0)
        ok = measured >= LIFTED and math.hypot(dx, dy) <= STILL and result.reason is FailureReason.NONE
        said = f"{100 * measured:.1f} cm up, set down {1000 * math.hypot(dx, dy):.1f} mm away"
    else:
        measured = math.hypot(dx, dy)
        ok = measured <= STILL and result.reason is FailureReason.NONE
        said = f"{1000 * measured:.1f} mm"
    return ok and aside < STILL, [obj, str(result.reason), said], measured


def check_bare(
    what: str, hand: str, posture: Posture, seeds: int, jitter: float
) -> tuple[list[tuple[bool, list[str]]], str]:
    """Trials with one hand on one object after the other; with the mean of what was measured."""
    environments = {
        obj: DrakeEnvironment(load_domain("sandwich"), bare_scene(obj, hand), jitter=jitter)
        for obj in BARE_OBJECTS
    }
    results, sizes = [], []
    for seed in range(seeds):
        obj = BARE_OBJECTS[seed % len(BARE_OBJECTS)]
        ok, said, measured = use_hand(environments[obj], BARE_TRIALS[what], obj, hand, posture, seed)
        results.append((ok, said))
        sizes.append(100 * measured)
    return results, f"mean {sum(sizes) / seeds:.1f} cm, from {min(sizes):.1f} to {max(sizes):.1f}"


def use_tool(environment: DrakeEnvironment, trial: ToolTrial, hand: str, seed: int) -> tuple[bool, list[str]]:
    """One trial: did the object move at least 10 cm the right way, the tool still being in the hand, and
    what each action said."""
    environment.reset(seed)
    calls = [
        GroundAction("graspWith", (trial.tool, hand)),
        GroundAction(trial.verb, (trial.obj, trial.tool, hand)),
    ]
    results = [environment.execute(call) for call in calls]
    moved = results[-1].effect.get("displacement_x", 0.0) * (-1 if trial.away else 1)
    kept = environment.robot.perception.held(hand) == trial.tool
    said = [str(result.reason) for result in results]
    return moved >= MOVED and kept, [*said, f"{100 * moved:.1f} cm", "kept" if kept else "tool lost"]


def check_tools(what: str, hand: str, seeds: int, jitter: float) -> list[tuple[bool, list[str]]]:
    """Trials with one hand on the complex scene, or on its mirror image where the tool lies far from it."""
    trial, scene = TOOL_TRIALS[what], load_scene("complex")
    side = math.copysign(1.0, scene.objects[trial.tool].position[1])
    if (hand == "LeftHand") == (side > 0):
        scene = mirrored(scene)
    environment = DrakeEnvironment(load_domain(scene.domain), scene, jitter=jitter)
    return [use_tool(environment, trial, hand, seed) for seed in range(seeds)]


def check_sandwich(hand: str, seeds: int, jitter: float) -> list[tuple[bool, list[str]]]:
    """Sandwiches on the simple scene with the hands of that name."""
    scene = load_scene("simple")
    environment = DrakeEnvironment(load_domain(scene.domain), scene, jitter=jitter)
    return [attempt(environment, seed, HAND_PAIRS[hand]) for seed in range(seeds)]


def check_complex(seeds: int, jitter: float) -> list[tuple[bool, list[str]]]:
    """The whole way from the sentence to the sandwich on the complex scene."""
    results = []
    for seed in range(seeds):
        config = RunConfig(scene="complex", seed=seed, jitter=jitter, record=False)
        with TemporaryDirectory() as folder:
            done = run_task("make a ham sandwich", config, Path(folder))
        results.append((bool(done["success"]), [str(a["reason"]) for a in done["actions"]]))
    return results


def report(what: str, hand: str, seeds: int, jitter: float, posture: Posture = Posture.STRAIGHT) -> None:
    """Run one row of the table and print it."""
    started, more = time.process_time(), ""
    if what == "complex":
        results = check_complex(seeds, jitter)
    elif what == "sandwich":
        results = check_sandwich(hand, seeds, jitter)
    elif what in BARE_TRIALS:
        results, more = check_bare(what, f"{hand.capitalize()}Hand", posture, seeds, jitter)
        more = f"  {posture}: {more}"
    else:
        results = check_tools(what, f"{hand.capitalize()}Hand", seeds, jitter)
    spent = (time.process_time() - started) / seeds
    done = sum(ok for ok, _ in results)
    print(f"{what:<12} {hand:<6} {done:>4} of {seeds:<4} {spent:>8.1f}{more}", flush=True)
    for seed, (ok, said) in enumerate(results):
        if not ok:
            print(f"             seed {seed}: {', '.join(said)}", flush=True)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--jitter", type=float, default=0.02, help="metres")
    parser.add_argument("--hand", choices=sorted(HAND_PAIRS), action="append")
    parser.add_argument(
        "--what", choices=["sandwich", *TOOL_TRIALS, *BARE_TRIALS, "complex"], action="append"
    )
    parser.add_argument("--posture", choices=[str(p) for p in Posture], action="append")
    options = parser.parse_args()
    print("what         hand   done        CPU s each", flush=True)
    for what in options.what or ["sandwich"]:
        hands = options.hand or (sorted(HAND_PAIRS) if what == "sandwich" else ["left", "right"])
        for hand in ["planned"] if what == "complex" else hands:
            if what != "sandwich" and hand == "mixed":
                continue
            for posture in options.posture or ["straight"] if what in BARE_TRIALS else ["straight"]:
                report(what, hand, options.seeds, options.jitter, Posture(posture))


if __name__ == "__main__":
    main()
