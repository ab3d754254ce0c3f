"""Scenes from a seed: things of a domain at random places, the same ones for the same seed.

On the command line `random:SEED[:DOMAIN[:NUMBER]]` stands for such a scene.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from cognitive_arch.domain import Domain, ObjectSpec, Placement, Scene, domain_names, load_domain
from cognitive_arch.errors import ConfigError, one_line, unknown
from cognitive_arch.footprint import Capsule, footprint, smallest_gap

FORM = "random:SEED[:DOMAIN[:NUMBER]], as in random:7 or random:7:toys"
ROOM = 0.030  # m between two things: fingers fit in
PLACES_X, PLACES_Y = (-0.70, -0.26), (-0.26, 0.26)  # m; where hands get, or tools
# A tool lies to one side with its handle where that side's hand takes it, pointing to the robot.
HANDLE = 0.03  # m from a tool's end, where it is held
HANDLES_X, HANDLES_Y = (-0.33, -0.27), (0.20, 0.29)  # m; y to the left or to the right
TOOL_TURN = 0.25  # rad
TRIES = 200


def is_random(name: str) -> bool:
    """Whether a scene's name asks for a random one."""
    return name == "random" or name.startswith("random:")


def scene_from_name(name: str) -> Scene:
    """The scene that `random:SEED[:DOMAIN[:NUMBER]]` stands for; raises `ConfigError`."""
    match = re.fullmatch(r"random:([0-9]{1,18})(?::([^:]*))?(?::([0-9]{1,4}))?", name, re.ASCII)
    if match is None:
        raise ConfigError(f"scene '{one_line(name)}' cannot be read; valid: {FORM}")
    seed, domain, number = match.groups()
    if domain is not None and domain not in domain_names():
        raise ConfigError(f"scene '{one_line(name)}': {unknown('domain', domain, domain_names())}")
    known = load_domain(domain or "sandwich")
    return random_scene(known, int(seed), None if number is None else int(number))


def random_scene(domain: Domain, seed: int, number: int | None = None) -> Scene:
    """`number` things of the domain (all that it has if None) and all its tools, placed at random.

    The same arguments give the same scene. Everything lies flat on the table, at least `ROOM` apart, with
    tools' handles within reach; other things may lie so far away that it takes a tool to get them.
    """
    rng = np.random.default_rng(seed)
    tools = sorted(name for name, spec in domain.objects.items() if spec.kind == "tool")
    others = sorted(set(domain.objects) - set(tools))
    if number is not None and not 1 <= number <= len(others):
        raise ConfigError(
            f"{number} things at random is out of range; valid in {domain.name}: 1 to {len(others)}"
        )
    chosen = sorted(rng.choice(others, number or len(others), replace=False))
    for _ in range(TRIES):
        placed = _placed(domain, [*tools, *map(str, chosen)], rng)
        if placed is not None:
            break
    else:
        raise ConfigError(f"the things of domain {domain.name} do not fit on the table; valid: fewer of them")
    parts = ["random", str(seed), *([domain.name] if domain.name != "sandwich" or number else [])]
    return Scene(
        name="-".join([*parts, *([str(number)] if number else [])]),
        title=f"{len(chosen)} things of domain {domain.name} at random",
        domain=domain.name,
        objects=placed,
    )


def _placed(domain: Domain, names: Sequence[str], rng: np.random.Generator) -> dict[str, Placement] | None:
    """A place for each thing, in this order; None if one of them finds none."""
    placed: dict[str, Placement] = {}
    taken: list[Capsule] = []
    for name in names:
        spec = domain.objects[name]
        for _ in range(TRIES):
            placement = _drawn(spec, rng)
            own = footprint(spec.shape, placement.position, placement.yaw)
            if smallest_gap(own, taken) >= ROOM:
                break
        else:
            return None
        placed[name] = placement
        taken += own
    return placed


def _drawn(spec: ObjectSpec, rng: np.random.Generator) -> Placement:
    """Somewhere on the table; of a tool it is the handle that is drawn."""
    if spec.shape.type != "tool":
        x, y = rng.uniform(*PLACES_X), rng.uniform(*PLACES_Y)
        return Placement(position=(_mm(x), _mm(y)), yaw=round(float(rng.uniform(-math.pi, math.pi)), 3))
    side = float(rng.choice((-1.0, 1.0)))
    x, y = rng.uniform(*HANDLES_X), side * rng.uniform(*HANDLES_Y)
    yaw = round(float(rng.uniform(-TOOL_TURN, TOOL_TURN)), 3)
    along = spec.shape.length / 2 - HANDLE
    position = (_mm(x - along * math.cos(yaw)), _mm(y - along * math.sin(yaw)))
    return Placement(position=position, yaw=yaw, turn=TOOL_TURN)


def _mm(metres: float) -> float:
    """To a millimetre, as a person would write it into a scene file."""
    return round(float(metres), 3)
