"""The sample sentences beside the grammar: what is understood, and what is refused and why."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from cognitive_arch import resources
from cognitive_arch.domain import load_domain
from cognitive_arch.errors import InstructionError
from cognitive_arch.language.instruction import parse_instruction
from cognitive_arch.language.semantic_memory import SemanticMemory
from cognitive_arch.scenes import load_scene

DOMAIN = load_domain("sandwich")


def _samples(kind: str, field: str) -> list[Any]:
    path = resources.data_root() / "grammar" / f"instruction.{kind}.yaml"
    groups = yaml.safe_load(path.read_text(encoding="utf-8"))
    return [pytest.param(g["scene"], say, g[field], id=say[:60]) for g in groups for say in g["say"]]


def _understand(sentence: str, scene: str) -> str:
    objects = tuple(load_scene(scene).objects)
    instruction = parse_instruction(sentence, DOMAIN, objects)
    return ", ".join(str(step) for step in SemanticMemory(DOMAIN).expand(instruction, objects))


@pytest.mark.parametrize(("scene", "sentence", "gives"), _samples("accepted", "gives"))
def test_accepted_sentence_gives_these_steps(scene: str, sentence: str, gives: str) -> None:
    assert _understand(sentence, scene) == gives


@pytest.mark.parametrize(("scene", "sentence", "gives"), _samples("accepted", "gives"))
def test_semantic_form_is_an_instruction_itself(scene: str, sentence: str, gives: str) -> None:
    if " reach " in gives:
        assert _understand(gives, scene) == gives


@pytest.mark.parametrize(("scene", "sentence", "because"), _samples("rejected", "because"))
def test_rejected_sentence_says_why_in_one_line(scene: str, sentence: str, because: str) -> None:
    with pytest.raises(InstructionError) as caught:
        _understand(sentence, scene)
    message = str(caught.value)
    assert because in message
    assert "\n" not in message
