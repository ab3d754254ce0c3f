"""From clauses to commands: who does what to what, given what was said before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from cognitive_arch.domain import Domain
from cognitive_arch.errors import InstructionError
from cognitive_arch.language.clauses import ANY_HAND, OTHER_HAND, Clause, Mention
from cognitive_arch.language.commands import (
    LEFT,
    RIGHT,
    Command,
    Drop,
    Grasp,
    Make,
    Pull,
    Push,
    Put,
    Semantic,
)
from cognitive_arch.language.meaning import action_of, check_parts, with_lists_joined
from cognitive_arch.language.recipes import Order
from cognitive_arch.language.references import References
from cognitive_arch.language.vocabulary import NothingUnderstood, Vocabulary, Word

_TRIPLE_VERBS = {
    "GRASP": "grasp",
    "HOLD": "grasp",
    "GET": "grasp",
    "PUT": "put",
    "DROP": "drop",
    "PULL": "pull",
    "PUSH": "push",
}
_TAKING = frozenset({"GET", "GIVE", "GRASP", "HOLD", "MAKE", "WANT"})


class Interpreter:
    """Reads the clauses of one instruction in order; carries over what later ones leave out."""

    def __init__(self, vocabulary: Vocabulary, domain: Domain, scene_objects: Sequence[str]) -> None:
        self._refs = References(vocabulary, domain, scene_objects)
        self._domain = domain
        self._recipes = vocabulary.recipes
        self._done: list[Command] = []
        self._order: Order | None = None
        self._verb = ""
        self._last_hand: str | None = None

    def commands(self, clauses: Sequence[Clause]) -> tuple[Command, ...]:
        """The commands of an instruction; raises `InstructionError` where a clause makes no sense."""
        if any(clause.verb == "REACH" and clause.subject for clause in clauses):
            return (Semantic(tuple(self._triple(clause) for clause in clauses)),)
        means: Clause | None = None
        clauses = with_lists_joined(clauses)
        for clause, after in zip(clauses, [*clauses[1:], None], strict=True):
            if clause.only_means and self._continues_order(clause, last=after is None):
                continue
            if clause.only_means and clause is not clauses[-1]:
                means = clause
                continue
            if clause.only_means:
                self._add_means(clause)
                continue
            if means is not None:
                clause.hand = clause.hand or means.hand
                clause.using = clause.using or means.using
                means = None
            if not self._is_topic(clause, after):
                self._read(clause)
        self._close_order()
        if not self._done:
            raise NothingUnderstood("nothing was asked for")
        return tuple(self._done)

    def _read(self, clause: Clause) -> None:
        if self._continues_order(clause):
            return
        if "NOT" in clause.marks:
            what = f"not to '{clause.verb_text}'" if clause.verb_text else "what not to do"
            raise InstructionError(f"I was told {what}; say what to do instead")
        if not clause.verb and clause.things and clause.onto and clause.onto[0].text in self._recipes:
            clause.recipe = clause.onto.pop(0).text  # "ham, then tomato, in a sandwich"
        verb = clause.verb or self._elliptic_verb(clause)
        if clause.recipe and (verb in _TAKING or verb == "PUT"):
            verb = self._with_recipe(verb, clause)
        elif verb in ("MAKE", "WANT") and not clause.recipe:
            verb = self._without_recipe(clause)
        if verb == "MAKE":
            self._close_order()
            if any(
                isinstance(done, Make) and done.recipe == self._recipes[clause.recipe] for done in self._done
            ):
                raise InstructionError(f"I make one {clause.recipe}; there is one of each thing for it")
            self._order = Order.begin(clause, self._recipes, self._domain, self._refs)
            self._order.hand = self._hand(clause)
        else:
            self._close_order()
            made = self._done[-1] if self._done else None
            if isinstance(made, Make) and any(m.kind == "PRONOUN" for m in clause.things):
                raise InstructionError(
                    f"I cannot '{clause.verb_text or verb.lower()}' a finished {made.recipe}"
                )
            for mention in clause.origin:
                if mention.kind in ("OBJECT", "TOOL"):
                    self._refs.there(mention)
            meaning = action_of(verb, clause)
            check_parts(meaning, clause)
            self._handler(meaning, clause)(clause)
        self._verb = verb

    def _continues_order(self, clause: Clause, last: bool = False) -> bool:
        """Whether `clause` is more about the recipe being ordered, or (`last`) the hand to make it with."""
        if self._order is None:
            return False
        if not self._order.takes(clause) and not (last and clause.hand and not clause.using):
            return False
        self._order.done_with(self._hand(clause), clause)
        return True

    def _with_recipe(self, verb: str, clause: Clause) -> str:
        """ "get a sandwich" is to make one; "take the ham off the sandwich" is about the one there is."""
        moved = clause.onto or clause.marks.keys() & {"UP", "DOWN", "AWAY", "CLOSER"}
        if verb in ("GRASP", "HOLD") or (verb == "PUT" and moved):
            raise InstructionError(
                f"I cannot '{clause.verb_text}' a finished {clause.recipe}; I only make one"
            )
        if "FROM" in clause.marks and verb in ("GET", "GIVE") and clause.things:
            clause.recipe = ""  # "take the ham off the cheese sandwich"
            return verb
        return "MAKE"

    def _is_topic(self, clause: Clause, after: Clause | None) -> bool:
        """ "the ham is too far, pull it closer": the first clause only says what "it" is."""
        if clause.verb or clause.recipe or clause.onto or after is None or not clause.things:
            return False
        if not any(m.kind == "PRONOUN" for m in after.things) or clause.marks.keys() - {"AWAY"}:
            return False
        self._refs.acted_on(*self._refs.several(clause.things))
        return True

    def _elliptic_verb(self, clause: Clause) -> str:
        if clause.recipe:
            return "MAKE"
        if not clause.things and not clause.onto and not clause.using:
            raise NothingUnderstood("I do not know what to do")
        # "put ham on the bun and the top bun on it" repeats the verb; "the rake the ham closer" has none.
        if clause.onto or clause.between or "ATOP" in clause.marks:
            return "PUT"
        if "CLOSER" in clause.marks:
            return "PULL"
        if self._verb and self._verb != "MAKE":
            return self._verb
        if len(clause.things) == 2 and clause.things[0].kind == "TOOL":
            return "PULL"  # "hook the ham"
        lowest = clause.things[0] if len(clause.things) > 1 else None
        if (
            lowest
            and lowest.kind == "OBJECT"
            and self._refs.bases.intersection(self._refs.candidates(lowest))
        ):
            return "PUT"  # "bottom bun, ham, top bun" builds it
        said = clause.things[0].text if clause.things else clause.using[0].text
        raise NothingUnderstood(f"I do not know what to do with '{said}'")

    def _without_recipe(self, clause: Clause) -> str:
        """ "I want ham and cheese" orders the one recipe they belong to; "I want the rake" takes it."""
        if clause.onto and clause.onto[0].text in self._recipes:
            clause.recipe = clause.onto.pop(0).text  # "turn the ham into a sandwich"
            return "MAKE"
        if clause.onto or clause.between:
            return "PUT"
        fitting = [r for r, entry in self._domain.recipes.items() if self._all_of(clause, entry.fillings)]
        # "cook the ham" is beyond the robot; "combine ham and cheese" is not.
        enough = clause.verb == "WANT" or len(clause.things + clause.using) > 1
        if len(fitting) == 1 and enough:
            clause.recipe = next(text for text, name in self._recipes.items() if name == fitting[0])
            return "MAKE"
        if clause.things and all(m.kind in ("OBJECT", "TOOL") for m in clause.things):
            said = clause.things[0].text
            raise InstructionError(f"I cannot '{clause.verb_text}' '{said}'")
        raise NothingUnderstood(f"I do not know what to '{clause.verb_text or 'make'}'")

    def _all_of(self, clause: Clause, fillings: Sequence[str]) -> bool:
        said = clause.things + clause.using
        named = [set(self._refs.candidates(m)) for m in said if m.kind in ("OBJECT", "TOOL")]
        return bool(named) and len(named) == len(said) and all(n & set(fillings) for n in named)

    def _handler(self, verb: str, clause: Clause) -> Callable[[Clause], None]:
        handlers = {
            "GRASP": self._grasp,
            "PUT": self._put,
            "COVER": self._cover,
            "DROP": self._drop,
            "PULL": lambda said: self._move(said, Pull),
            "PUSH": lambda said: self._move(said, Push),
        }
        if verb not in handlers:
            raise InstructionError(f"I cannot '{clause.verb_text}' anything")
        return handlers[verb]

    def _close_order(self) -> None:
        if self._order is not None:
            self._done.append(self._order.command())
            self._refs.stack_top = None
            self._order = None

    def _hand(self, clause: Clause) -> str | None:
        if clause.hand in ("", ANY_HAND):
            return None
        if clause.hand == OTHER_HAND:
            if self._last_hand is None:
                raise InstructionError("I do not know which hand is the other one; say left or right")
            self._last_hand = LEFT if self._last_hand == RIGHT else RIGHT
        else:
            self._last_hand = clause.hand
        return self._last_hand

    def _add_means(self, clause: Clause) -> None:
        """ "pull the ham, using the rake": the last command gets what comes after the comma."""
        self._close_order()
        if not self._done or isinstance(self._done[-1], Make | Semantic):
            raise NothingUnderstood("I do not know what to do")
        last = self._done[-1]
        hand = self._hand(clause)
        if hand is not None:
            last = replace(last, hand=hand)
        if clause.using:
            if not isinstance(last, Pull | Push):
                raise InstructionError("a tool is only used to pull or push")
            last = replace(last, tool=self._refs.tool(clause.using[0]))
        self._done[-1] = last

    def _objects(self, clause: Clause, action: str) -> list[str]:
        names = self._refs.several(clause.things)
        if not names:
            raise NothingUnderstood(f"I do not know what to {action}")
        return names

    def _grasp(self, clause: Clause) -> None:
        names = self._objects(clause, "grasp")
        hand = self._hand(clause)
        self._done += [Grasp(name, hand) for name in names]
        self._refs.acted_on(*names)

    def _put(self, clause: Clause) -> None:
        hand = self._hand(clause)
        things, goal = clause.things, (*clause.onto, *clause.between)
        if not things and clause.onto:
            # "put on the top bun" lacks not the thing but the place, unless one was just taken.
            if self._done and isinstance(self._done[-1], Grasp):
                things = [Mention((Word("PRONOUN", "it"),))]
            else:
                things, goal = clause.onto, ()
        if goal and goal[0].kind == "TABLE":
            return self._drop(clause)
        self._stack(things, goal[0] if goal else None, hand, clause)
        if clause.between and len(clause.between) + len(self._refs.candidates(clause.between[0])) > 2:
            lid = next((n for n in self._refs.scene if n in self._refs.lids), None)
            if lid is not None:
                self._place([lid], self._refs.stack_top or lid, hand)

    def _stack(self, things: list[Mention], goal: Mention | None, hand: str | None, clause: Clause) -> None:
        """Each thing on the one before it, the first on `goal` or on what was stacked last."""
        if not things:
            raise InstructionError(f"I do not know what to '{clause.verb_text or 'put'}'")
        below = self._refs.stack_top
        if goal is not None:
            moving = [n for m in things if m.kind != "PRONOUN" for n in self._refs.candidates(m)]
            sure = {n for n in moving if [*moving].count(n) == 1} if len(moving) == len(things) else set()
            below = self._refs.target(goal, sure)
        elif below is None:
            if len(things) == 1:
                raise InstructionError(f"I do not know where to put '{things[0].text}'")
            below, things = self._refs.target(things[0]), things[1:]
        names = self._refs.several(things, prefer=self._refs.lids, avoid={below})
        if not names and things[0].kind == "PRONOUN":
            self._done.append(Put(None, below, hand))
            return
        self._place(names, below, hand)

    def _place(self, names: Sequence[str], below: str, hand: str | None) -> None:
        for name in names:
            if name == below:
                raise InstructionError(f"I cannot put {name} on itself")
            self._done.append(Put(name, below, hand))
            below = name
        self._refs.acted_on(*names)
        self._refs.stack_top = below

    def _cover(self, clause: Clause) -> None:
        """ "top the ham with cheese"; without "with", the lid is meant ("close the sandwich")."""
        goal = next(iter(clause.things + clause.onto), None)
        things = clause.using
        if not things:
            lid = next((n for n in self._refs.scene if n in self._refs.lids), None)
            if lid is None:
                raise InstructionError(f"I do not know what to '{clause.verb_text}' it with")
            below = self._refs.target(goal, {lid}) if goal else self._refs.stack_top
            if below is None:
                raise InstructionError(f"I do not know what to '{clause.verb_text}'")
            return self._place([lid], below, self._hand(clause))
        self._stack(things, goal, self._hand(clause), clause)

    def _drop(self, clause: Clause) -> None:
        hand = self._hand(clause)
        names = self._refs.several(clause.things)
        moved = clause.verb not in ("DROP", "OPEN")  # "put the ham down" moves it wherever it is
        self._done += [Drop(name, hand, moved) for name in names] or [Drop(None, hand)]
        self._refs.acted_on(*names)

    def _tool(self, clause: Clause, objects: list[str]) -> str | None:
        if clause.using:
            return self._refs.tool(clause.using[0])
        if not clause.verb and len(objects) > 1 and self._refs.is_tool(objects[0]):
            return objects.pop(0)  # "rake the ham closer"
        return None

    def _move(self, clause: Clause, kind: type[Pull] | type[Push]) -> None:
        names = self._objects(clause, kind.__name__.lower())
        tool, hand = self._tool(clause, names), self._hand(clause)
        if tool is None and clause.hand == ANY_HAND and "WITH_HAND" in clause.marks:
            raise InstructionError(f"I {kind.__name__.lower()} things with a tool, not with the hand")
        self._done += [kind(name, tool, hand) for name in names]
        self._refs.acted_on(*names)

    def _triple(self, clause: Clause) -> tuple[str, str, str]:
        said = " ".join(m.text for m in clause.things)
        if "NOT" in clause.marks or clause.using or clause.onto or not clause.direct:
            raise InstructionError(f"'{clause.verb_text} {said}' does not fit among semantic instructions")
        objects = [self._refs.named(m) for m in clause.direct]
        if clause.verb == "REACH" and len(clause.subject) == len(objects) == 1:
            return (self._refs.named(clause.subject[0]), "reach", objects[0])
        if clause.verb not in _TRIPLE_VERBS or len(objects) != 1 or clause.subject:
            raise InstructionError(f"'{clause.verb_text} {said}' does not fit among semantic instructions")
        return (self._hand(clause) or "hand", _TRIPLE_VERBS[clause.verb], objects[0])
