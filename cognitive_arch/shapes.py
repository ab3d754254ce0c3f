"""Shapes of things, as domain files give them: primitives, things made of several, and tools.

The frame of a thing has its origin in the middle of what it covers of the table, half its height up.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

Positive = Annotated[float, Field(gt=0, le=2.0)]
Extent = tuple[float, float]


class Frozen(BaseModel):
    """Base of all that is read from files: it never changes, and knows all of its fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class _Form(Frozen):
    """What can be asked of every shape, besides its height and its extent; most are plain."""

    @property
    def is_round(self) -> bool:
        """Whether it looks the same from all sides."""
        return False

    @property
    def rolls(self) -> bool:
        """Whether a tap may send it rolling, or may once it has fallen over."""
        return False


class Cylinder(_Form):
    """Upright cylinder, metres."""

    type: Literal["cylinder"]
    radius: Positive
    height: Positive

    @property
    def extent(self) -> Extent:
        """Size along x and y, metres."""
        return (2 * self.radius, 2 * self.radius)

    @property
    def is_round(self) -> bool:
        return True


class Box(_Form):
    """Box with its edges along the axes, metres (x, y, z)."""

    type: Literal["box"]
    size: tuple[Positive, Positive, Positive]

    @property
    def height(self) -> float:
        return self.size[2]

    @property
    def extent(self) -> Extent:
        """Size along x and y, metres."""
        return self.size[:2]


class Sphere(_Form):
    """Ball, metres."""

    type: Literal["sphere"]
    radius: Positive

    @property
    def height(self) -> float:
        return 2 * self.radius

    @property
    def extent(self) -> Extent:
        """Size along x and y, metres."""
        return (2 * self.radius, 2 * self.radius)

    @property
    def is_round(self) -> bool:
        return True

    @property
    def rolls(self) -> bool:
        return True


Solid = Annotated[Cylinder | Box | Sphere, Field(discriminator="type")]


class Part(Frozen):
    """A solid within a thing: its middle at `place` from the thing's middle (x, y), its underside
    `above` the thing's underside, metres."""

    solid: Solid
    place: tuple[Annotated[float, Field(ge=-1, le=1)], Annotated[float, Field(ge=-1, le=1)]] = (0.0, 0.0)
    above: Annotated[float, Field(ge=0, le=2)] = 0.0

    @property
    def top(self) -> float:
        """Height of its upper end above the thing's underside, metres."""
        return self.above + self.solid.height


class Compound(_Form):
    """Solids fixed to each other: a brick with studs, a pear. They may overlap."""

    type: Literal["compound"]
    parts: tuple[Part, ...] = Field(min_length=1, max_length=20)

    @model_validator(mode="after")
    def _stands_on_a_part(self) -> Compound:
        if min(part.above for part in self.parts) > 0:
            raise ValueError("some part must be at the underside (above: 0)")
        return self

    @property
    def height(self) -> float:
        return max(part.top for part in self.parts)

    @property
    def extent(self) -> Extent:
        """Size along x and y of what encloses all parts and has its middle where the thing has."""
        x, y = (
            2 * max(abs(part.place[axis]) + part.solid.extent[axis] / 2 for part in self.parts)
            for axis in (0, 1)
        )
        return (x, y)

    @property
    def is_round(self) -> bool:
        return all(part.solid.is_round and part.place == (0.0, 0.0) for part in self.parts)

    @property
    def rolls(self) -> bool:
        return any(part.solid.rolls for part in self.parts)


class ToolShape(_Form):
    """A shaft with an optional cross bar at its far end, metres; `bar` 0 is a plain stick.

    The frame's origin is the shaft's middle, its x axis runs from the bar to the handle. The bar's middle is
    `offset` to the side, towards +y: 0 is a rake, half of the bar a hook.
    """

    type: Literal["tool"]
    length: Positive
    width: Positive
    bar: Annotated[float, Field(ge=0, le=1.0)]
    offset: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0

    @model_validator(mode="after")
    def _bar_is_on_the_shaft(self) -> ToolShape:
        if abs(self.offset) > self.bar / 2:
            raise ValueError("a tool's bar must lie on its shaft: an offset of at most half of the bar")
        return self

    @model_serializer(mode="wrap")
    def _as_told(self, inner: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # What was kept of domains (digests of looks, of runs) when tools had no offset stays valid.
        told: dict[str, Any] = inner(self)
        return told if self.offset else {key: value for key, value in told.items() if key != "offset"}

    @property
    def height(self) -> float:
        return self.width

    @property
    def sides(self) -> tuple[float, float]:
        """How far the bar reaches along y, from the least to the greatest, metres."""
        half = self.bar / 2
        return (min(self.offset - half, -self.width / 2), max(self.offset + half, self.width / 2))

    @property
    def extent(self) -> Extent:
        """Size along x and y of what encloses it and has its middle where the shaft has, metres."""
        return (self.length, 2 * max(abs(side) for side in self.sides))


Shape = Annotated[Cylinder | Box | Sphere | Compound | ToolShape, Field(discriminator="type")]
