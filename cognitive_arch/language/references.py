"""Which things of a scene are meant: names, alternatives, shared names such as "bun", and "it"."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from cognitive_arch.domain import Domain
from cognitive_arch.errors import InstructionError
from cognitive_arch.language.clauses import Mention
from cognitive_arch.language.vocabulary import Vocabulary


class References:
    """Resolves mentions and remembers what was spoken of."""

    def __init__(self, vocabulary: Vocabulary, domain: Domain, scene_objects: Sequence[str]) -> None:
        self._vocabulary = vocabulary
        self._domain = domain
        self.scene = tuple(dict.fromkeys(scene_objects))
        self.tools = tuple(n for n in self.scene if self.is_tool(n))
        self.bases = frozenset(n for r in domain.recipes.values() for n in r.base)
        self.lids = frozenset(n for r in domain.recipes.values() for n in r.lid)
        self.moved: tuple[str, ...] = ()
        self.stack_top: str | None = None
        self._spoken: list[str] = []

    def is_tool(self, name: str) -> bool:
        return name in self._domain.objects and self._domain.objects[name].kind == "tool"

    def candidates(self, mention: Mention) -> tuple[str, ...]:
        """Everything in the domain `mention` may stand for, the first alternative first."""
        return tuple(n for word in mention.choices for n in self._vocabulary.things(word.text))

    def note(self, *names: str) -> None:
        """Remember things spoken of, the last one best."""
        self._spoken += names

    def acted_on(self, *names: str) -> None:
        """Remember what "it" and "them" mean from here on."""
        self.moved = names
        self.note(*names)

    def named(self, mention: Mention, prefer: Collection[str] = (), avoid: Collection[str] = ()) -> str:
        """The one thing meant. `prefer` settles a shared name, `avoid` never fits one.

        Raises `InstructionError` if it is not in the scene, or several fit equally well.
        """
        if mention.kind not in ("OBJECT", "TOOL"):
            raise InstructionError(f"I do not know what '{mention.text}' stands for here; name the thing")
        for word in mention.choices:
            names = self._vocabulary.things(word.text)
            here = [n for n in names if n in self.scene]
            if len(here) > 1:
                here = [n for n in here if n not in avoid] or here
                here = [n for n in here if n in prefer] or here
            if len(here) > 1:
                # "pull the top bun closer, then grasp the bun": the one just spoken of.
                here = [n for n in reversed(self._spoken) if n in here][:1] or here
            if len(here) > 1:
                raise InstructionError(f"'{word.text}' could be {' or '.join(here)}; say which of them")
            if here:
                self.note(here[0])
                return here[0]
        missing = " or ".join(dict.fromkeys(self.candidates(mention)))
        raise InstructionError(f"there is no {missing} in this scene; it has {', '.join(sorted(self.scene))}")

    def there(self, mention: Mention) -> None:
        """Raise `InstructionError` unless something `mention` may stand for is in the scene."""
        if not set(self.candidates(mention)) & set(self.scene):
            self.named(mention)

    def pronoun(self, mention: Mention) -> tuple[str, ...]:
        """What "it" or "them" means: what was acted on last, nothing if nothing was."""
        if mention.text in ("it", "that", "this", "that one"):
            return self.moved[-1:]
        return self.moved

    def several(
        self, mentions: Sequence[Mention], prefer: Collection[str] = (), avoid: Collection[str] = ()
    ) -> list[str]:
        """The things meant by a list, in the order named, each once; "bun and bun" is both."""
        found: list[str] = []
        for mention in mentions:
            if mention.kind == "PRONOUN":
                found += [n for n in self.pronoun(mention) if n not in found]
            else:
                name = self.named(mention, prefer, {*avoid, *found})
                if name not in found:
                    found.append(name)
        return found

    def target(self, mention: Mention, moving: Collection[str] = ()) -> str:
        """What something is put on; a bare "bun" is the one that lies below."""
        if mention.kind == "PRONOUN":
            below = self.stack_top or next(iter(self.moved[-1:]), None)
            if below is None and mention.text in self._vocabulary.recipes:
                below = next((n for n in self.scene if n in self.bases and n not in moving), None)
            if below is None:
                raise InstructionError(f"I do not know what '{mention.text}' is; name the thing")
            return below
        return self.named(mention, prefer=self.bases, avoid=moving)

    def tool(self, mention: Mention) -> str:
        """A tool by name, or by "it" if that was one."""
        name = next(iter(self.pronoun(mention)), "") if mention.kind == "PRONOUN" else ""
        if not name:
            pullers = [n for n in self.tools if self._domain.objects[n].may_pull]
            name = self.named(mention, prefer=pullers)
        if not self.is_tool(name):
            there = ", ".join(self.tools) or "none"
            raise InstructionError(f"{name} is not a tool; the tools of this scene: {there}")
        return name
