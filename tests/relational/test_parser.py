from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.domain import load_domain
from cognitive_arch.errors import RuleError
from cognitive_arch.relational.parser import load_rules, parse_rules
from cognitive_arch.relational.rules import RuleSet

GOOD = load_domain("sandwich").rules_path.read_text(encoding="utf-8")


def test_table_16(rules: RuleSet) -> None:
    first = {r.action: r.outcomes[0].probability for r in rules.rules}
    assert first == {"push": 0.85, "pull": 0.85, "graspWith": 0.95, "dropWith": 0.95, "putOnWith": 0.70}
    put = rules.rule_for("putOnWith")
    assert [o.probability for o in put.outcomes] == [0.70, 0.15]
    assert [str(c) for c in rules.rule_for("graspWith").context] == [
        "not isHand(obj)",
        "isClear(hand)",
        "isHand(hand)",
        "reachableWith(obj, hand)",
        "not on(ALL, obj)",
        "not inHand(obj, OTHERHAND)",
    ]


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("0.70", "0.60", 48, "sum to 0.9, not to 1"),
        ("isClear(hand),", "isCleer(hand),", 35, "did you mean isClear?"),
        ("rule push(obj", "rul push(obj", 19, "cannot read"),
        ("on(ALL, obj)", "on(ALL, objj)", 35, "did you mean obj?"),
        ("inHand(tool, hand)", "inHand(tool)", 21, "takes 2 arguments"),
        ("inHand(tool, hand)", "inHand(tool hand)", 21, "cannot read"),
        ("hand: hand)", "hand: paw)", 19, "unknown type 'paw'"),
        ("hand: hand)", "tool: hand)", 19, "two parameters of one name"),
        ("type tool < object", "type hand < object", 10, "declared twice"),
        ("    0.15 noise", "    1.15 noise", 24, "not a probability"),
        ("inHand(tool, hand)", "inHand(hand, hand)", 21, "the predicate asks for object"),
    ],
)
def test_errors_name_the_line(old: str, new: str, line: int, says: str) -> None:
    assert old in GOOD
    with pytest.raises(RuleError) as caught:
        parse_rules(GOOD.replace(old, new, 1), "my.nid")
    message = str(caught.value)
    assert message.startswith(f"my.nid, line {line}: ")
    assert says in message
    assert "\n" not in message


@pytest.mark.parametrize("text", ["", "# nothing\n", "type a\n", GOOD[:1200], "\0\1" * 1000, "rule"])
def test_useless_files_are_rejected(text: str) -> None:
    with pytest.raises(RuleError, match="<rules>"):
        parse_rules(text)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.characters(), st.integers(0, 40))
def test_a_damaged_file_parses_or_says_so(at: int, char: str, cut: int) -> None:
    message = ""
    try:
        parse_rules(GOOD[:at] + char + GOOD[at + cut :])
    except RuleError as error:
        message = str(error)
    assert "\n" not in message


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(RuleError, match="no rules file at"):
        load_rules(tmp_path / "none.nid")
    large = tmp_path / "large.nid"
    large.write_bytes(b"x" * 2_000_000)
    with pytest.raises(RuleError, match="at most"):
        load_rules(large)
    (tmp_path / "binary.nid").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RuleError, match="cannot read"):
        load_rules(tmp_path / "binary.nid")


def test_rules_without_context() -> None:
    rules = parse_rules("type t\npredicate p(t)\nrule act(x: t)\n  outcomes\n    1 p(x)\n")
    assert rules.rules[0].context == ()
