"""What is measured of a region's pixels, and what trees say to it, compiled.

Pictures are (h, w, 3) uint8 RGB, regions (h, w) uint8, 1 where the region is, all of them contiguous.
"""

from __future__ import annotations

import math

import numba

COUNT, X, Y, XX, YY, XY, RED, GREEN, BLUE, FORM = range(10)
"""Where `look` puts what in a row: pixels, their middle, second central moments in square pixels, mean
colours, and the five numbers of the form."""
FORMS = 5
RED_VARIES, GREEN_VARIES, TONE, TONE_VARIES = range(4)
"""Where `look` puts what of how the lit part varies: standard deviations but for the mean `TONE`."""

SLOPES, SLOPE_UNIT = 1024, 8
"""Of what `slopes` counts: how many classes, and how many of them make one grey level per pixel."""

_kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
_part = numba.njit(nogil=True, error_model="numpy", no_cpython_wrapper=True)


@_kernel
def shade(colors, region, tones, counts):  # type: ignore[no-untyped-def]
    """Fill `tones` (h, w) uint8 with the mean of the three colours, and `counts` (256,) with how many of the
    region's pixels have each."""
    counts[:] = 0
    for y in range(region.shape[0]):
        for x in range(region.shape[1]):
            tone = (int(colors[y, x, 0]) + int(colors[y, x, 1]) + int(colors[y, x, 2]) + 1) // 3
            tones[y, x] = tone
            counts[tone] += region[y, x]


@_kernel
def look(colors, tones, region, least, dark, samples, lit, found, varies):  # type: ignore[no-untyped-def]
    """Fill `lit` with the region's pixels of the tone `least` or brighter, `found` (2, 10 + 4) with what is
    measured of the region and of its lit part, `varies` (4,) with how the latter's shares of red and green
    and its tone vary. Shares are taken of every n-th pixel, so that there are about `samples[0]`, with `dark`
    added to each colour; the form is that of about `samples[1]` pixels.
    """
    found[:] = 0.0
    tone_sum = tone_squares = 0
    for y in range(region.shape[0]):
        for x in range(region.shape[1]):
            lit[y, x] = region[y, x] if tones[y, x] >= least else 0
            if lit[y, x]:
                tone = int(tones[y, x])
                tone_sum += tone
                tone_squares += tone * tone
    for which in range(2):
        _moments(colors, lit if which else region, found[which])
        _form(lit if which else region, samples[1], found[which])
    _shares(colors, lit, dark, int(found[1, COUNT]) // samples[0] + 1, varies)
    count = found[1, COUNT]
    varies[TONE] = tone_sum / count
    varies[TONE_VARIES] = math.sqrt(max(0.0, tone_squares / count - varies[TONE] ** 2))


@_kernel
def slopes(tones, inner, samples, counts):  # type: ignore[no-untyped-def]
    """Fill `counts` (SLOPES,) with how many of the pixels of `inner`, which is 0 along the border, have each
    slope of `tones` (h, w) uint8 (Sobel's gradient). Of every n-th row, so that there are about `samples`."""
    counts[:] = 0
    count = 0
    for y in range(inner.shape[0]):
        for x in range(inner.shape[1]):
            count += inner[y, x]
    for y in range(1, inner.shape[0] - 1, count // samples + 1):
        for x in range(1, inner.shape[1] - 1):
            if inner[y, x]:
                falling = int(tones[y - 1, x - 1]) - int(tones[y + 1, x + 1])
                rising = int(tones[y + 1, x - 1]) - int(tones[y - 1, x + 1])
                across = falling + rising + 2 * (int(tones[y, x - 1]) - int(tones[y, x + 1]))
                down = falling - rising + 2 * (int(tones[y - 1, x]) - int(tones[y + 1, x]))
                slope = int(math.sqrt(across * across + down * down))
                counts[min(slope, SLOPES - 1)] += 1


@_part
def _moments(colors, region, found):  # type: ignore[no-untyped-def]
    count = sum_x = sum_y = sum_xx = sum_yy = sum_xy = red = green = blue = 0
    for y in range(region.shape[0]):
        row = row_x = 0
        for x in range(region.shape[1]):
            if region[y, x]:
                row, row_x, sum_xx = row + 1, row_x + x, sum_xx + x * x
                red, green, blue = red + colors[y, x, 0], green + colors[y, x, 1], blue + colors[y, x, 2]
        count, sum_x, sum_xy = count + row, sum_x + row_x, sum_xy + y * row_x
        sum_y, sum_yy = sum_y + y * row, sum_yy + y * y * row
    middle_x, middle_y = sum_x / count, sum_y / count
    found[COUNT], found[X], found[Y] = count, middle_x, middle_y
    # A pixel is a square, not a point: a twelfth each way.
    found[XX] = sum_xx / count - middle_x * middle_x + 1 / 12
    found[YY] = sum_yy / count - middle_y * middle_y + 1 / 12
    found[XY] = sum_xy / count - middle_x * middle_y
    found[RED], found[GREEN], found[BLUE] = red / count, green / count, blue / count


@_part
def _form(region, samples, found):  # type: ignore[no-untyped-def]
    """Moments of third and fourth order after stretching the region until it is as wide as it is high.

    A slanted view of something flat is such a stretching, about: a disc has the moments of a disc from
    wherever one looks at it. None depends on how the stretched region is turned.
    """
    xx, yy, xy = found[XX], found[YY], found[XY]
    wide, high = math.sqrt(xx), math.sqrt(max(yy - xy * xy / xx, 1 / 12))
    step = int(found[COUNT]) // samples + 1
    place = count = 0
    fourth, lopsided, triangular, square, two_ended = 0.0, 0j, 0j, 0j, 0j
    for y in range(region.shape[0]):
        for x in range(region.shape[1]):
            if region[y, x]:
                if place % step == 0:
                    right, down = x - found[X], y - found[Y]
                    z = complex(right / wide, (down - xy / xx * right) / high)
                    radius = z.real * z.real + z.imag * z.imag
                    zz = z * z
                    count += 1
                    fourth += radius * radius
                    lopsided += radius * z
                    triangular += zz * z
                    square += zz * zz
                    two_ended += radius * zz
                place += 1
    found[FORM] = fourth / count / 4
    found[FORM + 1], found[FORM + 2] = abs(lopsided) / count, abs(triangular) / count
    found[FORM + 3], found[FORM + 4] = abs(square) / count, abs(two_ended) / count


@_part
def _shares(colors, lit, dark, step, varies):  # type: ignore[no-untyped-def]
    place = count = 0
    red = green = reds = greens = 0.0
    for y in range(lit.shape[0]):
        for x in range(lit.shape[1]):
            if lit[y, x]:
                if place % step == 0:
                    r, g, b = colors[y, x, 0] + dark, colors[y, x, 1] + dark, colors[y, x, 2] + dark
                    r, g = r / (r + g + b), g / (r + g + b)
                    count, red, green = count + 1, red + r, green + g
                    reds, greens = reds + r * r, greens + g * g
                place += 1
    varies[RED_VARIES] = math.sqrt(max(0.0, reds / count - (red / count) ** 2))
    varies[GREEN_VARIES] = math.sqrt(max(0.0, greens / count - (green / count) ** 2))


@_kernel
def add_leaves(features, roots, feature, threshold, child, value, depth, scores):  # type: ignore[no-untyped-def]
    """Add to `scores` (n_answers,) the values of the leaves that `features` lead to; see `Forest`."""
    for tree in range(roots.shape[0]):
        for answer in range(roots.shape[1]):
            node = roots[tree, answer]
            for _ in range(depth):
                node = child[node] + (1 if features[feature[node]] > threshold[node] else 0)
            scores[answer] += value[node]
