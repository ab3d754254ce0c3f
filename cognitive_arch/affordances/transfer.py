"""From hands to tools (thesis Sec. 5.3.3, 5.4.2): what was learned with postures, used for tools.

Zero-shot: a model that has only seen hands predicts what tools do, from their shape. Hand-tool-joint: a few
trials with tools are added. Beside them: a model that has seen only those few trials with tools.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cognitive_arch.affordances.evaluation import TEST_SHARE
from cognitive_arch.affordances.metrics import scores
from cognitive_arch.affordances.queries import MEANT, goal_mask
from cognitive_arch.affordances.registry import model_class
from cognitive_arch.affordances.trials import ACTIONS, Floats, TrialTable, action_index, joined
from cognitive_arch.errors import AffordanceError

COUNTS = (0, 4, 8, 16, 32, 64, 120)
JOINT, TOOLS = "hands and tools", "tools only"


@dataclass(frozen=True, eq=False)
class TransferCurve:
    """`counts` of tool trials; `accuracy` and `log_likelihood` name -> (counts, repetitions), NaN where
    nothing can be learned. The test trials of a repetition are the same for every count."""

    counts: tuple[int, ...]
    accuracy: Mapping[str, Floats]
    log_likelihood: Mapping[str, Floats]


def same_descriptors(hands: TrialTable, tools: TrialTable) -> None:
    """Raises `AffordanceError` unless both tables describe shapes alike."""
    if (hands.names_m, hands.names_o) != (tools.names_m, tools.names_o):
        raise AffordanceError(
            f"{hands.source} and {tools.source} have different descriptors, so nothing carries over"
        )


def transfer_curve(
    hands: TrialTable,
    tools: TrialTable,
    model: str = "default",
    counts: Sequence[int] = COUNTS,
    repetitions: int = 10,
    seed: int = 0,
) -> TransferCurve:
    """Accuracy on held-out tool trials against the number of tool trials learned from."""
    same_descriptors(hands, tools)
    kind = model_class(model)
    trials = np.unique(tools.trial)
    held = max(1, round(TEST_SHARE * len(trials)))
    counts = tuple(c for c in counts if c <= len(trials) - held)
    accuracy = {name: np.full((len(counts), repetitions), np.nan) for name in (JOINT, TOOLS)}
    likelihood = {name: values.copy() for name, values in accuracy.items()}
    for repetition in range(repetitions):
        order = np.random.default_rng([seed, repetition]).permutation(trials)
        test = tools.take(np.isin(tools.trial, order[:held]))
        for place, count in enumerate(counts):
            few = tools.take(np.isin(tools.trial, order[held : held + count]))
            cases = {JOINT: joined([hands, few]) if count else hands} | ({TOOLS: few} if count else {})
            for name, table in cases.items():
                fitted = kind.fit(table, np.random.default_rng([seed, repetition, count]))
                found = scores(fitted.joint(test), test.bins)
                accuracy[name][place, repetition] = found.accuracy
                likelihood[name][place, repetition] = found.log_likelihood
    return TransferCurve(counts, accuracy, likelihood)


def selected(joint: Floats, action: int) -> Floats:
    """Whether a tool is taken for an action, (n,): the two bins of its direction outweigh the other three
    (thesis Table 12)."""
    mask = goal_mask(MEANT[ACTIONS[action]])
    return (joint[:, mask].sum(axis=1) > 0.5).astype(np.float64)


def selection_table(model_joint: Mapping[str, tuple[TrialTable, Floats]]) -> dict[str, dict[str, float]]:
    """Action -> tool -> share of rows (views of tool and object) for which the tool is taken.

    `model_joint` maps a tool to rows for it and their predictions (n, 5, 5).
    """
    table: dict[str, dict[str, float]] = {}
    for action in ACTIONS:
        number = action_index(action)
        table[action] = {
            tool: float(selected(joint[rows.action == number], number).mean())
            for tool, (rows, joint) in model_joint.items()
        }
    return table


def success_rates(table: TrialTable) -> dict[str, dict[str, float]]:
    """Action -> manipulator -> how often the thing really went where the action is meant to send it."""
    rates: dict[str, dict[str, float]] = {}
    for number, action in enumerate(ACTIONS):
        mask = goal_mask(MEANT[action])
        came = mask[table.bins[:, 0], table.bins[:, 1]]
        rates[action] = {
            str(name): float(came[(table.action == number) & (table.manipulator == name)].mean())
            for name in np.unique(table.manipulator)
            if ((table.action == number) & (table.manipulator == name)).any()
        }
    return rates
