"""The pendulum's divergent component of motion, and its support polygons."""

import numpy as np
import pytest

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.pendulum import (
    DcmPhase,
    dcm_of,
    error_after,
    in_step,
    plan_dcm,
)
from hsp_control.companions.walking.polygon import (
    convex_hull,
    last_inside,
    nearest_inside,
)

W = 3.3
H = 1e-6


def some_phases() -> list[DcmPhase]:
    rng = np.random.default_rng(1)
    points = np.cumsum(rng.normal(scale=0.2, size=(6, 2)), axis=0)
    return [
        DcmPhase(d, a, b)
        for d, a, b in zip(
            (0.4, 0.2, 0.7, 0.15, 0.3), points[:-1], points[1:], strict=True
        )
    ]


def test_a_phase_obeys_the_equation_of_the_divergent_component():
    phase, first = some_phases()[1], np.array([0.05, -0.02])
    for t in (0.0, 0.07, 0.2):
        rate = (phase.dcm(first, t + H, W) - phase.dcm(first, t - H, W)) / (2 * H)
        at = phase.start + t / phase.duration * (phase.end - phase.start)
        assert rate == pytest.approx(W * (phase.dcm(first, t, W) - at), abs=1e-8)
    assert phase.dcm(first, 0.0, W) == pytest.approx(first, abs=1e-15)
    last = phase.dcm(first, phase.duration, W)
    assert phase.first_dcm(last, W) == pytest.approx(first, abs=1e-14)


def test_integration_of_the_pendulum_stays_with_the_closed_form():
    """c'' = ω² (c - p), by Runge and Kutta, against ξ = c + c'/ω of the plan."""
    phases = some_phases()
    starts = plan_dcm(phases, W)
    c = starts[0] + np.array([0.03, 0.01])
    x = np.concatenate([c, W * (starts[0] - c)])
    h = 1e-4
    for phase, start in zip(phases, starts, strict=True):

        def rate(t, x, phase=phase):
            return np.concatenate([x[2:], W * W * (x[:2] - phase.point(t))])

        steps = round(phase.duration / h)
        for k in range(steps):
            t = k * h
            k1 = rate(t, x)
            k2 = rate(t + h / 2, x + h / 2 * k1)
            k3 = rate(t + h / 2, x + h / 2 * k2)
            k4 = rate(t + h, x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        end = phase.dcm(start, phase.duration, W)
        # An initial error grows by exp(ω t): 800 over these 2 s.
        assert dcm_of(x[:2], x[2:], W) == pytest.approx(end, abs=1e-8)


@pytest.mark.parametrize("error", [0.01, -0.03, 0.049, 0.0501, -0.2, 0.0])
@pytest.mark.parametrize("t", [0.05, 0.4, 1.5])
def test_the_error_that_bounded_feedback_leaves(error, t):
    """Against the integrated ε' = ω (ε - sat((1 + k/ω) ε))."""
    gain, reach, h = 4.0, 0.05, 1e-4
    x = error
    for _ in range(round(t / h)):
        mid = x + 0.5 * h * W * (x - np.clip((1 + gain / W) * x, -reach, reach))
        x += h * W * (mid - np.clip((1 + gain / W) * mid, -reach, reach))
    assert error_after(error, t, W, gain, reach) == pytest.approx(x, abs=1e-6, rel=1e-4)
    if abs(error) < reach:
        assert abs(error_after(error, t, W, gain, reach)) <= abs(error)


def test_a_phase_lasts_as_long_as_the_component_needs():
    """A foot that lands 30 ms early or late changes the duration of the weight
    shift."""
    phase = DcmPhase(0.15, np.array([0.48, -0.08]), np.array([0.74, 0.08]))
    last = phase.end + np.array([0.03, -0.02])
    for duration in (0.12, 0.15, 0.18):
        there = phase._replace(duration=duration).first_dcm(last, W)
        found = in_step(phase, last, there, W, (0.075, 0.3))
        assert found.duration == pytest.approx(duration, abs=0.6 * 0.225 / 200)
        assert np.array_equal(found.end, phase.end)
        # A point off the path changes little: the nearest point is used.
        along = there - phase._replace(duration=duration - 1e-3).first_dcm(last, W)
        beside = 0.02 * np.array([-along[1], along[0]]) / np.linalg.norm(along)
        found = in_step(phase, last, there + beside, W, (0.075, 0.3))
        assert found.duration == pytest.approx(duration, abs=0.01)
    far = in_step(phase, last, phase.start - 10.0, W, (0.075, 0.3))
    assert far.duration == 0.3


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
    """ξ' = ω (ξ - p) with p along the error: straight to the middle.

    Feet in a stride with ξ at the edge of the front one: the nearest point would first
    move ξ behind this foot's heel, where the soles are narrower.
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
