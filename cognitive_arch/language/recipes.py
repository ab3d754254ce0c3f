"""Ordering a recipe: what goes in, what stays out, over as many clauses as it takes to say it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from cognitive_arch.domain import Domain, Recipe
from cognitive_arch.errors import InstructionError
from cognitive_arch.language.clauses import ANY_HAND, Clause, Mention
from cognitive_arch.language.commands import Make
from cognitive_arch.language.references import References

_WEAK = frozenset({",", "and", "but", "also", "plus", "well", "as", "n"})
_MORE = frozenset({"", "WANT", "PUT", "COVER", "MAKE", "GIVE", "GET"})


@dataclass
class Order:
    """A recipe being ordered; later clauses may add to it ("..., but hold the cheese")."""

    name: str
    recipe: Recipe
    refs: References
    fillings: list[str] = field(default_factory=list)
    without: list[str] = field(default_factory=list)
    hand: str | None = None

    @classmethod
    def begin(cls, clause: Clause, recipes: Mapping[str, str], domain: Domain, refs: References) -> Order:
        """Start from the clause that names the recipe."""
        if clause.hand not in ("", ANY_HAND) and clause.marks.keys() & {"ON_HAND", "FROM_HAND"}:
            raise InstructionError(f"I do not know what the hand has to do with a {clause.recipe}")
        name = recipes[clause.recipe]
        order = cls(name, domain.recipes[name], refs)
        for mark in ("NOT", "CLOSER", "AWAY"):
            if mark in clause.marks:
                raise InstructionError(f"I cannot make a {clause.recipe} '{clause.marks[mark]}'")
        if any(m.kind == "OBJECT" for m in clause.origin):
            raise InstructionError(
                f"I do not know how 'from {clause.origin[0].text}' goes with a {clause.recipe}"
            )
        order._add(clause)
        return order

    @property
    def _parts(self) -> set[str]:
        return {*self.recipe.base, *self.recipe.fillings, *self.recipe.lid}

    def takes(self, clause: Clause) -> bool:
        """Whether `clause` goes on about this order; if so it is taken in."""
        said = clause.things + clause.using + clause.without + clause.between
        if clause.recipe or (not said and not clause.marks.keys() & {"OPENFACED"}):
            return False
        if "FROM" in clause.marks or any(m.kind == "TABLE" for m in clause.onto):
            return False
        if clause.verb in ("GET", "GIVE") and not set(clause.joint.split()) <= _WEAK:
            return False
        if any(m.kind == "PRONOUN" for m in clause.things) and clause.verb not in (
            "",
            "MAKE",
            "WANT",
            "COVER",
        ):
            return False
        if not all(self._belongs(m) for m in said) or not self._stays_in_order(clause):
            return False
        # "a sandwich, hold the cheese" leaves it out; "make a sandwich, then hold the cheese" does not.
        held_back = clause.verb == "HOLD" and set(clause.joint.split()) <= {",", ";", "and", "but"}
        if "NOT" in clause.marks or held_back:
            self._remove(clause.things + clause.using)
            return True
        if clause.verb not in _MORE or clause.marks.keys() & {"DOWN", "UP", "CLOSER", "AWAY"}:
            return False
        if not self._is_about_fillings(clause):
            return False
        again = [m.text for m in clause.things for n in self.refs.candidates(m) if n in self.fillings]
        if clause.verb == "PUT" and again:
            raise InstructionError(
                f"'{again[0]}' is in the {self.name} already; name the layers once, from the bottom up"
            )
        self._add(clause)
        return True

    def command(self) -> Make:
        """The order as it stands."""
        return Make(self.name, tuple(self.fillings), tuple(self.without), self.hand)

    def done_with(self, hand: str | None, clause: Clause) -> None:
        """The hand a later clause names is the one for all of it, or the order is refused."""
        if hand is None or hand == self.hand:
            return
        if self.hand is not None or clause.verb not in ("", "MAKE"):
            raise InstructionError(f"I make a {self.name} with one hand; {hand} was named for a part of it")
        self.hand = hand

    def _stays_in_order(self, clause: Clause) -> bool:
        """A place in a clause: none, or the base for what comes first ("tomato at the bottom, ...")."""
        places = [m for m in clause.onto if m.kind in ("OBJECT", "TOOL")]
        if not places or clause.verb:
            return not places
        based = all({*self.recipe.base}.intersection(self.refs.candidates(m)) for m in places)
        if based and self.fillings:
            raise InstructionError(f"name the layers of the {self.name} once, from the bottom up")
        return based

    def _is_about_fillings(self, clause: Clause) -> bool:
        """Bread is in the recipe anyway; "then put the bottom bun on it" is more than that."""
        said = [m for m in clause.things + clause.using if m.kind in ("OBJECT", "TOOL")]
        bread = {n for m in said for n in self.refs.candidates(m)} - {*self.recipe.fillings}
        if not all(bread.intersection(self.refs.candidates(m)) for m in said) or not said:
            return True
        if bread & {*self.without}:
            return False
        atop = "ATOP" in clause.marks or bool(clause.onto)
        return clause.verb in ("", "MAKE", "WANT") or (
            clause.verb in ("PUT", "COVER")
            and bread <= {*self.recipe.lid}
            and (atop or clause.verb == "COVER")
        )

    def _belongs(self, mention: Mention) -> bool:
        if mention.kind in ("OBJECT", "TOOL"):
            return bool(self._parts.intersection(self.refs.candidates(mention)))
        return mention.kind != "TABLE"

    def _add(self, clause: Clause) -> None:
        # "ham on top of tomato": what is below goes in first. The bread is below anyway.
        below = [m for m in clause.onto if m.kind == "OBJECT"]
        for mention in below + clause.things + clause.using + clause.between:
            self._fill(mention)
        if "ONLY" in clause.marks and not self.fillings:
            self.without += self.recipe.fillings  # "just bread"
        self._remove(clause.without)
        if "OPENFACED" in clause.marks:
            self.without += self.recipe.lid

    def _fill(self, mention: Mention) -> None:
        if mention.kind == "EVERYTHING":
            names: Sequence[str] = [n for n in self.recipe.fillings if n in self.refs.scene]
        elif mention.kind == "NOTHING":
            self.without += self.recipe.fillings
            return
        elif mention.kind == "PRONOUN":
            names = [n for n in self.refs.pronoun(mention) if n in self.recipe.fillings]
        else:
            names = self._filling(mention)
        self.fillings += [n for n in names if n not in self.fillings]

    def _filling(self, mention: Mention) -> list[str]:
        known = self.refs.candidates(mention)
        if all(n in self.recipe.base or n in self.recipe.lid for n in known):
            return []  # "with ham and bread": the bread is there anyway
        if not self._belongs(mention):
            valid = ", ".join(self.recipe.fillings)
            raise InstructionError(f"{known[0]} does not go into a {self.name}; what does: {valid}")
        return [self.refs.named(mention)]

    def _remove(self, mentions: Sequence[Mention]) -> None:
        for mention in mentions:
            if mention.kind in ("NOTHING", "EVERYTHING"):
                self.without += self.recipe.fillings
            elif mention.kind in ("OBJECT", "TOOL"):
                self.without += [n for n in self.refs.candidates(mention) if n not in self.without]
