"""Scenes by name: those of the domains' folders, files of one's own, and random ones."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from cognitive_arch import random_scenes, resources
from cognitive_arch.domain import Domain, Scene, explain_invalid, load_domain, read_yaml
from cognitive_arch.errors import ConfigError, unknown
from cognitive_arch.outside import check_events


def scene_paths() -> dict[str, Path]:
    """Scenes that come with the installation: name -> file, sorted by name."""
    paths = sorted(resources.domains_dir().glob("*/scenes/*.yaml"))
    return {p.stem: p for p in paths}


def load_scene(name_or_path: str) -> Scene:
    """Read a scene by its name or from a file (anything with a slash or ending in .yaml), or make the
    one that `random:SEED` stands for (see `random_scenes`).

    Raises `ConfigError` if there is none, or it is malformed, or speaks of objects its domain does not
    know.
    """
    if random_scenes.is_random(name_or_path):
        return random_scenes.scene_from_name(name_or_path)
    known = scene_paths()
    if name_or_path in known:
        path = known[name_or_path]
    elif name_or_path.endswith((".yaml", ".yml")) or "/" in name_or_path:
        path = Path(name_or_path)
    else:
        raise ConfigError(
            unknown("scene", name_or_path, known) + f", {random_scenes.FORM}, or the path of a .yaml file"
        )
    try:
        scene = Scene.model_validate(read_yaml(path, "scene"))
    except ValidationError as error:
        raise explain_invalid(error, path, Scene) from None
    known_before = load_domain(scene.domain).objects
    for name in scene.strangers:
        if name in known_before:
            raise ConfigError(f"{path}: {name} is no stranger: domain {scene.domain} knows it")
    domain = domain_of(scene)
    for name in scene.objects:
        if name not in domain.objects:
            raise ConfigError(f"{path}: {unknown('object', name, domain.objects)}")
    try:
        check_events(scene.events, scene.objects, domain.objects)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    return scene


def domain_of(scene: Scene) -> Domain:
    """What is known in a scene: its domain, and what shapes its strangers have."""
    return load_domain(scene.domain).with_strangers(scene.strangers)
