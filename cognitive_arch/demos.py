"""Named scenarios: a sentence, a scene and what happens meanwhile, with a word on what to look at.

They lie in `domains/<name>/demos.yaml`; whoever adds one there need not touch the code.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError

from cognitive_arch import resources
from cognitive_arch.domain import event_from_text, explain_invalid, read_yaml
from cognitive_arch.errors import ConfigError, unknown
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.session import RunConfig


class Demo(BaseModel):
    """One scenario; `succeeds` says whether the goal is reached in the end."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    title: str
    sentence: str
    look: str
    scene: str
    backend: str = "drake"
    noise: str = "0"
    heuristics: str = "all"
    jitter: float = 0.0
    affordances: str | None = None
    events: tuple[Annotated[OutsideEvent, BeforeValidator(event_from_text)], ...] = ()
    succeeds: bool = True

    def config(
        self,
        backend: str | None = None,
        seed: int = 0,
        record: bool = True,
        video: bool = False,
        perception: str | None = None,
    ) -> RunConfig:
        """How to run it; raises `ConfigError` for settings that cannot be."""
        return RunConfig(
            scene=self.scene,
            backend=self.backend if backend is None else backend,
            noise=NoiseLevels.parse(self.noise),
            heuristics=Heuristics.parse(self.heuristics),
            seed=seed,
            jitter=self.jitter,
            record=record,
            video=video,
            perception=perception,
            affordances=self.affordances,
            events=self.events,
        )

    def command(self, config: RunConfig) -> str:
        """The same as a `cogarch run`, to vary it."""
        words = ["cogarch", "run", self.sentence, "--scene", self.scene, "--backend", config.backend]
        for option, value, default in (
            ("--noise", self.noise, "0"),
            ("--heuristics", self.heuristics, "all"),
            ("--jitter", self.jitter, 0.0),
            ("--seed", config.seed, 0),
            ("--affordances", self.affordances, None),
        ):
            words += [] if value == default else [option, str(value)]
        for event in self.events:
            words += ["--event", str(event)]
        return shlex.join(words)


@dataclass(frozen=True, slots=True)
class DemoList:
    """All demos by name."""

    demos: Mapping[str, Demo]

    def find(self, name: str) -> Demo:
        """The demo called `name`; raises `ConfigError` with the names there are."""
        if name not in self.demos:
            raise ConfigError(unknown("demo", name, self.demos))
        return self.demos[name]

    def to_json(self) -> dict[str, Any]:
        """For `demo --json` without a name."""
        return {
            "demos": [
                {"name": name, **demo.model_dump(), "events": [str(event) for event in demo.events]}
                for name, demo in self.demos.items()
            ]
        }

    def __str__(self) -> str:
        width = max(map(len, self.demos), default=0)
        return "\n".join(f"{name:<{width}}  {demo.title}" for name, demo in self.demos.items())


_Name = Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")]
_FILE = TypeAdapter(dict[_Name, Demo])


def load_demos() -> DemoList:
    """The demos of all domains, in the order of their files; raises `ConfigError` naming file and field."""
    found: dict[str, Demo] = {}
    for path in sorted(resources.domains_dir().glob("*/demos.yaml")):
        for name, demo in read_demos(path).items():
            if name in found:
                raise ConfigError(f"{path}: there are two demos called {name}")
            found[name] = demo
    return DemoList(found)


def read_demos(path: Path) -> dict[str, Demo]:
    """The demos of one file, in its order."""
    try:
        return _FILE.validate_python(read_yaml(path, "demos"))
    except ValidationError as error:
        raise explain_invalid(error, path, Demo) from None
