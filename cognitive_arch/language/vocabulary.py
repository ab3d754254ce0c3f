"""From a sentence to typed words: the lists in `grammar/instruction.lark` plus the names of a domain.

A sentence is written in a normal form (lower case, no quotes, hyphens as spaces, base forms of plurals
and verb forms, no articles) and cut from left to right into the longest phrases that are known. A word
in no phrase is an error that names it: nothing is dropped that is not on the list of fillers.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cognitive_arch.domain import Domain
from cognitive_arch.errors import InstructionError, one_line

Phrase = tuple[str, ...]

NAMES = frozenset({"OBJECT", "TOOL", "PRONOUN", "TABLE", "EVERYTHING", "NOTHING"})
_DOMAIN_KINDS = frozenset({"OBJECT", "TOOL", "RECIPE"})
_UNCUTTABLE = _DOMAIN_KINDS | {"HAND"}
_SILENT = frozenset({"DETERMINER", "FILLER"})
_REFUSED = {
    "COUNT": "there is one of each thing and I move one at a time",
    "BESIDE": "I can only put things on things",
    "SIDEWAYS": "I can only pull things closer, push them away and put them on things",
}
_HARMLESS_SYMBOLS = re.compile(r"FACE|HEART|HAND|THUMB|SIGN|SPARKLE|ROBOT|SMIL|STAR|PARTY|FINGER|FITZPATRICK")


class NothingUnderstood(InstructionError):
    """Something was left out altogether: the line ends with what can be said in this scene."""


@dataclass(frozen=True)
class Word:
    """A phrase of the sentence with the grammar's terminal it stands for."""

    kind: str
    text: str


def _symbol(char: str) -> str:
    """A pictogram by its Unicode name ("TOMATO"), so that it counts as a word; faces say nothing."""
    name = unicodedata.name(char, "")
    return " " if _HARMLESS_SYMBOLS.search(name) else f" {name.lower()} "


def _spell(char: str) -> str:
    category = unicodedata.category(char)
    if char in "&+":
        return " and "
    if char in "'’‘`´":
        return ""
    if char in ".!?;\n…":
        return " ; "
    if char in ",:()[]/—–":
        return " , "
    if category == "So":
        return _symbol(char)
    # Marks belong to the letter before them; without them "jalapen~o" would fall into two words.
    return char if category[0] in "LNM" else " "


def normal_words(text: str) -> list[str]:
    """Lower-case words and the separators "," and ";" of any text."""
    # The casefold comes first and the composition last: both are needed for a form that is stable.
    folded = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())
    return "".join(_spell(c) for c in folded).split()


def _lemmas(word: str) -> Iterator[str]:
    """Base forms `word` may be a plural or verb form of: "grabbing" -> grabb, grab, grabbe."""
    for ending in ("s", "es", "ing", "ed", "d"):
        stem = word.removesuffix(ending)
        if stem == word or len(stem) < 2:
            continue
        yield stem
        if ending in ("ing", "ed"):
            if stem[-1] == stem[-2]:
                yield stem[:-1]
            yield stem + "e"


class Vocabulary:
    """All phrases of a domain's language, and what the names among them can stand for.

    `lists`: terminal -> its phrases, as in the grammar; `verbs`: the terminals that are verbs.
    """

    def __init__(self, lists: Mapping[str, Sequence[str]], verbs: frozenset[str], domain: Domain) -> None:
        self.verbs = verbs
        self._kinds: dict[Phrase, dict[str, None]] = {}
        self._things: dict[Phrase, tuple[str, ...]] = {}
        self._run_together: set[str] = set()
        self.recipes: dict[str, str] = {}
        self._silent_words: frozenset[str] = frozenset(lists["DETERMINER"])
        for kind, phrases in lists.items():
            for phrase in phrases:
                self._kinds.setdefault(tuple(phrase.split()), {})[kind] = None
        for name, spec in domain.objects.items():
            for alias in (name, *spec.aliases):
                self._add_thing(alias, name)
        tools = {name for name, spec in domain.objects.items() if spec.kind == "tool"}
        for words, names in self._things.items():
            self._kinds.setdefault(words, {})["TOOL" if tools.issuperset(names) else "OBJECT"] = None
        for recipe, entry in domain.recipes.items():
            for alias in (recipe, *entry.aliases):
                words = self._name_words(alias)
                self._kinds.setdefault(words, {})["RECIPE"] = None
                self.recipes[" ".join(words)] = recipe
        self._words = {word for phrase in self._kinds for word in phrase}
        self._longest = max(map(len, self._kinds))

    def _name_words(self, alias: str) -> Phrase:
        return tuple(w for w in normal_words(alias) if w not in self._silent_words)

    def _add_thing(self, alias: str, name: str) -> None:
        words = self._name_words(alias)
        # "bunbottom" is how a name is said by somebody who writes it as one word.
        if len(words) > 1:
            self._run_together.add("".join(words))
        for phrase in dict.fromkeys((words, ("".join(words),))):
            self._things[phrase] = (*self._things.get(phrase, ()), name)

    def things(self, text: str) -> tuple[str, ...]:
        """Names of the domain's objects that `text` (of a `Word`) can stand for; none for other words."""
        return tuple(dict.fromkeys(self._things.get(tuple(text.split()), ())))

    def words(self, sentence: str, offer: str) -> list[Word]:
        """The sentence as typed words, fillers dropped; `offer` ends the message about an unknown one."""
        plain = [self._base(word) for word in normal_words(sentence)]
        spoken = [w for w in plain if w not in self._silent_words]
        determined = [bool(i) and plain[i - 1] in self._silent_words for i, w in enumerate(plain)]
        determined = [d for d, w in zip(determined, plain, strict=True) if w not in self._silent_words]
        found: list[Word] = []
        at = 0
        while at < len(spoken):
            phrase = self._longest_at(spoken, determined, at)
            if phrase is None:
                # A word known only inside longer phrases may still be a form of one that stands alone.
                lemma = next((w for w in _lemmas(spoken[at]) if w in self._words), None)
                if lemma is None:
                    raise InstructionError(f"I do not know the word {self._quoted(spoken[at])}; {offer}")
                spoken[at] = lemma
                continue
            after = self._kinds.get((spoken[at + len(phrase)],), {}) if at + len(phrase) < len(spoken) else {}
            named = determined[at] or not self.verbs.isdisjoint(after)  # "stick reaches ham"
            kind = self._choose(phrase, found, named)
            if kind in _REFUSED:
                raise InstructionError(f"{_REFUSED[kind]}, not '{' '.join(phrase)}'")
            if kind not in _SILENT:
                found.append(Word(kind, " ".join(phrase)))
            at += len(phrase)
        return found

    def _base(self, word: str) -> str:
        if word in self._words:
            return word
        return next((lemma for lemma in _lemmas(word) if lemma in self._words), word)

    def _longest_at(self, words: list[str], determined: list[bool], at: int) -> Phrase | None:
        for length in range(min(self._longest, len(words) - at), 0, -1):
            phrase = tuple(words[at : at + length])
            # "on top bun" is on + top bun although "on top" is a phrase too: names are never cut.
            if phrase not in self._kinds or self._cuts_a_name(words, at, at + length):
                continue
            # "top the bun" is not the top bun: inside a name an article only follows "of".
            inside = range(at + 1, at + length)
            apart = any(determined[i] and words[i - 1] != "of" for i in inside)
            if not (apart and self._kinds[phrase].keys() & _DOMAIN_KINDS):
                return phrase
        return None

    def _cuts_a_name(self, words: list[str], start: int, end: int) -> bool:
        for inner in range(start + 1, end):
            for stop in range(end + 1, min(len(words), inner + self._longest) + 1):
                if not _UNCUTTABLE.isdisjoint(self._kinds.get(tuple(words[inner:stop]), ())):
                    return True
        return False

    def _choose(self, phrase: Phrase, before: list[Word], named: bool) -> str:
        """Of two meanings, the verb where a command may begin ("stick it ...", but "with the stick")."""
        kinds = self._kinds[phrase]
        verb = next((k for k in kinds if k in self.verbs), None)
        other = next((k for k in kinds if k not in self.verbs), None)
        if verb is None or other is None:
            return verb or other or ""
        for word in reversed(before):
            if word.kind in self.verbs or word.kind in ("RECIPE", "WITH", "ON", "FROM"):
                return other
            if word.kind in ("JOIN", "THEN", "BUT"):
                break
        return other if named else verb

    def _quoted(self, word: str) -> str:
        telling = _DOMAIN_KINDS | self.verbs
        said = [
            (p if _DOMAIN_KINDS & k.keys() else p[:1]) for p, k in self._kinds.items() if telling & k.keys()
        ]
        names = {w for p in said for w in p if len(w) > 2} - self._run_together
        swapped = sorted(n for n in names - {word} if sorted(n) == sorted(word))
        near = swapped or difflib.get_close_matches(word[:60], sorted(names - {word}), n=1, cutoff=0.72)
        return f"'{one_line(word, 40)}'" + (f" (did you mean '{near[0]}'?)" if near else "")
