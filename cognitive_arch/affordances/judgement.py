"""How likely an action with a tool does what it is for, told from shapes alone (thesis Sec. 6.4.3).

What was learned answers p(EffectX, EffectY | action, effector half of the tool, whole object, place). Pulling
works if the object comes closer, pushing if it goes away: the sum of the two bins of x in that direction.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cognitive_arch.affordances.queries import MEANT, goal_mask, question_table
from cognitive_arch.affordances.registry import Affordances
from cognitive_arch.affordances.trials import action_index
from cognitive_arch.errors import AffordanceError

PLACE = 0.01
"""Metres: places are told apart that finely."""
LEAST, MOST = 0.01, 0.99
"""Nothing that was learned is certain."""
KEPT = 10_000
"""So many answers are remembered."""
TELLING = ("convexity", "eccentricity", "compactness", "squareness")
"""Descriptors that are named when an answer is explained, of the tool; of the object there is its area."""

Vector = tuple[float, ...]


class Question(NamedTuple):
    """What is asked: an action, the tool's effector half and the whole object (descriptors in the model's
    order), and where the object stands, metres."""

    action: str
    tool: Vector
    object: Vector
    place: tuple[float, float]


@dataclass(eq=False)
class Judge:
    """Answers from what was `learned`; each question costs a look-up once it was asked.

    `fingerprint` changes with all that was learned.
    """

    learned: Affordances
    fingerprint: str = ""
    _known: dict[Question, float] = field(default_factory=dict, repr=False)

    @classmethod
    def load(cls, path: Path) -> Judge:
        """Read what `cogarch learn networks` kept. Raises `AffordanceError` for anything else, and for
        descriptors that cannot be seen."""
        learned = Affordances.load(path)
        seen = described_names()
        missing = [name for name in (*learned.names_m, *learned.names_o) if name not in seen]
        if missing:
            raise AffordanceError(
                f"'{path.name}' was learned from descriptors that the robot does not see: "
                f"{', '.join(dict.fromkeys(missing))}; valid: {', '.join(seen)}"
            )
        return cls(learned, hashlib.sha256(path.read_bytes()).hexdigest()[:16])

    def told(self) -> dict[str, object]:
        """What it is, for a run's manifest."""
        learned = self.learned
        return {
            "model": learned.name,
            "trials": learned.trials,
            "source": learned.source,
            "fingerprint": self.fingerprint,
        }

    def question(
        self, action: str, tool: Sequence[float], obj: Sequence[float], place: tuple[float, float]
    ) -> Question:
        """A question about descriptors as the world state has them: of a tool's two halves, of an object."""
        names = described_names()
        half = dict(zip(names, tool[: len(names)], strict=True))
        whole = dict(zip(names, obj, strict=True))
        return Question(
            action,
            tuple(half[name] for name in self.learned.names_m),
            tuple(whole[name] for name in self.learned.names_o),
            (round(place[0] / PLACE) * PLACE, round(place[1] / PLACE) * PLACE),
        )

    def chances(self, questions: Sequence[Question]) -> dict[Question, float]:
        """How likely each action does what it is for, 0.01 to 0.99."""
        new = [q for q in dict.fromkeys(questions) if q not in self._known]
        if len(self._known) + len(new) > KEPT:
            self._known.clear()
            new = list(dict.fromkeys(questions))
        if new:
            joint = self.learned.model.joint(
                question_table(
                    self.learned,
                    np.array([action_index(q.action) for q in new]),
                    np.array([q.tool for q in new]),
                    np.array([q.object for q in new]),
                    np.array([q.place for q in new]),
                )
            )
            for q, cells in zip(new, joint, strict=True):
                chance = float(cells[goal_mask(MEANT[q.action])].sum())
                self._known[q] = min(max(chance, LEAST), MOST)
        return {q: self._known[q] for q in questions}

    def explained(self, question: Question) -> str:
        """What the answer was told from."""
        tool = dict(zip(self.learned.names_m, question.tool, strict=True))
        obj = dict(zip(self.learned.names_o, question.object, strict=True))
        x, y = question.place
        return (
            f"affordances: tool half {_listed(tool, TELLING)}; object {_listed(obj, ('area',))} "
            f"at ({x:.2f}, {y:.2f}) m"
        )


def described_names() -> tuple[str, ...]:
    """The descriptors of what is seen, in the order of the world state."""
    from cognitive_arch.perception.descriptors import DEFAULT, FORMULAS

    return FORMULAS[DEFAULT].names


def _listed(values: Mapping[str, float], names: Sequence[str]) -> str:
    shown = [name for name in names if name in values] or list(values)[:2]
    return ", ".join(f"{name} {values[name]:.2f}" for name in shown)
