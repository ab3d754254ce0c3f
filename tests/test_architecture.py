"""The rules of the folder plan: who may import whom, and what every domain must hold."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
import yaml

from cognitive_arch import domain as domains
from cognitive_arch import scenes
from cognitive_arch.execution.environment import Outcome
from cognitive_arch.execution.symbolic import SymbolicEnvironment
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.relational.symbols import satisfied
from cognitive_arch.world.anchoring import WorldModel
from tests.conftest import action, literals

ROOT = Path(__file__).resolve().parents[1]
FOUNDATION = {
    "errors",
    "resources",
    "shapes",
    "footprint",
    "domain",
    "random_scenes",
    "scenes",
    "outside",
    "kernel_cache",
}
# Each package may import those named here, the foundation, and itself.
ALLOWED = {
    "relational": set(),
    "world": {"relational"},
    "planning": {"relational", "world"},
    "language": {"relational", "world"},
    "perception": {"world"},
    "affordances": {"perception"},
    "execution": {"relational", "world", "planning", "perception", "affordances"},
    "runlog": {"relational", "world", "planning", "execution"},
    "evaluation": {
        "relational",
        "world",
        "planning",
        "perception",
        "affordances",
        "execution",
        "runlog",
        "runs",
        "session",
    },
    "verbs": {
        "relational",
        "world",
        "planning",
        "language",
        "perception",
        "affordances",
        "execution",
        "runlog",
        "evaluation",
        "report",
        "runs",
        "session",
    },
}


def imports(path: Path, top_level: bool = False) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = tree.body if top_level else list(ast.walk(tree))
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def test_cognitive_arch_never_imports_pydrake() -> None:
    for path in modules("cognitive_arch"):
        assert not [name for name in imports(path) if name.split(".")[0] == "pydrake"], path
        assert not [name for name in imports(path, top_level=True) if name.split(".")[0] == "sim"], path


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_imports_point_one_way(package: str) -> None:
    for path in modules(f"cognitive_arch/{package}"):
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == "cognitive_arch" and len(parts) > 1:
                assert parts[1] in ALLOWED[package] | FOUNDATION | {package}, f"{path} imports {name}"


def test_session_knows_nothing_of_evaluation() -> None:
    """Evaluations run sessions, so no session may need one."""
    for path in (
        *modules("cognitive_arch/execution"),
        ROOT / "cognitive_arch/session.py",
        ROOT / "cognitive_arch/runs.py",
    ):
        assert not [name for name in imports(path) if name.startswith("cognitive_arch.evaluation")], path


def test_every_package_has_its_rule() -> None:
    packages = {p.parent.name for p in (ROOT / "cognitive_arch").glob("*/__init__.py")}
    assert packages <= set(ALLOWED)


@pytest.mark.parametrize("name", domains.domain_names())
def test_domains_load(name: str) -> None:
    domain = domains.load_domain(name)
    assert domain.name == name
    rules = load_rules(domain.rules_path)
    assert {r.action for r in rules.rules} == set(domain.capabilities)


@pytest.mark.parametrize("name", sorted(scenes.scene_paths()))
def test_scenes_load(name: str) -> None:
    assert scenes.load_scene(name).name == name


def plans(kind: str) -> list[dict[str, object]]:
    return [
        plan
        for path in sorted((ROOT / "domains").glob(f"*/plans/{kind}.yaml"))
        for plan in yaml.safe_load(path.read_text(encoding="utf-8"))
    ]


def world_of(plan: dict[str, object]) -> SymbolicEnvironment:
    scene = scenes.load_scene(str(plan["scene"]))
    domain = domains.load_domain(scene.domain)
    environment = SymbolicEnvironment(domain, scene, load_rules(domain.rules_path))
    environment.reset(0)
    return environment


@pytest.mark.parametrize("plan", plans("valid"))
def test_valid_plans_reach_their_goal(plan: dict[str, list[str]]) -> None:
    environment = world_of(plan)
    for call in plan["actions"]:
        assert environment.execute(action(call)).outcome is Outcome.SUCCESS, call
    assert satisfied(literals(*plan["goal"]), WorldModel().update(environment.observe()).atoms())


@pytest.mark.parametrize("plan", plans("invalid"))
def test_invalid_plans_fail_for_their_reason(plan: dict[str, list[str]]) -> None:
    environment = world_of(plan)
    for call in plan["actions"][:-1]:
        assert environment.execute(action(call)).outcome is Outcome.SUCCESS, call
    result = environment.execute(action(plan["actions"][-1]))
    assert (result.outcome, str(result.reason)) == (Outcome.FAILURE, plan["reason"])
