"""The environments by name. Each is imported only when it is asked for, Drake above all."""

from __future__ import annotations

import importlib
from dataclasses import asdict
from typing import Any

from cognitive_arch.domain import Domain, Scene
from cognitive_arch.errors import BackendError, one_line, unknown
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.relational.rules import RuleSet

BACKENDS = ("drake", "symbolic")


def make_environment(
    backend: str,
    domain: Domain,
    scene: Scene,
    rules: RuleSet,
    *,
    noise: NoiseLevels,
    jitter: float = 0.0,
    record: bool = False,
) -> Environment:
    """An environment for one scene; raises `BackendError` for an unknown or unusable one.

    `rules` are the truth of the symbolic world; physics needs none. `record` keeps what
    `save_artifacts` needs.
    """
    if backend == "symbolic":
        from cognitive_arch.execution.symbolic import SymbolicEnvironment

        return SymbolicEnvironment(domain, scene, rules, noise, jitter)
    if backend != "drake":
        raise BackendError(unknown("backend", backend, BACKENDS))
    try:
        module: Any = importlib.import_module("sim.environment")
    except ImportError as error:
        raise BackendError(
            f"the drake backend cannot be loaded ({one_line(error)}); "
            "install the packages drake and icub-models, or use --backend symbolic"
        ) from None
    environment: Environment = module.DrakeEnvironment(
        domain, scene, noise=asdict(noise), jitter=jitter, record=record
    )
    return environment
