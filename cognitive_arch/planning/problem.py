"""Ground rules as flat arrays, the form in which the numba kernels read them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """A planning problem in sparse rows.

    Row r of the rules spans `context_ptr[r]:context_ptr[r + 1]` of `context_atom` (index of an atom) and
    `context_sign` (1 true, 0 false), and likewise for effects: `effect_set` is the probability that the
    rule makes the atom true, `effect_change` that it sets it either way. Rules of action a are rows
    `action_ptr[a]:action_ptr[a + 1]`.
    """

    atoms: tuple[Atom, ...]
    actions: tuple[GroundAction, ...]
    action_ptr: Ints  # (n_actions + 1,)
    context_ptr: Ints  # (n_rules + 1,)
    context_atom: Ints  # (n_context,)
    context_sign: Ints  # (n_context,)
    effect_ptr: Ints  # (n_rules + 1,)
    effect_atom: Ints  # (n_effects,)
    effect_set: Floats  # (n_effects,)
    effect_change: Floats  # (n_effects,)
    goal_atom: Ints  # (n_goal,)
    goal_sign: Ints  # (n_goal,)
    belief: Floats  # (n_atoms,) marginal of every atom at step 0

    @property
    def n_rules(self) -> int:
        return len(self.context_ptr) - 1

    def arrays(self) -> tuple[NDArray[np.generic], ...]:
        """The arguments that every kernel takes first, in order."""
        return (
            self.action_ptr,
            self.context_ptr,
            self.context_atom,
            self.context_sign,
            self.effect_ptr,
            self.effect_atom,
            self.effect_set,
            self.effect_change,
            self.goal_atom,
            self.goal_sign,
            self.belief,
        )


def compile_problem(state: State, goal: Goal, rules: Sequence[GroundRule]) -> Problem:
    """Flatten `rules` for one state and goal.

    Literals over atoms that no rule changes are decided here: a true one is a factor 1, a false one makes
    its rule's weight 0 for ever, so both can be left out without changing any belief.
    """
    changing = {lit.atom for r in rules for o in r.outcomes for lit in o.literals}
    live: dict[GroundAction, list[GroundRule]] = {}
    for rule in rules:
        if all(lit.atom in changing or lit.holds(state) for lit in rule.context):
            live.setdefault(rule.action, []).append(rule)
    actions = tuple(sorted(live))
    ordered = [rule for action in actions for rule in live[action]]
    atoms = sorted(changing | {lit.atom for lit in goal} | {a for r in ordered for a in _atoms(r.context)})
    index = {atom: i for i, atom in enumerate(atoms)}
    contexts = [
        [(index[lit.atom], lit.positive) for lit in r.context if lit.atom in changing] for r in ordered
    ]
    effects = [_effects(rule, index) for rule in ordered]
    goals = [(index[lit.atom], lit.positive) for lit in goal]
    return Problem(
        atoms=tuple(atoms),
        actions=actions,
        action_ptr=_offsets(len(live[action]) for action in actions),
        context_ptr=_offsets(map(len, contexts)),
        context_atom=np.array([a for row in contexts for a, _ in row], dtype=np.int32),
        context_sign=np.array([s for row in contexts for _, s in row], dtype=np.int32),
        effect_ptr=_offsets(map(len, effects)),
        effect_atom=np.array([a for row in effects for a, _, _ in row], dtype=np.int32),
        effect_set=np.array([s for row in effects for _, s, _ in row], dtype=np.float64),
        effect_change=np.array([c for row in effects for _, _, c in row], dtype=np.float64),
        goal_atom=np.array([a for a, _ in goals], dtype=np.int32),
        goal_sign=np.array([s for _, s in goals], dtype=np.int32),
        belief=np.array([atom in state for atom in atoms], dtype=np.float64),
    )


def _atoms(literals: Iterable[Literal]) -> Iterable[Atom]:
    return (literal.atom for literal in literals)


def _effects(rule: GroundRule, index: dict[Atom, int]) -> list[tuple[int, float, float]]:
    """(atom, probability that it becomes true, probability that it is set) per changed atom."""
    totals: dict[int, list[float]] = {}
    for outcome in rule.outcomes:
        for literal in outcome.literals:
            entry = totals.setdefault(index[literal.atom], [0.0, 0.0])
            entry[0] += outcome.probability * literal.positive
            entry[1] += outcome.probability
    return [(atom, set_, change) for atom, (set_, change) in sorted(totals.items())]


def _offsets(lengths: Iterable[int]) -> Ints:
    return np.array([0, *np.cumsum(list(lengths))], dtype=np.int32)
