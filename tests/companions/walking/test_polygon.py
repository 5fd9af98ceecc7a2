"""Ways out of the soles, and what feedback along them holds."""

import numpy as np
import pytest

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.polygon import (
    convex_hull,
    last_inside,
    nearest_inside,
)

W, K = 3.4, 4.0  # ω and k [1/s]


def inside(corners: Array, point: Array, tolerance: float) -> bool:
    return bool(np.linalg.norm(nearest_inside(corners, point) - point) <= tolerance)


def test_a_way_ends_where_it_leaves_the_polygon():
    rng = np.random.default_rng(3)
    left = 0
    for _ in range(200):
        corners = convex_hull(rng.normal(size=(7, 2)))
        start, end = corners.mean(axis=0), rng.normal(scale=1.5, size=2)
        last = last_inside(corners, start, end)
        if inside(corners, end, 0.0):
            assert np.array_equal(last, end)
            continue
        left += 1
        assert inside(corners, last, 1e-12)
        way = end - start
        assert not inside(corners, last + 1e-9 * way, 1e-12)  # on the boundary
        share = (last - start) @ way / (way @ way)
        assert 0.0 < share < 1.0
        assert last == pytest.approx(start + share * way, abs=1e-12)
    assert 50 < left < 200


def test_soles_hold_every_divergent_component_that_is_within_them():
    """ξ' = ω (ξ - p) with p along the error: to the middle, straight.

    The feet of a stride, and a component at the edge of the front one: the nearest
    point instead brings ξ behind this foot's heel first, where the soles are narrower.
    """
    sole = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * [0.072, 0.045]
    front, back = np.array([0.74, 0.085]), np.array([0.48, -0.085])
    soles = convex_hull(np.vstack([sole + front, sole + back]))
    middle, h = np.array([0.61, 0.0]), 1e-3

    def after(first, seconds, clipped):
        x = first.copy()
        for _ in range(round(seconds / h)):
            p = clipped(soles, middle + (1 + K / W) * (x - middle))
            x = p + (x - p) * np.exp(W * h)
        return x

    def along(corners, point):
        return last_inside(corners, middle, point)

    beside = np.array([0.78, 0.128])
    assert np.linalg.norm(after(beside, 4.0, nearest_inside) - middle) > 1.0
    for corner in soles:
        first = middle + 0.99 * (corner - middle)
        last = after(first, 4.0, along) - middle
        assert np.linalg.norm(last) < 1e-3
        straight = (corner - middle) / np.linalg.norm(corner - middle)
        half = after(first, 0.8, along) - middle
        assert half - (half @ straight) * straight == pytest.approx(0.0, abs=1e-9)
