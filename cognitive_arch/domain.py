"""Domains and scenes: folders of YAML, checked when they are read.

A domain (`domains/<name>/`) holds `domain.yaml` (things, their names and shapes, recipes), `rules.nid`
and `scenes/*.yaml`. Everything here is frozen data; nothing acts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from cognitive_arch import resources
from cognitive_arch.errors import ConfigError, one_line, unknown
from cognitive_arch.footprint import footprint, outer_radius, smallest_gap
from cognitive_arch.outside import Happening, OutsideEvent, check_events
from cognitive_arch.shapes import Frozen, Shape
from cognitive_arch.world.observation import HANDS

MIN_DISTANCE = 0.07  # metres between the centres of two objects that lie side by side

Name = Annotated[str, Field(pattern=r"^[A-Z][A-Za-z0-9]*(-[A-Za-z0-9]+)*$")]


class ObjectSpec(Frozen):
    """A thing the domain knows. `can_pull` is what is known of a tool, None if nobody told."""

    kind: Literal["object", "tool"] = "object"
    aliases: tuple[str, ...] = ()
    shape: Shape
    mass: Annotated[float, Field(gt=0, le=5)]
    color: tuple[float, float, float]
    can_pull: bool | None = None

    @model_validator(mode="after")
    def _tools_have_a_shaft(self) -> ObjectSpec:
        if self.kind == "tool" and self.shape.type != "tool":
            raise ValueError(f"a thing of kind tool needs a shape of type tool, this is a {self.shape.type}")
        return self

    @property
    def may_pull(self) -> bool:
        """Whether it is a tool of which it is not known that it cannot pull."""
        return self.kind == "tool" and self.can_pull is not False


class Recipe(Frozen):
    """What a thing is made of, from the bottom up; each slot lists what may fill it, best first."""

    aliases: tuple[str, ...] = ()
    base: tuple[Name, ...]
    fillings: tuple[Name, ...]
    default: tuple[Name, ...]
    lid: tuple[Name, ...] = ()


class Domain(Frozen):
    """One `domain.yaml`."""

    name: str
    title: str
    objects: dict[Name, ObjectSpec]
    recipes: dict[str, Recipe] = Field(default_factory=dict)
    capabilities: dict[str, Literal["arm", "pull", "push"]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _recipes_speak_of_known_things(self) -> Domain:
        for recipe in self.recipes.values():
            for name in (*recipe.base, *recipe.fillings, *recipe.default, *recipe.lid):
                if name not in self.objects:
                    raise ValueError(unknown("object in a recipe", name, self.objects))
        return self

    def with_strangers(self, strangers: Mapping[str, ObjectSpec]) -> Domain:
        """The domain and things besides, which only one scene has; itself if there are none."""
        return self.model_copy(update={"objects": {**self.objects, **strangers}}) if strangers else self

    @property
    def folder(self) -> Path:
        return resources.domains_dir() / self.name

    @property
    def rules_path(self) -> Path:
        return self.folder / "rules.nid"

    @property
    def recogniser_path(self) -> Path:
        """What was learnt of how its objects look."""
        return self.folder / "recogniser.npz"


class Placement(Frozen):
    """Where an object lies: centre on the table (metres) and yaw (radians).

    `turn` is how far jitter may turn it from there (radians): a tool lies with its handle within reach.
    """

    position: tuple[float, float]
    yaw: float = 0.0
    turn: Annotated[float, Field(ge=0, le=math.pi)] = math.pi

    @field_validator("position")
    @classmethod
    def _finite(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not all(math.isfinite(v) and abs(v) <= 2 for v in value):
            raise ValueError("a position is two finite numbers of metres, at most 2 from the robot")
        return value


class Table(Frozen):
    """The table's top, metres above the root frame's origin."""

    height: Annotated[float, Field(ge=-0.3, le=0.1)] = -0.096


class ReachLimits(Frozen):
    """Published reach constants (metres), used where no kinematic model answers, and to compare with it.

    A place is within reach if x >= `min_x`; y < -`side` only the left arm gets there, y > `side` only
    the right one. Any tool adds `tool`.
    """

    min_x: Annotated[float, Field(ge=-2, le=0)] = -0.49
    side: Annotated[float, Field(ge=0)] = 0.15
    tool: Annotated[float, Field(ge=0, le=1)] = 0.30

    def hands(self, x: float, y: float) -> tuple[str, ...]:
        """The hands that get to (x, y), metres."""
        if x < self.min_x:
            return ()
        left, right = y <= self.side, y >= -self.side
        return tuple(hand for hand, ok in zip(HANDS, (left, right), strict=True) if ok)

    def with_tool(self, x: float) -> bool:
        """Whether a tool gets there."""
        return x >= self.min_x - self.tool


def event_from_text(value: object) -> OutsideEvent:
    """An event of a scene file: the text that the command line takes, too."""
    if isinstance(value, OutsideEvent):
        return value
    if not isinstance(value, str):
        raise ValueError(f"an event is text such as 3:remove:Tomato, this is {type(value).__name__}")
    try:
        return OutsideEvent.parse(value)
    except ConfigError as error:
        raise ValueError(str(error)) from None


class Scene(Frozen):
    """One `scenes/*.yaml`: which objects lie where when an episode starts, and what happens meanwhile.

    `strangers` are things of which the domain knows nothing: they have a shape, and no more.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,59}$")]
    title: str = ""
    domain: str = "sandwich"
    table: Table = Table()
    reach: ReachLimits = ReachLimits()
    objects: dict[Name, Placement] = Field(min_length=1)
    strangers: dict[Name, ObjectSpec] = Field(default_factory=dict, max_length=20)
    events: tuple[Annotated[OutsideEvent, BeforeValidator(event_from_text)], ...] = Field(
        default=(), max_length=100
    )

    @property
    def things(self) -> tuple[str, ...]:
        """Names of all objects that are there at some time, those of `add` events included, sorted."""
        added = {event.name for event in self.events if event.kind is Happening.ADD}
        return tuple(sorted(added | set(self.objects)))

    def with_events(self, events: tuple[OutsideEvent, ...], domain: Domain) -> Scene:
        """The scene with more events; raises `ConfigError` for those that cannot happen in it."""
        scene = self.model_copy(update={"events": (*self.events, *events)})
        check_events(scene.events, scene.objects, domain.objects)
        return scene


def jittered(scene: Scene, amount: float, rng: np.random.Generator, domain: Domain) -> dict[str, Placement]:
    """Where the objects of `scene` lie in one episode: moved by up to `amount` metres in x and y and
    turned by up to their `turn`, no two closer than they may lie; exactly as in the file if `amount` is 0."""
    placements = dict(sorted(scene.objects.items()))
    if amount <= 0:
        return placements
    for _ in range(200):
        moved = {}
        for name, placement in placements.items():
            dx, dy, yaw = rng.uniform(-1, 1, 3)
            x, y = placement.position
            turned = placement.yaw + placement.turn * yaw
            moved[name] = Placement(position=(x + amount * dx, y + amount * dy), yaw=turned)
        if all(_apart(moved, a, b, domain) for a, b in itertools.combinations(moved, 2)):
            return moved
    raise ConfigError(f"objects of scene {scene.name} cannot be moved by {amount:g} m without overlap")


def _apart(placements: Mapping[str, Placement], a: str, b: str, domain: Domain) -> bool:
    """Whether two things lie side by side with room between them; tools may lie close to others."""
    one, other = (domain.objects[name].shape for name in (a, b))
    distance = math.dist(placements[a].position, placements[b].position)
    if "tool" in (one.type, other.type):
        covered = footprint(one, placements[a].position, placements[a].yaw)
        others = footprint(other, placements[b].position, placements[b].yaw)
        return distance >= MIN_DISTANCE and smallest_gap(covered, others) > 0
    return distance >= max(MIN_DISTANCE, outer_radius(one) + outer_radius(other) + 0.01)


def read_yaml(path: Path, what: str) -> Any:
    """The mapping in a YAML file; raises `ConfigError` naming file and line."""
    text = resources.read_text(path, f"{what} file", ConfigError)
    try:
        data = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = one_line(getattr(error, "problem", None) or error)
        raise ConfigError(f"{path}{where}: not valid YAML: {problem}") from None
    if not isinstance(data, dict):
        raise ConfigError(f"{path}: a {what} file is a mapping of fields, this is {type(data).__name__}")
    return data


def explain_invalid(error: ValidationError, path: Path, model: type[BaseModel]) -> ConfigError:
    """One line for a file that does not fit its model: the field, what is wrong, and the fields there are."""
    first = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in first["loc"]) or "(top level)"
    more = error.error_count() - 1
    rest = f" (and {more} more)" if more else ""
    fields = ", ".join(model.model_fields)
    return ConfigError(f"{path}: {place}: {one_line(first['msg'], 300)}{rest}; fields: {fields}")


def domain_names() -> tuple[str, ...]:
    """Names of the domains that come with the installation, sorted."""
    return tuple(sorted(p.parent.name for p in resources.domains_dir().glob("*/domain.yaml")))


def load_domain(name: str) -> Domain:
    """Read `domains/<name>/domain.yaml`; raises `ConfigError` naming the file and field."""
    if name not in domain_names():
        raise ConfigError(unknown("domain", name, domain_names()))
    path = resources.domains_dir() / name / "domain.yaml"
    try:
        return Domain.model_validate(read_yaml(path, "domain"))
    except ValidationError as error:
        raise explain_invalid(error, path, Domain) from None
