"""Shape descriptors: known values of analytic shapes, invariances, blobs without extent, published rows."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from benchmarks import published_descriptors as published
from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.descriptors import (
    AREA_UNIT,
    BLOB,
    DEFAULT,
    FORMULAS,
    PARTS,
    SHAPE,
    Descriptions,
    describe,
)
from cognitive_arch.perception.outline import DEEP, MOMENTS, Outline

Mask = NDArray[np.uint8]
SECOND, THIRD = ("nu20", "nu11", "nu02"), ("nu30", "nu21", "nu12", "nu03")
FILES = published.folder()


def filled(corners: NDArray[np.float64], side: int) -> Mask:
    """A polygon, its origin in the middle of a square image, drawn with corners to 1/64 pixel."""
    mask = np.zeros((side, side), np.uint8)
    places = np.round((corners + (side - 1) / 2) * 64).astype(np.int32)
    cv2.fillPoly(mask, [places], 1, shift=6)
    return mask


def ellipse(major: float, minor: float, turn: float = 0.0) -> Mask:
    t = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    return filled(turned(np.column_stack([major * np.cos(t), minor * np.sin(t)]), turn), round(2 * major) + 9)


def rectangle(width: float, height: float, turn: float = 0.0) -> Mask:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, height / 2)
    return filled(turned(corners, turn), round(math.hypot(width, height)) + 9)


def star(points: int, inner: float, outer: float, turn: float = 0.0) -> Mask:
    t = np.arange(2 * points) * np.pi / points
    radius = np.where(np.arange(2 * points) % 2, inner, outer)[:, None]
    return filled(turned(radius * np.column_stack([np.cos(t), np.sin(t)]), turn), round(2 * outer) + 9)


def turned(corners: NDArray[np.float64], turn: float) -> NDArray[np.float64]:
    c, s = math.cos(turn), math.sin(turn)
    return np.asarray(corners @ np.array([(c, s), (-s, c)]))


TURNS = [0.0, 0.4, 1.1, 2.5]


# -- shapes whose values are known ----------------------------------------------------------------------


@pytest.mark.parametrize("radius", [20, 60])
def test_disc(radius: int) -> None:
    whole = describe(ellipse(radius, radius)).whole
    off = 3 / radius
    assert whole["area"] * AREA_UNIT == pytest.approx(math.pi * radius**2, rel=off)
    assert whole["eccentricity"] == pytest.approx(1, abs=0.01)
    assert whole["circularity"] == pytest.approx(1, abs=off)
    assert whole["squareness"] == pytest.approx(math.pi / 4, abs=off)
    # Steps between pixels make the outline of a disc 1.055 times as long as its circle.
    assert whole["compactness"] == pytest.approx(1 / 1.055**2, abs=0.03)
    assert whole["convexity"] == pytest.approx(1 / 1.055**2, abs=0.03)
    assert whole["convexity_defects"] == 0
    assert whole["nu20"] == pytest.approx(1 / (4 * math.pi), rel=0.01)
    assert whole["nu02"] == pytest.approx(1 / (4 * math.pi), rel=0.01)
    assert [whole[name] for name in ("nu11", *THIRD)] == pytest.approx([0] * 5, abs=1e-6)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("minor", [15, 30, 45])
def test_ellipse(minor: int, turn: float) -> None:
    major = 60
    mask = ellipse(major, minor, turn)
    whole = describe(mask).whole
    assert whole["area"] * AREA_UNIT == pytest.approx(math.pi * major * minor, rel=0.06)
    assert whole["eccentricity"] == pytest.approx(minor / major, abs=0.02)
    assert whole["circularity"] == pytest.approx(minor / major, abs=0.04)
    assert whole["squareness"] == pytest.approx(math.pi / 4, abs=0.04)
    assert describe(mask, BLOB).whole["eccentricity"] == pytest.approx(minor / major, abs=0.07)
    # Second moments of an ellipse: its axes squared by 4, by the area; the axes turn with it.
    along, across = major / (4 * math.pi * minor), minor / (4 * math.pi * major)
    c, s = math.cos(turn), math.sin(turn)
    assert whole["nu20"] == pytest.approx(along * c * c + across * s * s, rel=0.05)
    assert whole["nu02"] == pytest.approx(along * s * s + across * c * c, rel=0.05)
    assert whole["nu11"] == pytest.approx((along - across) * c * s, abs=0.02)


@pytest.mark.parametrize("formulas", FORMULAS)
def test_upright_rectangle_is_exact(formulas: str) -> None:
    both = describe(np.ones((31, 61), np.uint8), formulas)
    whole = both.whole
    area, perimeter, diagonal = 60 * 30, 2 * (60 + 30), math.hypot(60, 30)
    assert whole["area"] == area / AREA_UNIT
    assert whole["convexity"] == 1
    assert whole["squareness"] == pytest.approx(1, abs=1e-6)
    assert whole["circularity"] == pytest.approx(area / (math.pi * diagonal**2 / 4), rel=1e-3)
    compactness = area / perimeter**2 * (4 * math.pi if formulas == SHAPE else 1)
    assert whole["compactness"] == pytest.approx(compactness)
    assert whole["nu20"] == pytest.approx(60 / 30 / 12)
    assert whole["nu02"] == pytest.approx(30 / 60 / 12)
    for half in (both.top, both.bottom):
        assert half["area"] == area / 2 / AREA_UNIT
        assert half["nu20"] == pytest.approx(1 / 12)


@pytest.mark.parametrize("turn", TURNS)
def test_turned_rectangle(turn: float) -> None:
    mask = rectangle(120, 40, turn)
    whole, sides = describe(mask).whole, describe(mask, BLOB)
    assert whole["squareness"] > 0.95
    assert sides.whole["eccentricity"] == pytest.approx(1 / 3, abs=0.02)
    for half in (sides.top, sides.bottom):
        assert half["eccentricity"] == pytest.approx(2 / 3, abs=0.04)
        assert half["squareness"] > 0.92
        # Upright, whichever way the whole lies: as high as wide times 1.5.
        assert half["nu02"] / half["nu20"] == pytest.approx(1.5**2, rel=0.1)
        assert half["nu11"] == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("points", [4, 5, 7])
def test_star(points: int, turn: float) -> None:
    inner, outer = 25, 60
    both = describe(star(points, inner, outer, turn))
    whole = both.whole
    corner = math.pi / points
    area = points * inner * outer * math.sin(corner)
    side = math.sqrt(inner**2 + outer**2 - 2 * inner * outer * math.cos(corner))
    assert whole["convexity_defects"] == points
    assert whole["area"] * AREA_UNIT == pytest.approx(area, rel=0.05)
    assert whole["circularity"] == pytest.approx(area / (math.pi * outer**2), abs=0.03)
    straight = outer * math.sin(corner) / side  # perimeters of hull and star
    assert straight**2 / 1.2 < whole["convexity"] < straight**2 * 1.05
    assert whole["compactness"] < 0.55


def test_the_halves_of_a_hammer() -> None:
    hammer = np.zeros((90, 70), np.uint8)
    hammer[5:15, 5:65] = 1  # head above
    hammer[15:85, 32:38] = 1  # handle
    both = describe(hammer)
    assert both.top["area"] > 2 * both.bottom["area"]
    assert both.top["convexity_defects"] == 2
    assert both.bottom["squareness"] == pytest.approx(1, abs=1e-6)
    below = describe(hammer[::-1])
    assert below.top["squareness"] == pytest.approx(both.bottom["squareness"])
    level = describe(hammer.T)  # the head on the left: left counts as top
    assert level.top["area"] == both.top["area"]


# -- laws -----------------------------------------------------------------------------------------------


@st.composite
def blobs(draw: st.DrawFn, least: float = 8.0) -> NDArray[np.float64]:
    """Corners of a polygon without crossings, 8 to 30 pixels from its middle."""
    radii = draw(st.lists(st.floats(least, 30), min_size=5, max_size=12))
    t = np.arange(len(radii)) * 2 * np.pi / len(radii)
    return np.array(radii)[:, None] * np.column_stack([np.cos(t), np.sin(t)])


@settings(max_examples=40, deadline=None)
@given(blobs(), st.integers(0, 9), st.integers(0, 9), st.sampled_from(sorted(FORMULAS)))
def test_translation_changes_nothing(
    corners: NDArray[np.float64], right: int, down: int, formulas: str
) -> None:
    mask = filled(corners, 70)
    moved = np.pad(mask, ((down, 3), (right, 0)))
    assert describe(moved, formulas) == describe(mask, formulas)


@settings(max_examples=60, deadline=None)
@given(blobs())
def test_a_quarter_turn_changes_only_the_moments_of_the_whole(corners: NDArray[np.float64]) -> None:
    mask = filled(corners, 70)
    here, there = describe(mask), describe(np.ascontiguousarray(np.rot90(mask)))
    still = [row.name for row in FORMULAS[DEFAULT].rows if "rotation" in row.invariant]
    assert there.vector(["whole"], still) == pytest.approx(here.vector(["whole"], still), abs=2e-4)
    a, b = here.whole, there.whole
    assert [b[n] for n in SECOND] == pytest.approx([a["nu02"], -a["nu11"], a["nu20"]], abs=1e-9)
    expected = [a["nu03"], -a["nu12"], a["nu21"], -a["nu30"]]
    assert [b[n] for n in THIRD] == pytest.approx(expected, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(blobs())
def test_a_quarter_turn_at_most_exchanges_the_halves(corners: NDArray[np.float64]) -> None:
    mask = filled(corners * (1.0, 0.6), 70)
    here, there = describe(mask), describe(np.ascontiguousarray(np.rot90(mask)))
    sides = sorted(cv2.minAreaRect(cv2.findNonZero(mask))[1])
    assume(sides[0] < 0.97 * sides[1])  # a square has two main axes
    assume(_smallest_rectangles(mask) == 1)  # of a kite, two are mirror images of each other
    exchanged = Descriptions(here.whole, _upside_down(here.bottom), _upside_down(here.top))
    halves = there.vector(["top", "bottom"])
    assert any(
        halves == pytest.approx(both.vector(["top", "bottom"]), abs=2e-4) for both in (here, exchanged)
    )


def _smallest_rectangles(mask: Mask) -> int:
    """How many rectangles around it are as small as the smallest."""
    corners = cv2.convexHull(cv2.findNonZero(mask)).reshape(-1, 2).astype(np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    areas: dict[float, float] = {}
    for along in edges / np.linalg.norm(edges, axis=1, keepdims=True):
        across = np.array([-along[1], along[0]])
        turn = round(math.degrees(math.atan2(along[1], along[0])) % 90, 6) % 90
        areas[turn] = float(np.ptp(corners @ along) * np.ptp(corners @ across))
    return sum(area < min(areas.values()) * (1 + 1e-6) for area in areas.values())


def _upside_down(half: object) -> dict[str, float]:
    assert isinstance(half, dict)
    return {name: -value if name in THIRD else value for name, value in half.items()}


@settings(max_examples=40, deadline=None)
@given(blobs(least=12.0), st.floats(1.5, 4))
def test_scale_changes_little(corners: NDArray[np.float64], scale: float) -> None:
    small, large = describe(filled(2 * corners, 140)), describe(filled(2 * scale * corners, 600))
    keeps = [row.name for row in FORMULAS[DEFAULT].rows if "scale" in row.invariant]
    difference = np.abs(small.vector(["whole"], keeps) - large.vector(["whole"], keeps))
    assert difference.max() < 0.08
    growth = large.whole["area"] / small.whole["area"]
    assert growth == pytest.approx(scale**2, rel=0.12)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 12).flatmap(
        lambda w: st.lists(st.lists(st.booleans(), min_size=w, max_size=w), min_size=1, max_size=12)
    ),
    st.sampled_from(sorted(FORMULAS)),
)
def test_any_mask_gives_finite_numbers_in_their_range(rows: list[list[bool]], formulas: str) -> None:
    mask = np.array(rows)
    assume(mask.any())
    both = describe(mask, formulas)
    assert np.isfinite(both.vector()).all()
    assert len(both.vector()) == 3 * 14
    for part in (both.whole, both.top, both.bottom):
        for name in ("convexity", "eccentricity", "compactness", "circularity", "squareness"):
            assert 0 <= part[name] <= 1 + 1e-5, name


@settings(max_examples=60, deadline=None)
@given(blobs(), st.floats(0.3, 1))
def test_outlines_have_the_measures_that_opencv_gives_them(
    corners: NDArray[np.float64], narrow: float
) -> None:
    contours, _ = cv2.findContours(
        filled(corners * (1.0, narrow), 70), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    contour = np.asarray(max(contours, key=len), np.int32)
    ours = Outline(contour)
    assert ours.area == pytest.approx(cv2.contourArea(contour))
    assert ours.perimeter == pytest.approx(cv2.arcLength(contour, True), rel=1e-5)
    assert ours.hull_perimeter == pytest.approx(cv2.arcLength(cv2.convexHull(contour), True), rel=1e-5)
    width, height = cv2.minAreaRect(contour)[1]
    assert ours.rectangle_area == pytest.approx(width * height, rel=1e-4)
    axes = cv2.fitEllipse(contour)[1]
    assert ours.ellipse_ratio == pytest.approx(min(axes) / max(axes), abs=1e-4)
    theirs = cv2.moments(contour)
    assert ours.moments == pytest.approx([theirs[name] for name in MOMENTS], abs=1e-7)
    defects = cv2.convexityDefects(contour, np.sort(cv2.convexHull(contour, returnPoints=False), axis=0))
    assert ours.bays == (
        0 if defects is None else np.count_nonzero(defects.reshape(-1, 4)[:, 3] > 256 * DEEP)
    )


@settings(max_examples=100, deadline=None)
@given(
    st.integers(1, 12).flatmap(
        lambda w: st.lists(st.lists(st.booleans(), min_size=w, max_size=w), min_size=1, max_size=12)
    )
)
def test_hulls_of_any_outline_have_the_corners_that_opencv_finds(rows: list[list[bool]]) -> None:
    mask = np.array(rows, np.uint8)
    for contour in cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]:
        ours = Outline(np.asarray(contour, np.int32)).hull
        theirs = cv2.convexHull(contour).reshape(-1, 2)
        assert len(ours) == len(theirs)
        assert {tuple(corner) for corner in ours} == {tuple(corner) for corner in theirs}


# -- blobs with little to describe --------------------------------------------------------------------------


@pytest.mark.parametrize("formulas", FORMULAS)
def test_one_pixel_is_all_zeros(formulas: str) -> None:
    assert not describe(np.ones((1, 1), np.uint8), formulas).vector().any()


@pytest.mark.parametrize("formulas", FORMULAS)
@pytest.mark.parametrize("line", [np.ones((1, 9), bool), np.ones((9, 1), bool), np.eye(9, dtype=bool)])
def test_a_line_is_convex_and_has_no_area(line: NDArray[np.bool_], formulas: str) -> None:
    both = describe(line, formulas)
    for part in (both.whole, both.top, both.bottom):
        assert part["convexity"] == pytest.approx(1)
        assert not any(value for name, value in part.items() if name != "convexity")


def test_lines_that_bend_have_the_hull_of_their_points() -> None:
    corners = np.array([(0, 0), (10, 30), (20, 0), (30, 30), (40, 0)], np.int32)
    zigzag = cv2.polylines(np.zeros((31, 41), np.uint8), [corners], False, 1)
    hull = 40 + 20 + 2 * math.hypot(10, 30)
    length = 2 * 4 * (20 + 10 * math.sqrt(2))  # there and back; but for short cuts in the corners
    assert describe(zigzag).whole["convexity"] == pytest.approx((hull / length) ** 2, rel=0.06)
    assert describe(zigzag).whole["convexity_defects"] == 2


@pytest.mark.parametrize("quarter", range(4))
def test_of_equally_small_rectangles_the_longest_counts(quarter: int) -> None:
    turn = np.linalg.matrix_power(np.array([(0, 1), (-1, 0)]), quarter)
    corners = np.array([(0, 0), (40, 0), (0, 20)]) @ turn
    found = Outline(corners.astype(np.int32)[:, None]).rectangle
    assert found.long == pytest.approx(math.hypot(40, 20))
    assert found.long * found.short == pytest.approx(40 * 20)
    assert abs(found.up[quarter % 2]) == pytest.approx(2 / math.sqrt(5))


@pytest.mark.parametrize("start", range(4))
def test_of_the_axes_of_a_square_the_more_upright_counts(start: int) -> None:
    corners = np.roll(np.array([(0, 0), (40, 10), (30, 50), (-10, 40)]), start, axis=0)
    found = Outline(corners.astype(np.int32)[:, None]).rectangle
    assert found.up == pytest.approx(np.array([1, -4]) / math.sqrt(17))
    assert (found.long, found.short) == pytest.approx((math.sqrt(1700),) * 2)


def test_holes_count_as_filled() -> None:
    solid = np.ones((40, 60), np.uint8)
    pierced = solid.copy()
    pierced[5:15, 10:20] = 0
    pierced[18:22, 28:33] = 0
    assert describe(pierced).whole == describe(solid).whole


def test_of_several_pieces_the_largest_counts() -> None:
    large = np.ones((20, 30), np.uint8)
    mask = np.zeros((60, 60), np.uint8)
    mask[5:25, 5:35] = large
    alone = describe(mask)
    assert alone.whole == describe(large).whole
    mask[40:45, 50:55] = 1
    assert describe(mask).whole == alone.whole
    fork = np.zeros((60, 40), np.uint8)  # below the cut: two prongs, one of them wider
    fork[:20], fork[20:, :12], fork[20:, 34:] = 1, 1, 1
    assert describe(fork).bottom["area"] == pytest.approx(11 * 29 / AREA_UNIT, rel=0.05)


def test_any_value_but_zero_is_the_blob() -> None:
    mask = ellipse(20, 10)
    assert describe(mask * 255) == describe(mask) == describe(mask.astype(bool)) == describe(mask[:, ::1] * 7)
    inside = np.zeros((200, 200), np.uint8)
    inside[40 : 40 + mask.shape[0], 90 : 90 + mask.shape[1]] = mask
    assert describe(inside[30:120, 80:170]) == describe(mask)  # a view that is not contiguous


# -- the interface ------------------------------------------------------------------------------------------


def test_vector_is_in_the_tables_order() -> None:
    both = describe(ellipse(30, 12))
    assert list(both.whole) == list(FORMULAS[DEFAULT].names)
    assert both.vector().tolist() == [v for p in PARTS for v in getattr(both, p).values()]
    names = ("circularity", "area")
    assert both.vector(["top"], names).tolist() == [both.top[n] for n in names]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: describe(np.ones((3, 3), np.uint8), "shapedescriptor"), "did you mean shapeDescriptor"),
        (lambda: describe(np.zeros((3, 3), np.uint8)), "without a pixel"),
        (lambda: describe(np.zeros((0, 3), np.uint8)), "without a pixel"),
        (lambda: describe(np.ones((3, 3, 3), np.uint8)), r"shape \(3, 3, 3\)"),
        (lambda: describe(np.ones((3, 3))), "float64"),
        (lambda: describe(np.ones((3, 3), np.uint8)).vector(["left"]), "valid: bottom, top, whole"),
        (lambda: describe(np.ones((3, 3), np.uint8)).vector(names=["size"]), "unknown descriptor 'size'"),
    ],
)
def test_bad_input_is_named(call, says: str) -> None:
    with pytest.raises(PerceptionError, match=says):
        call()


@pytest.mark.parametrize("formulas", FORMULAS)
def test_every_row_says_what_it_keeps_under(formulas: str) -> None:
    rows = FORMULAS[formulas].rows
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert "translation" in row.invariant
        assert row.invariant <= {"translation", "rotation", "scale"}


# -- published rows -----------------------------------------------------------------------------------------

with_data = pytest.mark.skipif(
    not (FILES / "images").is_dir(), reason="the published data are not here; COGARCH_DATA names their folder"
)


@with_data
def test_published_rows_keep_the_laws_of_our_formulas() -> None:
    errors = published.law_errors(FILES)
    assert errors["squareness"] < 5e-6  # as printed, to six digits
    assert errors["eccentricity"] < 5e-6
    assert errors["compactness"] == 0
    assert errors["roundest"] == 0


@with_data
def test_views_of_the_same_objects_have_the_published_descriptors() -> None:
    rows = published.compare(FILES)
    assert {row.formulas for row in rows} == set(FORMULAS)
    for row in rows:
        if row.descriptor in ("eccentricity", "circularity", "squareness"):
            assert abs(row.ours[0] - row.published[0]) < 0.12, row
        ceiling = 1 / (4 * math.pi) if (row.formulas, row.descriptor) == (BLOB, "compactness") else 1
        assert abs(row.ours[0] - row.published[0]) < 0.2 * ceiling, row
