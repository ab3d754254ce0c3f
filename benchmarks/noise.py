"""How often single actions fail in Drake at a noise level: `python -m benchmarks.noise [--jobs 2]`.

A level is meant to be that fraction. Every trial is in a fresh scene: with the ham of `simple` (grasp; put,
where the grasp worked), with the rake or the stick of `complex` in a noiseless hand (pull, push). In whole
episodes more fails, because what was knocked over stays so.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache, partial

from cognitive_arch.domain import load_domain
from cognitive_arch.execution.environment import Outcome
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.scenes import load_scene
from sim.environment import DrakeEnvironment

JITTER = 0.02  # m
LEVELS = (0.1, 0.25, 0.5, 0.75, 0.95)
HAND = "LeftHand"
SWEEPS = {"pull": ("Rake", "RightHand"), "push": ("Stick", "LeftHand")}
WHAT = ("grasp", *SWEEPS)
"""What is tried; a grasp is followed by a put."""


@lru_cache(maxsize=2)
def environment(scene: str, capability: str, level: float) -> DrakeEnvironment:
    """The scene, with noise of one capability."""
    loaded = load_scene(scene)
    return DrakeEnvironment(load_domain(loaded.domain), loaded, noise={capability: level}, jitter=JITTER)


def attempts(what: str, level: float, seed: int) -> list[tuple[str, bool]]:
    """The attempts of one trial by name, and whether they worked."""
    if what == "grasp":
        world = environment("simple", "left", level)
        world.reset(seed)
        grasped = world.execute(GroundAction("graspWith", ("Ham", HAND))).outcome is Outcome.SUCCESS
        found = [("grasp", grasped)]
        if grasped:
            put = world.execute(GroundAction("putOnWith", ("Ham", "Bun-bottom", HAND)))
            found.append(("put", put.outcome is Outcome.SUCCESS))
        return found
    tool, hand = SWEEPS[what]  # which lies on this hand's side
    world = environment("complex", what, level)
    world.reset(seed)
    if world.execute(GroundAction("graspWith", (tool, hand))).outcome is not Outcome.SUCCESS:
        return []
    return [(what, world.execute(GroundAction(what, ("Ham", tool, hand))).outcome is Outcome.SUCCESS)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Count how often single actions fail at a noise level.")
    parser.add_argument("--what", default=",".join(WHAT), help=f"a comma list of {', '.join(WHAT)}")
    parser.add_argument("--seeds", type=int, default=40, help="trials per level")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(arguments)
    for what in options.what.split(","):
        if what not in WHAT:
            parser.error(f"unknown action '{what}'; valid: {', '.join(WHAT)}")
    print(f"{'action':<8}{'level':>6}   failed")
    with ProcessPoolExecutor(options.jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for what in options.what.split(","):
            for level in LEVELS:
                tried, failed = Counter[str](), Counter[str]()
                for trial in pool.map(partial(attempts, what, level), range(options.seeds), chunksize=4):
                    tried.update(name for name, _ in trial)
                    failed.update(name for name, good in trial if not good)
                for name, count in tried.items():
                    share = failed[name] / count
                    print(f"{name:<8}{level:>6}   {share:.2f}   ({failed[name]} of {count})", flush=True)


if __name__ == "__main__":
    main()
