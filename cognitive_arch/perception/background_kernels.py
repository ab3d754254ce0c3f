"""The commonest colour among pixels, compiled."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True, error_model="numpy")
def commonest_colour(pixels, bins, dark, lit, places, counts, tones, colours):  # type: ignore[no-untyped-def]
    """Fill `colours` (2, 3) float64 with the medians of those of `pixels` (n, 3) uint8 whose shares of red
    and green, `dark` added to their sum, lie in the fullest of `bins` by `bins` bins or in one beside it,
    and with the tones that a part `lit` of them does not exceed.

    `places` (n,) int64, `counts` (bins + 2, bins + 2) and `tones` (3, 256) int64, both 0, are room to work.
    """
    width = bins + 2  # with an empty bin all around
    flat = counts.reshape(-1)
    for n in range(len(pixels)):
        red, green = np.float32(pixels[n, 0]), np.float32(pixels[n, 1])
        total = red + green + np.float32(pixels[n, 2]) + np.float32(dark)
        place = (int(bins * (red / total)) + 1) * width + int(bins * (green / total)) + 1
        places[n] = place
        flat[place] += 1
    peak, most = width + 1, -1
    for place in range(width + 1, len(flat) - width - 1):
        around = 0
        for row in (place - width, place, place + width):
            around += flat[row - 1] + flat[row] + flat[row + 1]
        if around > most and 1 <= place % width <= bins:
            peak, most = place, around
    for n in range(len(pixels)):
        off = places[n] - peak + width + 1
        if off >= 0 and off < 3 * width and off % width < 3:
            for k in range(3):
                tones[k, pixels[n, k]] += 1
    for k in range(3):
        below = tone = 0
        low = -1
        while 2 * below <= most:
            below += tones[k, tone]
            if low < 0 and 2 * below >= most:
                low = tone
            tone += 1
        colours[0, k] = (low + tone - 1) / 2
        while below < lit * most:
            below += tones[k, tone]
            tone += 1
        colours[1, k] = tone - 1
