"""Robustness of the instruction parser, its commands, and the grammar's own laws."""

from __future__ import annotations

import logging
import subprocess
import sys
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lark import Lark, logger

from cognitive_arch.domain import load_domain
from cognitive_arch.errors import InstructionError
from cognitive_arch.language.clauses import _Given, word_lists
from cognitive_arch.language.instruction import (
    MAX_LENGTH,
    Drop,
    Grasp,
    Make,
    Pull,
    Push,
    Put,
    Semantic,
    parse_instruction,
)
from cognitive_arch.language.semantic_memory import SemanticInstruction, SemanticMemory
from cognitive_arch.resources import grammar_text
from cognitive_arch.scenes import load_scene

DOMAIN = load_domain("sandwich")
KITCHEN = tuple(load_scene("kitchen").objects)
COMPLEX = tuple(load_scene("complex").objects)
PHRASES = sorted(
    {p for phrases in word_lists().values() for p in phrases}
    | {a for spec in DOMAIN.objects.values() for a in spec.aliases}
    | set(DOMAIN.objects)
    | {a for recipe in DOMAIN.recipes.values() for a in recipe.aliases}
    | {"sandwich", "pizza"}
)


def check_survives(sentence: str, scene: tuple[str, ...]) -> None:
    start, message = time.process_time(), ""
    try:
        first = parse_instruction(sentence, DOMAIN, scene)
        SemanticMemory(DOMAIN).expand(first, scene)
    except InstructionError as error:
        message = str(error)
    assert "\n" not in message
    assert len(message) < 600
    assert time.process_time() - start < 1


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=MAX_LENGTH + 20))
def test_any_text_is_understood_or_refused(text: str) -> None:
    check_survives(text, KITCHEN)


@settings(max_examples=1000, deadline=None)
@given(st.lists(st.sampled_from(PHRASES), max_size=14), st.sampled_from([KITCHEN, COMPLEX, ("Ham",), ()]))
def test_any_sequence_of_known_words_is_understood_or_refused(
    words: list[str], scene: tuple[str, ...]
) -> None:
    check_survives(" ".join(words), scene)


@pytest.mark.parametrize(
    "sentence",
    [
        "",
        "   ",
        "\n\t",
        "\x00\x07",
        "?!.,;",
        "ham " * 30_000,
        "\u202e\ufeff",
        "e\u0301" * 100,
        "((((",
        "😀",
        "'",
    ],
)
def test_odd_input_is_refused_in_one_line(sentence: str) -> None:
    with pytest.raises(InstructionError) as caught:
        parse_instruction(sentence, DOMAIN, KITCHEN)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_too_long_a_sentence_says_the_limit() -> None:
    with pytest.raises(InstructionError, match=f"{MAX_LENGTH} are the most"):
        parse_instruction("x" * 100_000, DOMAIN, KITCHEN)


def test_the_grammar_has_no_conflict(caplog: pytest.LogCaptureFixture) -> None:
    # Lark settles shift/reduce conflicts silently unless it logs for debugging.
    logger.addHandler(caplog.handler)
    level = logger.level
    logger.setLevel(logging.DEBUG)
    try:
        Lark(grammar_text("instruction"), parser="lalr", lexer=_Given, debug=True)
    finally:
        logger.setLevel(level)
        logger.removeHandler(caplog.handler)
    assert "onflict" not in caplog.text


def test_no_phrase_is_listed_twice_under_one_terminal() -> None:
    for kind, phrases in word_lists().items():
        assert len(set(phrases)) == len(phrases), kind


def test_importing_does_not_load_lark() -> None:
    code = "import sys, cognitive_arch.language.instruction; sys.exit('lark' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("sentence", "command"),
    [
        ("make a sandwich", Make("sandwich")),
        ("a ham sandwich without cheese", Make("sandwich", ("Ham",), ("Cheese",))),
        ("grasp the ham with your left hand", Grasp("Ham", "LeftHand")),
        ("put the ham on the bun", Put("Ham", "Bun-bottom")),
        ("put it on the bottom bun", Put(None, "Bun-bottom")),
        ("let go", Drop()),
        ("open your right hand", Drop(None, "RightHand")),
        ("pull the ham", Pull("Ham")),
        ("pull the ham with the stick", Pull("Ham", "Stick")),
        ("push the ham away with your right hand", Push("Ham", None, "RightHand")),
        ("Ham reach Bun-bottom", Semantic((("Ham", "reach", "Bun-bottom"),))),
    ],
)
def test_sentence_to_command(sentence: str, command: object) -> None:
    assert parse_instruction(sentence, DOMAIN, (*COMPLEX, "Cheese")).commands == (command,)


def _expand(sentence: str, scene: tuple[str, ...], held: dict[str, str]) -> list[str]:
    return [
        str(s) for s in SemanticMemory(DOMAIN).expand(parse_instruction(sentence, DOMAIN, scene), scene, held)
    ]


def test_what_is_held_is_not_grasped_again() -> None:
    assert _expand("put the ham on the bottom bun", KITCHEN, {"Ham": "LeftHand"}) == [
        "Ham reach Bun-bottom",
        "LeftHand put Ham",
    ]
    assert _expand("pull the ham", COMPLEX, {"Rake": "RightHand"}) == [
        "Rake reach Ham",
        "RightHand pull Ham",
    ]


def test_it_and_the_hand_stand_for_what_is_held() -> None:
    assert _expand("put it on the bun", KITCHEN, {"Ham": "LeftHand"}) == [
        "Ham reach Bun-bottom",
        "LeftHand put Ham",
    ]
    assert _expand("let go", KITCHEN, {"Ham": "LeftHand"}) == ["LeftHand drop Ham"]
    held = {"Ham": "LeftHand", "Cheese": "RightHand"}
    assert _expand("open your left hand", KITCHEN, held) == ["LeftHand drop Ham"]


def test_held_in_the_other_hand_is_refused() -> None:
    with pytest.raises(InstructionError, match="Ham is in LeftHand already"):
        _expand("grasp the ham with your right hand", KITCHEN, {"Ham": "LeftHand"})


def test_recipe_without_its_base_names_what_is_missing() -> None:
    with pytest.raises(InstructionError, match="no Bun-bottom in this scene; this scene has Bun-top, Ham"):
        _expand("make a ham sandwich", ("Ham", "Bun-top"), {})


def test_a_domain_brings_its_own_words() -> None:
    data = DOMAIN.model_dump()
    data["objects"]["Cucumber"] = {**data["objects"]["Tomato"], "aliases": ("cuke",)}
    data["recipes"]["sandwich"]["fillings"] += ("Cucumber",)
    domain = type(DOMAIN).model_validate(data)
    made = parse_instruction("a cuke sandwich", domain, (*KITCHEN, "Cucumber"))
    assert made.commands == (Make("sandwich", ("Cucumber",)),)


def test_semantic_instruction_reads_as_a_sentence() -> None:
    assert str(SemanticInstruction("hand", "grasp", "Ham")) == "hand grasp Ham"


def _refusal(sentence: str, scene: tuple[str, ...]) -> str:
    with pytest.raises(InstructionError) as caught:
        parse_instruction(sentence, DOMAIN, scene)
    return str(caught.value)


def test_what_there_is_is_told_only_where_something_is_unknown() -> None:
    assert "this scene has" not in _refusal("do not grasp the ham", KITCHEN)
    assert "I can grasp, put, drop them" in _refusal("grasp the hma", KITCHEN)
    assert "I can grasp, put, drop, pull, push them" in _refusal("grasp the hma", COMPLEX)


def test_a_word_is_suggested_only_if_it_is_close() -> None:
    assert "did you mean 'ham'" in _refusal("grasp the hma", KITCHEN)
    assert "did you mean" not in _refusal("where is the ham", KITCHEN)


def test_what_is_held_before_counts_for_no_hand() -> None:
    held = {"Ham": "LeftHand", "Cheese": "RightHand"}
    assert _expand("grasp the tomato", KITCHEN, held) == ["hand grasp Tomato"]
    assert _expand("put the ham down", KITCHEN, held) == ["LeftHand drop Ham"]


def test_a_recipe_keeps_the_hand_it_is_to_be_made_with() -> None:
    made = parse_instruction("make a ham sandwich with your right hand", DOMAIN, KITCHEN)
    assert made.commands == (Make("sandwich", ("Ham",), (), "RightHand"),)
