"""Structures of affordance networks: nodes with their numbers of states, and who depends on whom.

The named ones are the thesis': Fig. 38 (fully connected), Figs. 39 and 43 (principal components, one block
and two), and the two learned ones of Fig. 40, whose descriptor names were never published: nodes are numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import prod

from cognitive_arch.affordances.trials import ACTIONS, N_BINS
from cognitive_arch.errors import AffordanceError, unknown

ACTION, EFFECT_X, EFFECT_Y = "Action", "EffectX", "EffectY"
EFFECTS = (EFFECT_X, EFFECT_Y)


@dataclass(frozen=True)
class Structure:
    """A directed acyclic graph: `states` node -> number of states, `parents` node -> its parents, in order.

    Raises `AffordanceError` for unknown parents and for circles.
    """

    states: Mapping[str, int]
    parents: Mapping[str, tuple[str, ...]]

    def __post_init__(self) -> None:
        for node, parents in self.parents.items():
            for name in (node, *parents):
                if name not in self.states:
                    raise AffordanceError(unknown("node", name, self.states))
        self.order()

    def of(self, node: str) -> tuple[str, ...]:
        """The parents of `node`."""
        return tuple(self.parents.get(node, ()))

    @property
    def edges(self) -> tuple[tuple[str, str], ...]:
        """All (parent, child), in the order of the nodes."""
        return tuple((p, node) for node in self.states for p in self.of(node))

    def configurations(self, node: str) -> int:
        """In how many ways the parents of `node` can be."""
        return prod(self.states[p] for p in self.of(node))

    def order(self) -> tuple[str, ...]:
        """Nodes, every one after its parents; raises `AffordanceError` when there is a circle."""
        done: dict[str, None] = {}
        while len(done) < len(self.states):
            ready = [n for n in self.states if n not in done and all(p in done for p in self.of(n))]
            if not ready:
                left = ", ".join(n for n in self.states if n not in done)
                raise AffordanceError(f"the structure goes in a circle among {left}")
            done |= dict.fromkeys(ready)
        return tuple(done)

    @property
    def complexity(self) -> int:
        """Number of entries of all conditional probability tables (what thesis Table 6 lists)."""
        return sum(count * self.configurations(node) for node, count in self.states.items())


def fully_connected(features: Sequence[str], levels: int = 3) -> Structure:
    """Fig. 38: both effects depend on the action and on every descriptor."""
    return _effects_of(dict.fromkeys(features, levels))


def components(blocks: Sequence[str], per_block: int = 2, levels: int = 2) -> Structure:
    """Figs. 39 and 43: both effects depend on the action and the components of one block or two."""
    return _effects_of({f"{block}{i + 1}": levels for block in blocks for i in range(per_block)})


def _effects_of(features: Mapping[str, int]) -> Structure:
    parents = (ACTION, *features)
    states = {ACTION: len(ACTIONS), **features, EFFECT_X: N_BINS, EFFECT_Y: N_BINS}
    return Structure(states, {EFFECT_X: parents, EFFECT_Y: parents})


def _numbered(states: Mapping[int, int], parents: Mapping[int, str], count: int = 15) -> Structure:
    return Structure(
        {str(n): states.get(n, 3) for n in range(1, count + 1)},
        {str(n): tuple(text.split()) for n, text in parents.items()},
    )


def fig38() -> Structure:
    """The fully connected network of Table 6: six descriptors of the tool's half and six of the object."""
    names = ("area", "convexity", "eccentricity", "compactness", "circularity", "squareness")
    return fully_connected([f"{part}_{name}" for part in ("m", "o") for name in names])


def fig40_k2() -> Structure:
    """The structure K2 found (Fig. 40a). Node 1 is the action, 11 and 15 are the effects."""
    return _numbered(
        {1: 4, 11: 5, 15: 5},
        {
            2: "1", 3: "2", 4: "3", 5: "2 3", 6: "2 5", 7: "2 5", 8: "2 3 5", 9: "4", 10: "4 9",
            11: "1 2 7", 12: "9 10", 13: "10", 14: "4 12", 15: "1 14",
        },
    )  # fmt: skip


def fig40_bde() -> Structure:
    """The structure the BDe score led to (Fig. 40b). Node 5 is the action, 9 and 13 are the effects."""
    return _numbered(
        {5: 4, 9: 5, 13: 5},
        {8: "1 2", 9: "2 3 4 5", 12: "8 9", 13: "5 9 10 11", 14: "11", 15: "13 14"},
    )


NAMED: Mapping[str, Callable[[], Structure]] = {
    "full": fig38,
    "pca": lambda: components(["PC"]),
    "pca-two-blocks": lambda: components(["ManipulatorPC", "ObjectPC"]),
    "fig40-k2": fig40_k2,
    "fig40-bde": fig40_bde,
}


def named_structure(name: str) -> Structure:
    """A structure by its name; raises `AffordanceError` for one there is not."""
    if name not in NAMED:
        raise AffordanceError(unknown("structure", name, NAMED))
    return NAMED[name]()
