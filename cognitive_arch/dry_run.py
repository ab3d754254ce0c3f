"""One planning call without a robot: `cogarch plan`.

The problem comes from a scene of ours or from the four files of libPRADA.
"""

from __future__ import annotations

import re
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.errors import ConfigError, RuleError, one_line, unknown
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.planning.base import ArrayPlanner, Planner, PlanResult, check_problem
from cognitive_arch.planning.compilation import warm_up
from cognitive_arch.planning.diagnosis import Verdict, diagnose
from cognitive_arch.planning.evaluation import evaluate
from cognitive_arch.planning.kernels import evaluate_sequence
from cognitive_arch.planning.prada import Prada
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.planning.registry import make_planner
from cognitive_arch.relational.libprada import load_problem
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import Goal, GroundAction, Literal, State, parse_literal
from cognitive_arch.resources import read_text
from cognitive_arch.session import Setting, Task
from cognitive_arch.world.anchoring import WorldModel

MOST_SAMPLED_ACTIONS = 20_000_000
"""Samples times horizon: more take minutes and gigabytes."""

EXAMPLE = "on(Ham,Bun-bottom), not isClear(LeftHand) (with commas in between)"
"""What literals look like, for messages."""


@dataclass(frozen=True, slots=True)
class PlanningTask:
    """What to plan: an initial state, a goal, and ground rules."""

    state: State
    goal: Goal
    rules: Sequence[GroundRule]


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """How to plan; `samples` None leaves it to the planner."""

    planner: str
    horizon: int = 5
    samples: int | None = None
    seed: int = 0
    repeat: int = 1
    evaluate: bool = False

    def __post_init__(self) -> None:
        for name, value, least in (("horizon", self.horizon, 1), ("repeat", self.repeat, 1)):
            if not least <= value <= 1000:
                raise ConfigError(f"{name} {value} is out of range; valid: {least} to 1000")
        if not 0 <= self.seed < 2**63:
            raise ConfigError(f"seed {one_line(self.seed, 30)} is out of range; valid: 0 to {2**63 - 1}")
        most = MOST_SAMPLED_ACTIONS // self.horizon
        if self.samples is not None and not 1 <= self.samples <= most:
            raise ConfigError(
                f"samples {self.samples} is out of range; valid with horizon {self.horizon}: 1 to {most}"
            )


def libprada_task(symbols: Path, rules: Path, state: Path, goal: Path) -> PlanningTask:
    """The problem in four files of libPRADA; raises `RuleError`."""
    problem = load_problem(symbols, rules, state, goal)
    return PlanningTask(problem.state, problem.goal, problem.rules)


def scene_task(
    scene: str, goal: str | None, sentence: str | None, rules: str | None = None, state: Path | None = None
) -> PlanningTask:
    """The problem of a scene as it is at first.

    The goal is what `sentence` means in the end, or literals: `goal` holds them itself or names a file
    with them. `state` is a file of literals to start from instead.
    """
    if rules is not None:
        _refuse_libprada(Path(rules))
    setting = Setting.load(scene, rules)
    if (goal is None) == (sentence is None):
        raise ConfigError('say what to plan for: either a sentence or --goal "on(Ham,Bun-bottom), ..."')
    levels = NoiseLevels()
    environment = make_environment("symbolic", setting.domain, setting.scene, setting.rules, noise=levels)
    try:
        world = WorldModel().update(environment.reset(0))
    finally:
        environment.close()
    start = world.atoms()
    if state is not None:
        text = read_text(state, "state file", RuleError)
        facts = _literals(text, str(state), setting.rules, world.entities)
        start = frozenset(literal.atom for literal in facts if literal.positive)
    ground = setting.rules.ground(world.entities)
    if sentence is not None:
        wanted = _likeliest_goal(setting.understand(sentence), start, ground)
    elif goal is not None and _is_file(goal):
        wanted = _literals(read_text(Path(goal), "goal file", RuleError), goal, setting.rules, world.entities)
    else:
        wanted = _literals(str(goal), "--goal", setting.rules, world.entities)
    return PlanningTask(start, wanted, ground)


def _likeliest_goal(task: Task, start: State, rules: Sequence[GroundRule]) -> Goal:
    """What is to be true in the end, with the hand that can do it if the sentence names none."""
    goals = [task.goals[-1], *(other[-1] for other in task.alternatives)]
    for goal in goals:
        if diagnose(start, goal, rules, 1).verdict is not Verdict.UNREACHABLE:
            return goal
    return goals[0]


def _is_file(text: str) -> bool:
    try:
        return Path(text).is_file()
    except OSError:  # too long for a name: it is literals
        return False


def _refuse_libprada(rules: Path) -> None:
    """libPRADA's rules cannot be read without its symbols; say so rather than complain of their syntax."""
    text = read_text(rules, "rules file", RuleError)
    if re.search(r"^ACTION:", text, re.MULTILINE):
        raise ConfigError(f"{one_line(rules, 200)} looks like libPRADA's: give its --symbols file, too")


def loader(
    sentence: str | None,
    scene: str,
    goal: str | None,
    state: Path | None,
    rules: str | None,
    symbols: Path | None,
) -> Callable[[], PlanningTask]:
    """What the options of `cogarch plan` ask to be read; raises `ConfigError` if they do not fit."""
    if symbols is None:
        return lambda: scene_task(scene, goal, sentence, rules, state)
    if sentence is not None:
        raise ConfigError("a sentence needs a scene: leave --symbols away, or say what to plan for by --goal")
    if goal is not None and not _is_file(goal):
        raise ConfigError(f"no goal file at '{one_line(goal)}'; with --symbols, --goal names a file")
    if rules is None or state is None or goal is None:
        given = {"--rules": rules, "--state": state, "--goal": goal}
        missing = ", ".join(name for name, value in given.items() if value is None)
        raise ConfigError(f"a libPRADA problem is four files: {missing} missing beside --symbols")
    files = symbols, Path(rules), state, Path(goal)
    return lambda: libprada_task(*files)


def _literals(text: str, source: str, rules: RuleSet, entities: Sequence[Entity]) -> Goal:
    """Literals separated by commas or lines, `#` beginning a comment; each checked against the rules."""
    found: list[Literal] = []
    names = {entity.name for entity in entities}
    for number, line in enumerate(text.splitlines(), 1):
        where = f"{source}, line {number}" if len(text.splitlines()) > 1 else source
        for part in _split(line.partition("#")[0]):
            try:
                literal = parse_literal(part)
            except ValueError:
                raise RuleError(f"{where}: cannot read '{one_line(part, 60)}'; valid: {EXAMPLE}") from None
            predicate, args = literal.atom
            if predicate not in rules.predicates:
                raise RuleError(f"{where}: {unknown('predicate', predicate, rules.predicates)}")
            arity = len(rules.predicates[predicate].types)
            if len(args) != arity:
                raise RuleError(f"{where}: {predicate} takes {arity} arguments, here it has {len(args)}")
            for arg in args:
                if arg not in names:
                    raise RuleError(f"{where}: {unknown('entity', arg, names)}")
            found.append(literal)
    for literal in found:
        if literal.negated() in found:
            raise RuleError(f"{source}: {literal.atom} is said to be both true and false; valid: one of them")
    if not found:
        raise RuleError(f"{source}: there is no literal; valid: {EXAMPLE}")
    return tuple(dict.fromkeys(found))


def plan_once(
    load: Callable[[], PlanningTask],
    settings: PlanSettings,
    notify: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Load a problem, plan for it, measure both; returns the fields of `plan --json`.

    `setup_s` is the time to read, ground and compile to arrays, `cpu_s` that of one planning call (median
    over `repeat`). What numba compiles on the first run of a machine is in neither.
    """
    planner = make_planner(settings.planner, settings.samples)
    started = time.perf_counter()
    task = load()
    check_problem(task.goal, settings.horizon)
    loaded = time.perf_counter()
    warm_up(planner, notify)  # after loading: what cannot be read is told at once
    warm = time.perf_counter()
    problem = compile_problem(task.state, task.goal, task.rules)
    setup = loaded - started + time.perf_counter() - warm
    result, cpu = _measured(planner, task, problem, settings)
    answer: dict[str, Any] = {
        "planner": planner.name,
        "status": str(result.status),
        "action": str(result.action) if result.action else None,
        "plan": list(map(str, result.actions)),
        "value": result.value,
        "goal_probability": result.goal_probability,
        "goal": list(map(str, task.goal)),
        "horizon": settings.horizon,
        "samples": getattr(planner, "samples", None),
        "seed": settings.seed,
        "repeat": settings.repeat,
        "n_rules": len(problem.rules),
        "n_atoms": len(problem.atoms),
        "setup_s": setup,
        "cpu_s": cpu,
    }
    if result.action is None:
        diagnosis = diagnose(task.state, task.goal, task.rules, settings.horizon)
        answer |= {"diagnosis": diagnosis.to_json(), "explanation": str(diagnosis)}
    elif settings.evaluate:
        answer["evaluation"] = _evaluation(task, problem, result.actions, settings)
    return answer


def _measured(
    planner: Planner, task: PlanningTask, problem: Problem, settings: PlanSettings
) -> tuple[PlanResult, float]:
    """One planning call, made `repeat` times with the same seed, and the median of its CPU seconds."""
    times = []
    for _ in range(settings.repeat):
        rng = np.random.default_rng(settings.seed)
        started = time.process_time()
        if isinstance(planner, ArrayPlanner):
            result = planner.solve(problem, settings.horizon, rng)
        else:
            result = planner.plan(task.state, task.goal, task.rules, settings.horizon, rng)
        times.append(time.process_time() - started)
    return result, statistics.median(times)


def _evaluation(
    task: PlanningTask, problem: Problem, actions: Sequence[GroundAction], settings: PlanSettings
) -> dict[str, Any]:
    """How likely `actions` are to reach the goal by the rules themselves."""
    rng = np.random.default_rng([settings.seed, 1])
    known = {rule.action for rule in task.rules}
    horizon = max(settings.horizon, len(actions))
    found = evaluate(problem, actions, rng, horizon=horizon, known=known)
    return {
        "actions": list(map(str, actions)),
        "probability": found.final,
        "ever": found.ever,
        "steps": list(found.steps),
        "value": found.value,
        "exact": found.exact,
        "samples": found.samples,
        "standard_error": found.standard_error,
    }


def evaluate_given(load: Callable[[], PlanningTask], actions: str, settings: PlanSettings) -> dict[str, Any]:
    """Evaluate `actions` (written one after another, separated by commas) instead of planning."""
    task = load()
    check_problem(task.goal, settings.horizon)
    problem = compile_problem(task.state, task.goal, task.rules)
    given = tuple(_action(part) for part in _split(actions))
    if not given:
        raise ConfigError("there is no action in --actions; valid: graspWith(Ham,LeftHand), ...")
    evaluation = _evaluation(task, problem, given, settings)
    numbers = {action: n for n, action in enumerate(problem.actions)}
    horizon = max(settings.horizon, len(given))
    sequence = np.full(horizon, problem.idle, dtype=np.int32)
    sequence[: len(given)] = [numbers.get(action, problem.idle) for action in given]
    value, peak, _ = evaluate_sequence(problem.arrays, sequence, Prada.discount, Prada.threshold)
    return {
        "value": value,
        "goal_probability": peak,
        "goal": list(map(str, task.goal)),
        "horizon": horizon,
        "evaluation": evaluation,
    }


def _action(text: str) -> GroundAction:
    try:
        literal = parse_literal(text)
    except ValueError:
        literal = None
    if literal is None or not literal.positive:
        raise ConfigError(f"'{one_line(text, 60)}' is not an action; valid: graspWith(Ham,LeftHand)")
    return GroundAction(*literal.atom)


def _split(text: str) -> list[str]:
    """Parts separated by commas outside parentheses."""
    return [part.strip() for part in re.split(r",(?![^(]*\))", text) if part.strip()]


def plan_text(answer: dict[str, Any]) -> str:
    """An answer of `plan_once` or `evaluate_given` on a few lines."""
    lines = [f"goal         {', '.join(answer['goal'])}"]
    if answer.get("status") == "plan":
        lines += [f"{n:>3}  {action}" for n, action in enumerate(answer["plan"], 1)]
    elif "status" in answer:
        lines.append(f"no plan      {answer['explanation']}")
    lines.append(f"estimate     probability {answer['goal_probability']:.3f}, value {answer['value']:.3f}")
    if "planner" in answer:
        lines += [
            f"planner      {answer['planner']}, horizon {answer['horizon']}, "
            + (f"at most {answer['samples']} samples, " if answer["samples"] else "")
            + f"seed {answer['seed']}",
            f"size         {answer['n_rules']} ground rules, {answer['n_atoms']} atoms",
            f"time         setup {1e3 * answer['setup_s']:.1f} ms, planning {1e3 * answer['cpu_s']:.1f} ms",
        ]
    if "evaluation" in answer:
        found = answer["evaluation"]
        how = "exact" if found["exact"] else f"{found['samples']} trials, +-{found['standard_error']:.4f}"
        steps = " ".join(f"{p:.3f}" for p in found["steps"])
        lines += [
            f"by the rules {found['probability']:.3f} in the end, {found['ever']:.3f} at some time ({how})",
            f"steps 0 to {len(found['steps']) - 1}".ljust(13) + steps,
        ]
    return "\n".join(lines)
