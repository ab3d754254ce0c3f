"""What is measured along an outline, compiled: some microseconds for each, and once some seconds to compile.

Points are (n, 2) int32, x right and y down, in pixels, as they follow each other along a closed outline.
"""

from __future__ import annotations

import math

import numba
import numpy as np

SAME = 1e-9  # relative; sizes that differ by less are equal
ON_THE_CUT = 1e-6  # pixels; what is nearer to the middle lies on it
SINGULAR = 1e-12  # pivots below leave a system of equations without a solution
MOMENTS = ("nu20", "nu11", "nu02", "nu30", "nu21", "nu12", "nu03")
AREA, PERIMETER, HULL, BAYS, ELLIPSE, LONG, SHORT, UP_X, UP_Y, MIDDLE, FIRST_MOMENT = range(11)
"""Where `measure` puts what; the `MOMENTS` come last."""

_kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
_part = numba.njit(nogil=True, error_model="numpy", no_cpython_wrapper=True)


@_kernel
def measure(points, up_x, up_y, deep, numbers):  # type: ignore[no-untyped-def]
    """The corners of an outline's convex hull, (k, 2) float32; fill `numbers` (10 + 7,) float64 with what is
    measured along it.

    Moments are those of the outline turned so that the unit vector (`up_x`, `up_y`) points up. Bays are
    counted that reach deeper than `deep` pixels below the hull.
    """
    corners = _corners(points)
    hull = np.empty((len(corners), 2), np.float32)
    for k in range(len(corners)):
        hull[k, 0], hull[k, 1] = points[corners[k], 0], points[corners[k], 1]
    _moments(points, up_x, up_y, numbers)
    _rectangle(hull, numbers)
    numbers[BAYS] = _bays(points, corners, deep)
    numbers[ELLIPSE] = 0.0
    if len(points) >= 5 and numbers[AREA] > 0:
        numbers[ELLIPSE] = _ellipse(points)
    if numbers[ELLIPSE] == 0 and numbers[LONG] > 0:
        numbers[ELLIPSE] = numbers[SHORT] / numbers[LONG]
    return hull


@_kernel
def cut(blob, up_x, up_y, middle, above, below):  # type: ignore[no-untyped-def]
    """Put the pixels of `blob` (h, w) uint8 that lie on either side of the line across `up` at `middle` into
    `above` and `below`, of the same shape; those on it go into both."""
    for y in range(blob.shape[0]):
        start = up_y * y - middle
        for x in range(blob.shape[1]):
            place = start + up_x * x
            above[y, x] = blob[y, x] if place >= -ON_THE_CUT else 0
            below[y, x] = blob[y, x] if place <= ON_THE_CUT else 0


@_part
def _corners(points):  # type: ignore[no-untyped-def]
    """The indices of the corners of the convex hull, down its left side and up its right one.

    Corners are among the first and the last pixels of the rows, which are in order as they are: nothing is
    sorted, and it takes a fifth of the time of a hull of any points.
    """
    top, bottom = points[0, 1], points[0, 1]
    for n in range(len(points)):
        top, bottom = min(top, points[n, 1]), max(bottom, points[n, 1])
    rows = bottom - top + 1
    ends = np.full((2, rows), -1, np.int64)  # rows without a point occur in simplified outlines
    for n in range(len(points)):
        x, row = points[n, 0], points[n, 1] - top
        if ends[0, row] < 0 or x < points[ends[0, row], 0]:
            ends[0, row] = n
        if ends[1, row] < 0 or x >= points[ends[1, row], 0]:
            ends[1, row] = n
    corners = np.empty(2 * rows, np.int64)
    count = 0
    for side in range(2):
        start = count
        for step in range(rows):
            n = ends[side, step if side == 0 else rows - 1 - step]
            if n < 0:
                continue
            x, y = points[n, 0], points[n, 1]
            while count - start >= 2:
                one, other = corners[count - 2], corners[count - 1]
                dx, dy = points[other, 0] - points[one, 0], points[other, 1] - points[one, 1]
                if dx * (y - points[one, 1]) - dy * (x - points[one, 0]) < 0:
                    break
                count -= 1
            corners[count] = n
            count += 1
        if side == 0 and points[corners[count - 1], 0] == points[ends[1, rows - 1], 0]:
            count -= 1  # the lowest pixel begins the way up
    first, last = corners[0], corners[count - 1]
    if count > 1 and points[first, 0] == points[last, 0] and points[first, 1] == points[last, 1]:
        count -= 1
    return corners[:count]


@_part
def _moments(points, up_x, up_y, numbers):  # type: ignore[no-untyped-def]
    """Perimeter, area, and its central normalised moments in a frame whose y axis points against `up`, by
    Green's theorem."""
    a, b = -up_y, -up_x
    one = x = y = xx = xy = yy = xxx = xxy = xyy = yyy = u = v = length = 0.0
    for n in range(len(points) - 1, -1, -1):
        right, down = points[n, 0] - points[0, 0], points[n, 1] - points[0, 1]
        s, t = a * right - b * down, b * right + a * down
        length += math.sqrt((u - s) * (u - s) + (v - t) * (v - t))
        w = u * t - s * v
        one += w / 2
        x += w * (u + s) / 6
        y += w * (v + t) / 6
        xx += w * (u * u + u * s + s * s) / 12
        xy += w * (2 * u * v + u * t + s * v + 2 * s * t) / 24
        yy += w * (v * v + v * t + t * t) / 12
        xxx += w * (u + s) * (u * u + s * s) / 20
        xxy += w * (u * u * (3 * v + t) + 2 * u * s * (v + t) + s * s * (v + 3 * t)) / 60
        xyy += w * (v * v * (3 * u + s) + 2 * v * t * (u + s) + t * t * (u + 3 * s)) / 60
        yyy += w * (v + t) * (v * v + t * t) / 20
        u, v = s, t
    area = abs(one)
    numbers[PERIMETER] = length
    numbers[FIRST_MOMENT:] = 0.0
    numbers[AREA] = area if area > 0.25 else 0.0  # half a square between pixels is the least there is
    if numbers[AREA] > 0:
        x, y = x / one, y / one
        xx, xy, yy = xx / one - x * x, xy / one - x * y, yy / one - y * y
        third = area**1.5
        numbers[FIRST_MOMENT] = xx / area
        numbers[FIRST_MOMENT + 1] = xy / area
        numbers[FIRST_MOMENT + 2] = yy / area
        numbers[FIRST_MOMENT + 3] = (xxx / one - 3 * x * xx - x * x * x) / third
        numbers[FIRST_MOMENT + 4] = (xxy / one - 2 * x * xy - y * xx - x * x * y) / third
        numbers[FIRST_MOMENT + 5] = (xyy / one - 2 * y * xy - x * yy - x * y * y) / third
        numbers[FIRST_MOMENT + 6] = (yyy / one - 3 * y * yy - y * y * y) / third


@_part
def _rectangle(hull, numbers):  # type: ignore[no-untyped-def]
    """Length of the hull, and the smallest rectangle around it, of which one side lies along an edge.

    Of several that are equally small the longest counts, and of the axes of a square the more upright.
    """
    numbers[LONG] = numbers[SHORT] = numbers[UP_X] = numbers[HULL] = 0.0
    numbers[UP_Y], numbers[MIDDLE] = -1.0, -hull[0, 1]
    smallest = np.inf
    for n in range(len(hull)):
        x, y = np.float64(hull[n, 0] - hull[n - 1, 0]), np.float64(hull[n, 1] - hull[n - 1, 1])
        edge = math.sqrt(x * x + y * y)
        if edge == 0:
            continue  # a single point
        numbers[HULL] += edge
        x, y = x / edge, y / edge
        low, high, left, right = np.inf, -np.inf, np.inf, -np.inf
        for k in range(len(hull)):
            along, across = x * hull[k, 0] + y * hull[k, 1], x * hull[k, 1] - y * hull[k, 0]
            low, high = along if along < low else low, along if along > high else high
            left, right = across if across < left else left, across if across > right else right
        long, short, middle = high - low, right - left, (low + high) / 2
        if short > long * (1 + SAME) or (short > long * (1 - SAME) and abs(x) > abs(y)):
            long, short, middle, x, y = short, long, (left + right) / 2, -y, x
        area = long * short
        smaller, as_small = area < smallest * (1 - SAME) - SAME, area < smallest * (1 + SAME) + SAME
        longer, as_long = long > numbers[LONG] * (1 + SAME), long > numbers[LONG] * (1 - SAME)
        if smaller or (as_small and (longer or (as_long and abs(y) > abs(numbers[UP_Y])))):
            smallest = area
            sign = -1.0 if y > 0 or (y == 0 and x > 0) else 1.0
            numbers[LONG], numbers[SHORT] = long, short
            numbers[UP_X], numbers[UP_Y], numbers[MIDDLE] = sign * x, sign * y, sign * middle


@_part
def _bays(points, corners, deep):  # type: ignore[no-untyped-def]
    """How many stretches of the outline between neighbouring corners of the hull reach deeper below it."""
    count = 0
    ordered = np.empty(len(corners), np.int64)
    for k in range(len(corners)):  # the hull's order may be another where the outline runs back along itself
        place = k
        while place > 0 and ordered[place - 1] > corners[k]:
            ordered[place] = ordered[place - 1]
            place -= 1
        ordered[place] = corners[k]
    for k in range(len(ordered) if len(ordered) > 2 else 0):
        start, end = ordered[k - 1], ordered[k]
        x, y = points[start, 0], points[start, 1]
        dx, dy = points[end, 0] - x, points[end, 1] - y
        most, n = 0, start
        while n != end:
            most = max(most, abs(dx * (points[n, 1] - y) - dy * (points[n, 0] - x)))
            n = n + 1 if n + 1 < len(points) else 0
        # To 1/256 pixel: a bay of just the depth is not deeper by rounding.
        if most > 0 and 256 * most > (256 * deep + 0.5) * math.sqrt(dx * dx + dy * dy):
            count += 1
    return count


@_part
def _ellipse(points):  # type: ignore[no-untyped-def]
    """Minor by major axis of the ellipse that fits best, 0 where none does.

    Least squares of A xx + B yy + C xy + D x + E y = 1; then, its centre kept, of its first three terms.
    """
    x0, y0, size = 0.0, 0.0, 0.0
    for n in range(len(points)):
        x0, y0 = x0 + points[n, 0], y0 + points[n, 1]
    x0, y0 = x0 / len(points), y0 / len(points)
    for n in range(len(points)):
        size = max(size, abs(points[n, 0] - x0), abs(points[n, 1] - y0))
    unit = 1.0 / size if size > 0 else 0.0
    found, square = np.empty(5), np.empty((5, 6))
    for terms in (5, 3):
        # Sums over the points of x^4, x^3 y, ..., y^4, x^3, ..., y; each stands in several places.
        s40 = s31 = s22 = s13 = s04 = s30 = s21 = s12 = s03 = s20 = s11 = s02 = s10 = s01 = 0.0
        for n in range(len(points)):
            x, y = (points[n, 0] - x0) * unit, (points[n, 1] - y0) * unit
            xx, xy, yy = x * x, x * y, y * y
            s40, s31, s22 = s40 + xx * xx, s31 + xx * xy, s22 + xx * yy
            s13, s04 = s13 + yy * xy, s04 + yy * yy
            s30, s21, s12, s03 = s30 + xx * x, s21 + xx * y, s12 + yy * x, s03 + yy * y
            s20, s11, s02, s10, s01 = s20 + xx, s11 + xy, s02 + yy, s10 + x, s01 + y
        square[0, 0], square[0, 1], square[0, 2] = s40, s22, s31
        square[1, 1], square[1, 2], square[2, 2] = s04, s13, s22
        if terms == 5:
            square[0, 3], square[0, 4], square[1, 3], square[1, 4] = s30, s21, s12, s03
            square[2, 3], square[2, 4], square[3, 3] = s21, s12, s20
            square[3, 4], square[4, 4], square[3, 5], square[4, 5] = s11, s02, s10, s01
        square[0, terms], square[1, terms], square[2, terms] = s20, s02, s11
        for i in range(terms):  # elimination; the matrix is symmetric and, if there is a solution, positive
            if square[i, i] < SINGULAR * len(points):
                return 0.0
            for row in range(i + 1, terms):
                factor = square[i, row] / square[i, i]
                for k in range(row, terms + 1):
                    square[row, k] -= factor * square[i, k]
        for i in range(terms - 1, -1, -1):
            found[i] = square[i, terms]
            for k in range(i + 1, terms):
                found[i] -= square[i, k] * found[k]
            found[i] /= square[i, i]
        a, b, c = found[0], found[1], found[2]
        if terms == 5:
            determinant = 4 * a * b - c * c
            if abs(determinant) < SINGULAR:
                return 0.0
            x0 += size * (c * found[4] - 2 * b * found[3]) / determinant
            y0 += size * (c * found[3] - 2 * a * found[4]) / determinant
    spread = math.sqrt((a - b) ** 2 + c * c)
    one, other = abs(a + b + spread), abs(a + b - spread)
    return math.sqrt(min(one, other) / max(one, other)) if max(one, other) > 0 else 0.0
