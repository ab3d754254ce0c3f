"""What the robot believed of the actions it decided between, and where each number came from: for the log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cognitive_arch.execution.grounding import Grounded
from cognitive_arch.execution.heuristics import Adaptation
from cognitive_arch.execution.reliability import Reliability, capability_of
from cognitive_arch.execution.weighing import priors
from cognitive_arch.relational.symbols import GroundAction

DEFAULT = "default"


@dataclass(frozen=True, slots=True)
class Belief:
    """How likely `action` works; `source` says what that was told from, `default` being its rule."""

    action: GroundAction
    probability: float
    source: str


def beliefs(
    actions: Sequence[GroundAction],
    grounded: Grounded,
    adaptation: Adaptation,
    reliability: Reliability | None = None,
) -> tuple[Belief, ...]:
    """Of a plan's `actions`, and of the same done with other tools, as far as these have learned numbers.

    `reliability` takes the place of `adaptation` where it is given.
    """
    base = priors(grounded.rules)
    found: dict[GroundAction, Belief] = {}
    for action in (a for chosen in actions for a in (chosen, *_rivals(chosen, grounded))):
        if action in base and action not in found:
            source = grounded.sources.get(action, DEFAULT)
            found[action] = _lowered(Belief(action, base[action], source), adaptation, reliability)
    return tuple(found.values())


def _rivals(action: GroundAction, grounded: Grounded) -> Iterator[GroundAction]:
    """The same with another tool."""
    if action in grounded.sources:
        for other in grounded.sources:
            if (other.name, other.args[:1], other.args[2:]) == (
                action.name,
                action.args[:1],
                action.args[2:],
            ):
                yield other


def _lowered(belief: Belief, adaptation: Adaptation, reliability: Reliability | None) -> Belief:
    """The belief after what happened so far."""
    if reliability is not None:
        good, bad = reliability.tried.get(capability_of(belief.action), (0, 0))
        chance = reliability.chance(belief.action, belief.probability)
        if chance == belief.probability:
            return belief
        why = f"reliability: {capability_of(belief.action)} worked {good} of {good + bad} times"
        return Belief(belief.action, chance, f"{belief.source}; {why}")
    failures = adaptation.failures.get(belief.action, 0)
    if not failures:
        return belief
    times = {1: "once", 2: "twice"}.get(failures, f"{failures} times")
    return Belief(
        belief.action,
        belief.probability * adaptation.decay**failures,
        f"{belief.source}; adaptability: failed {times}",
    )
