"""Success rates over jittered scenes: `python -m sim.check --what sandwich --what pull --hand left`."""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from cognitive_arch.domain import Scene, load_domain, load_scene
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.session import RunConfig, run_task
from sim.environment import DrakeEnvironment

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


def report(what: str, hand: str, seeds: int, jitter: float) -> None:
    """Run one row of the table and print it."""
    started = time.process_time()
    if what == "complex":
        results = check_complex(seeds, jitter)
    elif what == "sandwich":
        results = check_sandwich(hand, seeds, jitter)
    else:
        results = check_tools(what, f"{hand.capitalize()}Hand", seeds, jitter)
    spent = (time.process_time() - started) / seeds
    print(f"{what:<10} {hand:<6} {sum(ok for ok, _ in results):>4} of {seeds:<4} {spent:>8.1f}", flush=True)
    for seed, (ok, said) in enumerate(results):
        if not ok:
            print(f"           seed {seed}: {', '.join(said)}", flush=True)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--jitter", type=float, default=0.02, help="metres")
    parser.add_argument("--hand", choices=sorted(HAND_PAIRS), action="append")
    parser.add_argument("--what", choices=["sandwich", *TOOL_TRIALS, "complex"], action="append")
    options = parser.parse_args()
    print("what       hand   done        CPU s each", flush=True)
    for what in options.what or ["sandwich"]:
        hands = options.hand or (sorted(HAND_PAIRS) if what == "sandwich" else ["left", "right"])
        for hand in ["planned"] if what == "complex" else hands:
            if what == "sandwich" or hand != "mixed":
                report(what, hand, options.seeds, options.jitter)


if __name__ == "__main__":
    main()
