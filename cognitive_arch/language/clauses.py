"""From typed words to clauses: runs the grammar and turns its parse tree into frozen values at once."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from lark import Lark, Token, Tree, UnexpectedInput
from lark.common import LexerConf
from lark.lexer import Lexer

from cognitive_arch.errors import InstructionError
from cognitive_arch.language.commands import LEFT, RIGHT
from cognitive_arch.language.vocabulary import Word
from cognitive_arch.resources import grammar_text

_HAND_MARKS = frozenset({"ON_HAND", "WITH_HAND", "FROM_HAND", "FROM"})
ANY_HAND = "hand"
OTHER_HAND = "other"


@dataclass(frozen=True)
class Mention:
    """A thing as it was said: alternatives ("ham or cheese"), each a typed word."""

    choices: tuple[Word, ...]

    @property
    def kind(self) -> str:
        return self.choices[0].kind

    @property
    def text(self) -> str:
        return " or ".join(word.text for word in self.choices)


@dataclass
class Clause:
    """One clause: its verb, the things by the part they play, and the small words beside them."""

    verb: str = ""
    verb_text: str = ""
    subject: list[Mention] = field(default_factory=list)
    direct: list[Mention] = field(default_factory=list)
    onto: list[Mention] = field(default_factory=list)
    between: list[Mention] = field(default_factory=list)
    using: list[Mention] = field(default_factory=list)
    without: list[Mention] = field(default_factory=list)
    origin: list[Mention] = field(default_factory=list)
    recipe: str = ""
    hand: str = ""
    joint: str = ""
    marks: dict[str, str] = field(default_factory=dict)

    @property
    def things(self) -> list[Mention]:
        """What the clause acts on: "put the ham ..." or, as some say it, "the ham put ..."."""
        return self.subject + self.direct

    @property
    def only_means(self) -> bool:
        """Names a hand or tool and nothing else ("with your left hand, ...")."""
        said = self.verb or self.things or self.onto or self.between or self.without or self.recipe
        return not (said or self.marks.keys() - _HAND_MARKS) and bool(self.hand or self.using)


class _Given(Lexer):
    """The words are typed before Lark sees them; this passes them on."""

    def __init__(self, lexer_conf: LexerConf) -> None:
        pass

    def lex(self, data: Any) -> Iterator[Token]:  # type: ignore[override]
        for position, word in enumerate(data):
            yield Token(word.kind, word.text, start_pos=position)


@cache
def _parser() -> Lark:
    return Lark(grammar_text("instruction"), parser="lalr", lexer=_Given)


@cache
def word_lists() -> dict[str, tuple[str, ...]]:
    """Terminal -> its phrases. A terminal of this grammar is a plain list of alternatives."""
    lists = {}
    for terminal in _parser().terminals:
        if terminal.pattern is not None:
            body = terminal.pattern.to_regexp().removeprefix("(?:").removesuffix(")")
            lists[terminal.name] = tuple(re.sub(r"\\(.)", r"\1", part) for part in body.split("|"))
    return lists


@cache
def verb_kinds() -> frozenset[str]:
    """The terminals the grammar allows as a verb."""
    return frozenset(str(rule.expansion[0].name) for rule in _parser().rules if rule.origin.name == "verb")


def _hand_named(text: str) -> str:
    if "left" in text:
        return LEFT
    if "right" in text:
        return RIGHT
    return OTHER_HAND if "other" in text or "free" in text else ANY_HAND


def _mention(choice: Tree[Token]) -> Mention:
    tokens = [name.children[0] for name in choice.children if isinstance(name, Tree)]
    return Mention(tuple(Word(t.type, str(t)) for t in tokens if isinstance(t, Token)))


def _mentions(things: Tree[Token]) -> list[Mention]:
    return [_mention(choice) for choice in things.children if isinstance(choice, Tree)]


def _clause(tree: Tree[Token]) -> Clause:
    clause = Clause()
    for part in tree.children:
        assert isinstance(part, Tree)
        inner = [child for child in part.children if isinstance(child, Tree)]
        token = next((child for child in reversed(part.children) if isinstance(child, Token)), None)
        match part.data:
            case "verb" if token is not None:
                clause.verb, clause.verb_text = token.type, str(token)
                clause.subject, clause.direct = clause.direct, []
            case "mark" if token is not None:
                clause.marks[token.type] = str(token)
            case "recipe" if token is not None:
                clause.recipe = str(token)
            case "hand" if token is not None:
                clause.hand = _hand_named(str(token))
                if len(part.children) > 1:
                    clause.marks.setdefault(f"{part.children[0].type}_HAND", "")  # type: ignore[union-attr]
            case "onto_recipe" if token is not None:
                clause.onto.append(Mention((Word("PRONOUN", str(token)),)))
            case "onto":
                clause.onto.append(_mention(inner[0]))
            case "origin":
                clause.marks["FROM"] = ""
                clause.origin.append(_mention(inner[0]))
            case "from_recipe" if token is not None:
                clause.marks["FROM"] = ""
                clause.origin.append(Mention((Word("PRONOUN", str(token)),)))
            case "direct":
                clause.direct += _mentions(inner[0])
            case role:
                getattr(clause, str(role)).extend(_mentions(inner[0]))
    return clause


def clauses(words: Sequence[Word]) -> list[Clause]:
    """Parse joined words (see `vocabulary.joined`); raises `InstructionError` where they do not fit."""
    try:
        tree = _parser().parse(list(words))
    except UnexpectedInput as error:
        token = getattr(error, "token", None)
        at = token.start_pos if token is not None and token.type != "$END" else None
        if at is None:
            raise InstructionError(
                f"the sentence ends too early, after '{words[-1].text}'" if words else "nothing was asked for"
            ) from None
        after = f" after '{words[at - 1].text}'" if at else ""
        raise InstructionError(f"I do not understand '{words[at].text}'{after}") from None
    found: list[Clause] = []
    joint = ""
    for child in tree.children:
        if isinstance(child, Token):
            joint = str(child)
        else:
            found.append(_clause(child))
            found[-1].joint = joint
    return found
