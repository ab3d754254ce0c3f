"""Sequential labelling: every piece once, none too small, and islands apart from what surrounds them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.labelling import label_blobs

masks = arrays(np.bool_, st.tuples(st.integers(1, 14), st.integers(1, 14)))


@settings(deadline=None, max_examples=200)
@given(masks, st.integers(1, 6))
def test_blobs_are_the_connected_pieces_of_the_mask(mask: np.ndarray, min_area: int) -> None:
    found = label_blobs(mask, min_area)
    _, pieces, stats, centroids = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    large = [n for n in range(1, len(stats)) if stats[n, cv2.CC_STAT_AREA] >= min_area]
    assert np.array_equal(found.labels > 0, np.isin(pieces, large))
    assert len(found.blobs) == len(large)
    for number, blob in enumerate(found.blobs, start=1):
        (piece,) = set(pieces[found.labels == number].tolist())
        assert (*blob.bbox, blob.area) == tuple(stats[piece].tolist())
        assert blob.centroid == pytest.approx(tuple(centroids[piece]))
        assert blob.mask.shape == (blob.bbox[3], blob.bbox[2])


@settings(deadline=None)
@given(masks)
def test_outlines_of_blobs_are_those_they_are_described_by(mask: np.ndarray) -> None:
    for blob in label_blobs(mask, 1).blobs:
        assert describe(blob.mask, contour=blob.contour - blob.bbox[:2]) == describe(blob.mask)


def test_an_island_in_a_ring_is_a_blob_of_its_own() -> None:
    mask = np.zeros((60, 60), np.uint8)
    cv2.circle(mask, (30, 30), 25, 255, 4)
    cv2.circle(mask, (30, 30), 6, 255, cv2.FILLED)
    ring, island = label_blobs(mask).blobs
    assert ring.mask[25, 25] == 0
    assert island.bbox == (24, 24, 13, 13)
    assert ring.area + island.area == np.count_nonzero(mask)


def test_nothing_and_very_much() -> None:
    assert label_blobs(np.zeros((480, 640), np.uint8)).blobs == ()
    assert label_blobs(np.ones((1, 1), np.uint8)).blobs == ()
    grid = np.zeros((480, 640), np.uint8)
    for n in range(500):
        x, y = 25 * (n % 25) + 5, 24 * (n // 25) + 4
        grid[y : y + 12, x : x + 12] = 255
    found = label_blobs(grid)
    assert len(found.blobs) == 500
    assert found.labels.max() == 500
    assert {blob.area for blob in found.blobs} == {144}


@pytest.mark.parametrize("bad", [np.zeros((3, 3, 3), np.uint8), np.zeros((3, 3)), np.zeros((0, 3), np.uint8)])
def test_what_is_no_mask_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(PerceptionError, match=r"valid: \(height, width\)"):
        label_blobs(bad)
