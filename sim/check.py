"""Success rate of the sandwich by hand, over jittered scenes: `python -m sim.check --hand left`."""

from __future__ import annotations

import argparse
import time

from cognitive_arch.domain import load_domain, load_scene
from cognitive_arch.relational.symbols import GroundAction
from sim.environment import DrakeEnvironment

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


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--jitter", type=float, default=0.02, help="metres")
    parser.add_argument("--hand", choices=sorted(HAND_PAIRS), action="append")
    options = parser.parse_args()
    scene = load_scene("simple")
    environment = DrakeEnvironment(load_domain(scene.domain), scene, jitter=options.jitter)
    print("hand   sandwiches  CPU s each")
    for hand in options.hand or sorted(HAND_PAIRS):
        started = time.process_time()
        results = [attempt(environment, seed, HAND_PAIRS[hand]) for seed in range(options.seeds)]
        spent = (time.process_time() - started) / options.seeds
        print(f"{hand:<6} {sum(ok for ok, _ in results):>4} of {options.seeds:<4} {spent:>8.1f}")
        for seed, (ok, reasons) in enumerate(results):
            if not ok:
                print(f"       seed {seed}: {', '.join(reasons)}")


if __name__ == "__main__":
    main()
