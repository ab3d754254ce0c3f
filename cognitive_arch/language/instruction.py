"""Understanding a sentence: words -> clauses -> commands (thesis Sec. 6.4.1).

The thesis leaves this to PRAXICON; here it is a grammar (`grammar/instruction.lark`) over the words of
a domain. The same sentence over the same domain and objects always gives the same commands.
"""

from __future__ import annotations

from collections.abc import Sequence

from cognitive_arch.domain import Domain
from cognitive_arch.errors import InstructionError
from cognitive_arch.language.commands import (
    Command,
    Drop,
    Grasp,
    Instruction,
    Make,
    Pull,
    Push,
    Put,
    Semantic,
)

__all__ = [
    "Command",
    "Drop",
    "Grasp",
    "Instruction",
    "Make",
    "Pull",
    "Push",
    "Put",
    "Semantic",
    "parse_instruction",
]

MAX_LENGTH = 500


def offer(domain: Domain, scene_objects: Sequence[str]) -> str:
    """What can be said here, for the end of a message."""
    tools = {name for name, spec in domain.objects.items() if spec.kind == "tool"}
    verbs = "grasp, put, drop" + (", pull, push" if tools.intersection(scene_objects) else "")
    make = f" or make: {', '.join(sorted(domain.recipes))}" if domain.recipes else ""
    return f"this scene has {', '.join(sorted(scene_objects)) or 'nothing'}; I can {verbs} them{make}"


def parse_instruction(sentence: str, domain: Domain, scene_objects: Sequence[str]) -> Instruction:
    """Understand `sentence`, spoken in a scene of `domain` that holds `scene_objects`.

    Raises `InstructionError`, in one line, for a sentence that is empty or too long, that holds an
    unknown word, that speaks of what is not in the scene, or that leaves open what is meant.
    """
    # Lark takes longer to import than all the rest; a program that never parses does not pay for it.
    from cognitive_arch.language.clauses import clauses, verb_kinds, word_lists
    from cognitive_arch.language.interpretation import Interpreter
    from cognitive_arch.language.joints import joined
    from cognitive_arch.language.vocabulary import NothingUnderstood, Vocabulary

    if len(sentence) > MAX_LENGTH:
        raise InstructionError(
            f"the instruction has {len(sentence)} characters; {MAX_LENGTH} are the most, say it in less"
        )
    choices = offer(domain, scene_objects)
    vocabulary = Vocabulary(word_lists(), verb_kinds(), domain)
    words = joined(vocabulary.words(sentence, choices), vocabulary.verbs)
    if not words:
        raise InstructionError(f"the instruction is empty; {choices}")
    try:
        commands = Interpreter(vocabulary, domain, scene_objects).commands(clauses(words))
    except NothingUnderstood as error:
        raise InstructionError(f"{error}; {choices}") from None
    return Instruction(sentence, commands)
