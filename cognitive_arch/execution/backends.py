"""The environments by name. Each is imported only when it is asked for, Drake above all."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from cognitive_arch.domain import Domain, Scene
from cognitive_arch.errors import BackendError, ConfigError, one_line, unknown
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.relational.rules import RuleSet

BACKENDS = ("drake", "symbolic")
REACH_MODELS: Mapping[str, tuple[str, ...]] = {  # what each backend can tell reach by, its own way first
    "drake": ("kinematic", "published"),
    "symbolic": ("published",),
}
PERCEPTIONS: Mapping[str, tuple[str, ...]] = {  # how the robot knows what is where, each one's own way first
    "drake": ("camera", "noisy-camera", "oracle"),
    "symbolic": ("oracle",),
}

AFFORDANCES = ("learned", "default", "none")
"""Where the robot knows from what tools are good for: what was learned of shapes; the domain's rules, and the
environment for which tool pulls; or nowhere, so that any tool may pull, at the rules' own numbers."""


def affordance_source(backend: str, perception: str | None = None, asked: str | None = None) -> str:
    """One of `AFFORDANCES`, or the file of a model of one's own (.json). None is `learned` for a robot that
    sees, `default` for others. Raises `ConfigError`."""
    if asked is None:
        return "default" if perception_source(backend, perception) == "oracle" else "learned"
    if asked not in AFFORDANCES and not asked.endswith((".json", ".json.gz")):
        known = unknown("source of affordances", asked, AFFORDANCES)
        raise ConfigError(f"{known}, or the file of `cogarch learn networks` (.json)")
    return asked


def reach_model(backend: str, asked: str | None = None) -> str:
    """How reach is told: `kinematic` by solving for the arms' joints, `published` by the constants of the
    scene (ch. 6 of the thesis). None is the backend's own way. Raises `ConfigError`."""
    return _choice("reach", REACH_MODELS, backend, asked)


def perception_source(backend: str, asked: str | None = None) -> str:
    """How the robot knows its surroundings: `camera` by its eyes, `noisy-camera` by eyes with
    the noise of a real camera, `oracle` by the simulation itself. None is
    the backend's own way. Raises `ConfigError`."""
    return _choice("perception", PERCEPTIONS, backend, asked)


def _choice(what: str, choices: Mapping[str, tuple[str, ...]], backend: str, asked: str | None) -> str:
    known = choices[backend]
    if asked is None:
        return known[0]
    if asked not in {name for names in choices.values() for name in names}:
        raise ConfigError(unknown(what, asked, choices["drake"]))
    if asked not in known:
        raise ConfigError(
            f"the {backend} backend has no {asked} {what}, for it has no body; valid: {', '.join(known)}"
        )
    return asked


def make_environment(
    backend: str,
    domain: Domain,
    scene: Scene,
    rules: RuleSet,
    *,
    noise: NoiseLevels,
    jitter: float = 0.0,
    record: bool = False,
    video: bool = False,
    reach: str | None = None,
    perception: str | None = None,
    quiet_release: bool = False,
    shapes_seen: bool = False,
) -> Environment:
    """An environment for one scene; raises `BackendError` for an unknown or unusable one.

    `rules` are the truth of the symbolic world; physics needs none. `record` keeps pictures and
    what else `save_artifacts` finishes, with `video` a video, too. `reach` and `perception` are among the
    backend's `REACH_MODELS` and `PERCEPTIONS`. `quiet_release` and `shapes_seen` are for the symbolic one
    (see there).
    """
    if backend not in BACKENDS:
        raise BackendError(unknown("backend", backend, BACKENDS))
    reach, perception = reach_model(backend, reach), perception_source(backend, perception)
    if backend == "symbolic":
        from cognitive_arch.execution.symbolic import SymbolicEnvironment

        return SymbolicEnvironment(domain, scene, rules, noise, jitter, quiet_release, shapes_seen)
    module = drake_module("sim.environment")
    environment: Environment = module.DrakeEnvironment(
        domain,
        scene,
        noise=asdict(noise),
        jitter=jitter,
        record=record,
        video=video,
        reach=reach,
        perception=perception,
    )
    return environment


def drake_module(name: str) -> Any:
    """A module of `sim`; raises `BackendError` where Drake is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise BackendError(
            f"the drake backend cannot be loaded ({one_line(error)}); "
            "install the packages drake and icub-models, or use --backend symbolic"
        ) from None
