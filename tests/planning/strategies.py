"""Random small planning problems for hypothesis."""

from __future__ import annotations

from hypothesis import strategies as st

from cognitive_arch.relational.derived import AnyOf, Closure, Comparison, CountIs, in_order
from cognitive_arch.relational.rules import GroundOutcome, GroundRule, GroundRules
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State

ATOMS = tuple(Atom(f"p{i}", ("X",)) for i in range(5))
THINGS = ("A", "B", "C")
EDGES = tuple(Atom("on", (x, y)) for x in THINGS for y in THINGS if x != y)

Case = tuple[State, Goal, GroundRules]


def conjunctions(atoms: tuple[Atom, ...], least: int, most: int) -> st.SearchStrategy[tuple[Literal, ...]]:
    """Literals over distinct atoms."""
    one = st.tuples(st.sampled_from(atoms), st.booleans()).map(lambda pair: Literal(*pair))
    return st.lists(one, min_size=least, max_size=most, unique_by=lambda lit: lit.atom).map(tuple)


@st.composite
def outcomes(draw: st.DrawFn, atoms: tuple[Atom, ...], certain: bool) -> tuple[GroundOutcome, ...]:
    """One to three outcomes; what they leave is noise."""
    if certain:
        return (GroundOutcome(1.0, draw(conjunctions(atoms, 1, 2))),)
    parts = draw(st.lists(st.integers(1, 10), min_size=1, max_size=3))
    total = sum(parts) + draw(st.integers(0, 5))
    return tuple(GroundOutcome(part / total, draw(conjunctions(atoms, 0, 2))) for part in parts)


@st.composite
def problems(draw: st.DrawFn, derived: bool = False, certain: bool = False) -> Case:
    """State, goal and rules over five atoms (with `derived`: over who is on whom, too)."""
    primitive = ATOMS + (EDGES if derived else ())
    definitions: tuple[AnyOf | Closure | CountIs, ...] = ()
    if derived:
        definitions = in_order(
            [
                CountIs(Atom("busy", ()), tuple(map(Literal, EDGES)), Comparison.GREATER_EQUAL, 2),
                Closure("above", "on", THINGS),
                AnyOf(Atom("odd", ()), draw(st.lists(conjunctions(primitive, 0, 2), max_size=2).map(tuple))),
                AnyOf(Atom("tower", ()), ((Literal(Atom("above", ("A", "C"))), Literal(ATOMS[0], False)),)),
            ]
        )
    readable = primitive + tuple(atom for definition in definitions for atom in definition.defines)
    rules = [
        GroundRule(
            GroundAction(f"a{draw(st.integers(0, 3))}", ()),
            draw(conjunctions(readable, 0, 3)),
            draw(outcomes(primitive, certain)),
        )
        for _ in range(draw(st.integers(1, 6)))
    ]
    state = frozenset(draw(st.sets(st.sampled_from(primitive))))
    return state, draw(conjunctions(readable, 1, 2)), GroundRules(rules, definitions)
