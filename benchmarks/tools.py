"""Which tool is taken, and how many actions it takes: numbers from shapes beside the rules' own.

    python -m benchmarks.tools --seeds 20 --backend drake
    python -m benchmarks.tools --seeds 500 --backend symbolic --noise 0.25

Each seed moves the things of the scene a little; every source of affordances gets the same seeds. The right
tool is one whose bar gets behind what is to be pulled; the first tool that is taken counts.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import numpy as np

from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.episode import Step
from cognitive_arch.execution.grounding import judge_of
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.footprint import gets_behind
from cognitive_arch.planning.registry import DEFAULT_PLANNER
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.runs import prepare
from cognitive_arch.session import Progress, RunConfig, Session, Setting
from cognitive_arch.shapes import ToolShape

SANDWICH = "make a ham sandwich"


@dataclass(frozen=True)
class Episode:
    """What came of one seed: whether the first tool was a right one, the pulls that were tried and those
    that worked, and the CPU seconds of deciding alone, per action."""

    seed: int
    success: bool
    total: int
    right_tool: bool | None
    pulls: int
    pulled: int
    cpu: float
    predicted: tuple[float, ...]


def episodes(config: RunConfig, seeds: Sequence[int], sentence: str) -> list[Episode]:
    """The task once for every seed."""
    setting = Setting.load(config.scene)
    task = setting.understand(sentence)
    found = []
    with _environment(config, setting) as environment:
        for seed in seeds:
            steps: list[Step] = []
            started = time.process_time()
            session = Session(_with_seed(config, seed), setting, environment)
            result = session.perform(task, Progress(on_step=steps.append))
            spent = time.process_time() - started
            found.append(_judged(seed, result.success, result.total, steps, setting, spent))
            print(f"{config.affordances} {found[-1]}", file=sys.stderr, flush=True)
    return found


class _DecidedError(Exception):
    """Raised to end an episode where its first action is decided."""


def choices(config: RunConfig, seeds: Sequence[int], sentence: str) -> dict[str, int]:
    """How often each action is the first that is decided on; nothing is done."""
    setting = Setting.load(config.scene)
    task = setting.understand(sentence)
    found: list[str] = []

    def decided(action: GroundAction) -> None:
        found.append(str(action))
        raise _DecidedError

    with _environment(config, setting) as environment:
        for seed in seeds:
            session = Session(_with_seed(config, seed), setting, environment)
            with suppress(_DecidedError):
                session.perform(task, Progress(on_act=decided))
            print(f"{config.affordances} {seed} {found[-1]}", file=sys.stderr, flush=True)
    return dict(Counter(found))


@contextmanager
def _environment(config: RunConfig, setting: Setting) -> Iterator[Environment]:
    environment = make_environment(
        config.backend,
        setting.domain,
        setting.scene,
        setting.rules,
        noise=config.noise,
        jitter=config.jitter,
        perception=config.perception,
        shapes_seen=judge_of(config.affordance_source) is not None,
    )
    try:
        yield environment
    finally:
        environment.close()


def _with_seed(config: RunConfig, seed: int) -> RunConfig:
    data = config.to_json() | {"seed": seed}
    return RunConfig.from_json(data)


def _judged(
    seed: int, success: bool, total: int, steps: Sequence[Step], setting: Setting, spent: float
) -> Episode:
    objects = setting.domain.objects
    taken = [
        step.action.args[0]
        for step in steps
        if step.action and step.action.name == "graspWith" and objects[step.action.args[0]].kind == "tool"
    ]
    pulls = [step for step in steps if step.action and step.action.name == "pull"]
    things = [name for name in setting.scene.objects if objects[name].kind != "tool"]
    right = None
    if taken:
        shape = objects[taken[0]].shape
        right = isinstance(shape, ToolShape) and all(gets_behind(shape, objects[n].shape) for n in things)
    told = [b.probability for s in pulls for b in s.probabilities if b.action == s.action]
    return Episode(
        seed,
        success,
        total,
        right,
        len(pulls),
        sum(step.outcome == "success" for step in pulls),
        round(spent / max(total, 1), 4),
        tuple(round(p, 3) for p in told),
    )


def summary(found: Sequence[Episode]) -> dict[str, float]:
    """Means over episodes; a failed one counts with the actions that were tried in it."""
    taken = [e.right_tool for e in found if e.right_tool is not None]
    return {
        "episodes": len(found),
        "right_tool": sum(map(bool, taken)),
        "tools_taken": len(taken),
        "success": float(np.mean([e.success for e in found])),
        "actions": float(np.mean([e.total for e in found])),
        "pulls": sum(e.pulls for e in found),
        "pulls_worked": sum(e.pulled for e in found),
        "cpu_per_action_s": float(np.mean([e.cpu for e in found])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--backend", default="symbolic")
    parser.add_argument("--scene", default="complex")
    parser.add_argument("--sentence", default=SANDWICH)
    parser.add_argument("--noise", default="0")
    parser.add_argument("--heuristics", default="all")
    parser.add_argument("--jitter", type=float, default=0.01)
    parser.add_argument("--perception", default=None)
    parser.add_argument("--affordances", default="learned,default,none")
    parser.add_argument("--choices", action="store_true", help="tell the first choices only, without acting")
    args = parser.parse_args()
    prepare(DEFAULT_PLANNER, Heuristics.parse(args.heuristics), lambda text: print(text, file=sys.stderr))
    answer: dict[str, object] = {}
    for source in args.affordances.split(","):
        config = RunConfig(
            scene=args.scene,
            backend=args.backend,
            noise=NoiseLevels.parse(args.noise),
            heuristics=Heuristics.parse(args.heuristics),
            jitter=args.jitter,
            record=False,
            perception=args.perception,
            affordances=source,
        )
        seeds = range(args.first, args.first + args.seeds)
        if args.choices:
            answer[source] = choices(config, seeds, args.sentence)
        else:
            answer[source] = summary(episodes(config, seeds, args.sentence))
    print(json.dumps(answer, indent=2))


if __name__ == "__main__":
    main()
