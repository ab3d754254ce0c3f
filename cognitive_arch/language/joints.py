"""What holds a sentence together: connectors become AND, BREAK or nothing before the grammar sees them.

Whether "and" continues a list or begins a command shows only some words later; settled here, it leaves
a grammar that needs one word of look-ahead.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cognitive_arch.language.vocabulary import NAMES, Word

_AFTER_WITH = frozenset({"WITH", "WITHOUT", "RECIPE"})


def _ahead_is_command(words: Sequence[Word], at: int, verbs: frozenset[str]) -> bool:
    for word in words[at:]:
        if word.kind in ("JOIN", "THEN", "BUT"):
            return False
        if word.kind in verbs:
            return True
    return False


def _repair(words: Iterable[Word], verbs: frozenset[str]) -> list[Word]:
    """Settle the words whose part depends on the next one, so that the grammar needs no look-ahead."""
    given = list(words)
    done: list[Word] = []
    for here, word in enumerate(given):
        following = given[here + 1].kind if here + 1 < len(given) else ""
        named = following in NAMES or following == "HAND"
        kind = word.kind
        if kind == "TO":
            kind = "ON" if named or following == "RECIPE" else ""
        elif kind == "FILLING":
            kind = "NOTHING" if done and done[-1].kind == "WITHOUT" else ""
        elif (
            kind == "PRONOUN" and following in NAMES | {"RECIPE", "HAND"} and word.text not in ("it", "them")
        ):
            kind = ""  # "that ham"
        elif kind == "BUT":
            kind = "WITHOUT" if following in ("OBJECT", "TOOL") else "JOIN"
        elif kind == "ON" and not named and following != "RECIPE":
            kind = "ATOP"
        elif kind == "FROM" and done and done[-1].kind == "RECIPE":
            kind = "WITH"  # "a sandwich from ham and cheese"
        elif (kind == "FROM" and not named and following != "RECIPE") or (
            kind == "WITH" and following in verbs | _AFTER_WITH
        ):
            kind = ""
        elif kind == "ONLY":
            # As a mark it stands beside the phrase it limits: "with just bread" -> just, with bread.
            kind = ""
            if following == "OBJECT":
                done.insert(len(done) - (bool(done) and done[-1].kind == "WITH"), word)
            elif following in ("", "JOIN", "THEN") and done and done[-1].kind == "OBJECT":
                done.append(word)
        elif kind in ("MAKE", "WANT") and following in verbs:
            kind = ""  # "I want grab the ham"
        elif kind == "WITHOUT" and following in verbs:
            kind = "NOT"
        if kind:
            done.append(Word(kind, word.text))
    return done


def _joint(words: Sequence[Word], start: int, end: int, clause: Sequence[Word], verbs: frozenset[str]) -> str:
    """What the run of connectors `words[start:end]` means: AND in a list, BREAK between clauses, or ""."""
    if not clause or end == len(words) or clause[-1].kind in verbs:
        return ""
    strong = any(w.kind == "THEN" for w in words[start:end])
    following = words[end].kind
    spoken = any(w.kind in verbs for w in clause)
    opens = following in verbs or following in ("HAND", "WITH", "NOT")
    if following == "HAND" and end + 2 < len(words) and words[end + 2].kind in verbs:
        return "BREAK"  # "left hand: grab the ham, right hand: grab the cheese"
    if (spoken or opens) and _ahead_is_command(words, end, verbs):
        return "BREAK"
    if following not in NAMES and following != "RECIPE":
        return "BREAK" if strong and following in ("WITHOUT", "NOT", "HAND", "WITH") else ""
    last = clause[-1].kind
    if following == "RECIPE" and last == "OBJECT" and not strong:
        return ""  # "ham - sandwich"
    marker = clause[-2].kind if len(clause) > 1 else ""
    # "on the bun and ..." and "with the rake and ..." take one thing; what follows is a new clause.
    ended = marker in ("ON", "FROM") or (last == "TOOL" and marker == "WITH")
    return "AND" if last in NAMES and following in NAMES and not strong and not ended else "BREAK"


def _unspoken(word: Word, clause: Sequence[Word], done: Sequence[Word], verbs: frozenset[str]) -> str:
    """The connector somebody left out before `word`: "take the ham put it down", "ham cheese tomato"."""
    if word.kind in verbs:
        return "BREAK" if any(w.kind in verbs for w in clause) else ""
    placed = len(clause) > 1 and clause[-2].kind in ("ON", "FROM")
    return "AND" if word.kind == "OBJECT" and done and done[-1].kind == "OBJECT" and not placed else ""


def joined(words: Iterable[Word], verbs: frozenset[str]) -> list[Word]:
    """The words with every run of connectors replaced by AND, BREAK or nothing."""
    given = _repair(words, verbs)
    done: list[Word] = []
    clause: list[Word] = []
    at = 0
    while at < len(given):
        end = at
        while end < len(given) and given[end].kind in ("JOIN", "THEN"):
            end += 1
        if end == at:
            implied = _unspoken(given[at], clause, done, verbs)
            if implied:
                done.append(Word(implied, ","))
            if implied == "BREAK":
                clause = []
            clause.append(given[at])
            done.append(given[at])
            at += 1
            continue
        kind = _joint(given, at, end, clause, verbs)
        if kind:
            done.append(Word(kind, " ".join(w.text for w in given[at:end])))
        if kind == "BREAK":
            clause = []
        at = end
    return done
