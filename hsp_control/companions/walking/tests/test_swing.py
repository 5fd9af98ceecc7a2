"""Swing feet, footsteps and soles: continuity and constraints."""

from types import SimpleNamespace

import numpy as np
import pytest

from hsp_control.companions.walking import Walk
from hsp_control.companions.walking.footsteps import (
    Footstep,
    Stance,
    Velocity,
    between,
    near,
)
from hsp_control.companions.walking.pendulum import DcmPhase
from hsp_control.companions.walking.polygon import convex_hull, nearest_inside
from hsp_control.companions.walking.push_recovery import PlannedSwing, PushRecovery
from hsp_control.companions.walking.quintic import FootMotion, to_rest
from hsp_control.companions.walking.step_adjustment import (
    WEIGHT_DCM,
    WEIGHT_TIME,
    adjust,
)
from hsp_control.companions.walking.step_planner import StepPlanner
from hsp_control.companions.walking.swing import APPROACH, DESCENT, Swing
from hsp_control.engine.rotations import exp3, log3

H = 1e-5
STANCE = Stance(width=0.17, narrowest=0.12, widest=0.4, longest=0.6)


def a_swing(height: float = 0.1) -> Swing:
    tilted = exp3(np.array([0.1, 0.2, 0.3]))
    place = Footstep(0.3, 0.1, 0.0)
    start = np.array([0.0, 0.05, height + 0.01])
    return Swing(1.0, 0.6, start, tilted, place, np.eye(3), height, 0.05)


def test_a_quintic_begins_as_given_and_comes_to_rest():
    now = FootMotion(*np.random.default_rng(3).normal(size=(3, 2)))
    motion = to_rest(now, [1.0, -2.0], 0.5, 0.8)
    for given, made in zip(now, motion.sample(0.5), strict=True):
        assert made == pytest.approx(given, abs=1e-12)
    end = motion.sample(1.3 - 1e-12)
    assert end.position == pytest.approx([1.0, -2.0], abs=1e-9)
    assert end.velocity == pytest.approx([0.0, 0.0], abs=1e-9)
    assert end.acceleration == pytest.approx([0.0, 0.0], abs=1e-6)
    x = [motion.sample(0.9 + d * H) for d in (-1, 0, 1)]
    assert (x[2].position - x[0].position) / (2 * H) == pytest.approx(
        x[1].velocity, abs=1e-6
    )
    assert (x[2].velocity - x[0].velocity) / (2 * H) == pytest.approx(
        x[1].acceleration, abs=1e-6
    )


def test_a_foot_that_is_sent_elsewhere_finds_the_slope_there():
    level, slope = a_swing(), np.array([-0.1, 0.02])
    swing = Swing(
        1.0, 0.6, np.zeros(3), np.eye(3), level.target, np.eye(3), 0.1, 0.05, slope
    )
    assert swing.position(1.6).position[2] == pytest.approx(0.1)
    swing.redirect(1.3, Footstep(0.5, 0.2, 0.0), 1.6)
    assert swing.position(1.6).position[2] == pytest.approx(0.1 - 0.02 + 0.002)


def assert_smooth(swing: Swing, first: float, last: float) -> None:
    """Assert that differences of the motion agree with its rates at all times."""
    for t in np.arange(first, last, 0.0037):
        a, b, c = (swing.position(t + d * H) for d in (-1, 0, 1))
        assert (c.position - a.position) / (2 * H) == pytest.approx(
            b.velocity, abs=1e-4
        )
        # C²: the acceleration has no jump that a central difference would show.
        assert (c.velocity - a.velocity) / (2 * H) == pytest.approx(
            b.acceleration, abs=2e-2
        )
        R, S, T = (swing.orientation(t + d * H) for d in (-1, 0, 1))
        y = log3(T.position @ R.position.T)
        assert y / (2 * H) == pytest.approx(S.velocity, abs=1e-5)


def test_a_swing_is_smooth_before_and_after_it_should_have_landed():
    swing = a_swing()
    assert_smooth(swing, 1.0, 1.9)
    assert swing.position(1.0).position == pytest.approx([0.0, 0.05, 0.11])
    assert swing.position(1.3).position[2] == pytest.approx(0.16)
    assert swing.position(1.6).position == pytest.approx([0.3, 0.1, 0.1])
    assert swing.position(1.6).velocity == pytest.approx(np.zeros(3), abs=1e-9)
    assert swing.position(1.0 + APPROACH * 0.6).position[:2] == pytest.approx(
        [0.3, 0.1]
    )
    assert swing.orientation(1.6).position == pytest.approx(np.eye(3), abs=1e-12)
    # Without ground it continues down, at its lift speed.
    assert swing.position(1.9).velocity == pytest.approx([0.0, 0.0, -DESCENT / 12])


@pytest.mark.parametrize("t", [1.05, 1.25, 1.4, 1.5])
@pytest.mark.parametrize("end", [1.55, 1.6, 1.75])
def test_a_redirected_swing_stays_smooth(t, end):
    swing = a_swing()
    before = swing.position(t), swing.orientation(t)
    swing.redirect(t, Footstep(0.4, 0.0, 0.0), end)
    after = swing.position(t), swing.orientation(t)
    for old, new in zip(before, after, strict=True):
        for a, b in zip(old, new, strict=True):
            assert b == pytest.approx(a, abs=1e-9)
    assert_smooth(swing, t + 2 * H, end + 0.1)
    landed = max(end, t + 0.05)
    assert swing.position(landed).position == pytest.approx([0.4, 0.0, 0.1], abs=1e-9)


@pytest.mark.parametrize(("width", "arm"), [(0.17, 0.1), (0.3, 0.15)])
def test_feet_that_turn_accelerate_as_those_that_walk(width, arm):
    """They are half a width off the middle, at least 0.1 m."""
    walk = Walk(speed=0.5, turn=9.0, acceleration=0.4, swing=0.6, double_support=0.15)
    planner = StepPlanner(walk, STANCE._replace(width=width), "a biped")
    first = planner._next_velocity(Velocity(0.0, 0.0, 0.0), 0.0, 0)
    assert first == pytest.approx((0.3, 0.0, 0.3 / arm))


def test_steps_on_a_circle_stay_on_it():
    v, foot = Velocity(0.2, 0.0, 0.5), Footstep(0.0, 0.085, 0.0)
    side, middles = -1.0, []
    for _ in range(16):
        other = STANCE.next(foot, side, v, 0.5)
        middles.append(between(foot, other))
        foot, side = other, -side
    turns = np.diff([each.yaw for each in middles])
    assert turns == pytest.approx(0.25 * np.ones(15))
    points = np.array([[each.x, each.y] for each in middles])
    chords = np.linalg.norm(points[8:] - points[:8], axis=1)
    for foot_of in (chords[::2], chords[1::2]):  # eight steps rotate by two radians
        assert np.ptp(foot_of) < 1e-9
    radius = chords.mean() / (2.0 * np.sin(1.0))
    assert radius == pytest.approx(v.forward / v.turn, rel=0.02)


def test_a_step_keeps_away_from_the_other_foot_and_within_reach():
    place = Footstep(0.0, 0.0, 0.3)
    near = STANCE.kept(place, 1.0, place.ahead(0.1, 0.02))
    assert place.local(near.point) == pytest.approx([0.1, 0.12])
    far = STANCE.kept(place, -1.0, place.ahead(0.9, -0.7))
    assert place.local(far.point) == pytest.approx([0.6, -0.4])


def test_full_turns_between_feet_are_ignored():
    a, b = Footstep(0.0, 0.0, 3.1), Footstep(0.0, 0.2, -3.1)
    assert between(a, b).yaw == pytest.approx(np.pi)
    assert near(0.1, 4 * np.pi) == pytest.approx(0.1 + 4 * np.pi)
    assert near(-3.0, 3.0) == pytest.approx(2 * np.pi - 3.0)


def test_the_nearest_point_of_a_hull():
    corners = convex_hull(
        np.array([[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5], [1, 0.0]])
    )
    assert len(corners) == 4
    inside = np.array([1.3, 0.2])
    assert nearest_inside(corners, inside) is inside
    assert nearest_inside(corners, np.array([3.0, 0.4])).tolist() == [2.0, 0.4]
    assert nearest_inside(corners, np.array([-1.0, 5.0])).tolist() == [0.0, 1.0]
    rng = np.random.default_rng(0)
    hull = convex_hull(rng.normal(size=(30, 2)))
    for point in rng.normal(scale=3.0, size=(20, 2)):
        found = nearest_inside(hull, point)
        # Projection onto a convex set: all corners are on one side.
        assert ((hull - found) @ (point - found)).max() < 1e-9


def test_no_place_and_no_time_is_better_than_those_of_an_adjusted_step():
    planned, wanted, shift = Footstep(0.3, 0.1, 0.2), np.array([0.25, 0.05]), 0.8
    weight, one = np.sqrt(WEIGHT_DCM), np.eye(2)
    for way, pushed in np.random.default_rng(5).normal(scale=0.05, size=(20, 2, 2)):

        def missing(T, way=way, pushed=pushed):
            return (way + pushed) * np.exp(3.3 * (T - 0.3)) - way

        found = adjust(
            planned, 0.3, (0.1, 0.5), lambda T: missing(T) + wanted, wanted, shift,
            lambda u: u,
        )  # fmt: skip
        rows = np.vstack([one, weight * shift * one])
        least = np.inf
        for T in (*np.linspace(0.1, 0.5, 12), 0.3):
            moved, cost, *_ = np.linalg.lstsq(rows, [0, 0, *weight * missing(T)])
            if cost.sum() + WEIGHT_TIME * (T - 0.3) ** 2 < least:
                least = cost.sum() + WEIGHT_TIME * (T - 0.3) ** 2
                best = T, planned.point + moved, missing(T) - shift * moved
        assert found.remaining == pytest.approx(best[0])
        assert found.target.point == pytest.approx(best[1])
        assert found.left == pytest.approx(best[2], abs=1e-12)


def test_a_push_is_answered_by_place_and_where_that_ends_by_time():
    planned, wanted, shift = Footstep(0.3, 0.1, 0.0), np.array([0.25, 0.05]), 0.8
    p, pushed = np.array([0.0, -0.08]), np.array([0.0, 0.06])

    def dcm_at(T):
        return p + (wanted - p + pushed) * np.exp(3.3 * (T - 0.3))

    def least(step: Footstep) -> Footstep:
        return step._replace(y=min(step.y, 0.12))

    free = adjust(planned, 0.3, (0.1, 0.5), dcm_at, wanted, shift, lambda u: u)
    assert free.target.y > 0.13
    held = adjust(planned, 0.3, (0.1, 0.5), dcm_at, wanted, shift, least)
    assert held.target.y <= 0.12
    assert held.remaining < free.remaining < 0.3  # before it moves farther


def test_a_step_that_was_adjusted_to_a_push_is_not_adjusted_again():
    """Where the foot is sent now, the divergent component is as needed."""
    walk, push = Walk(speed=0.3), np.array([0.0, 0.05])
    recovery = PushRecovery(walk, STANCE, 3.3)
    sole = np.array([0.1, 0.05])
    feet = [
        SimpleNamespace(place=place, reach=sole, place_of=lambda origin: origin)
        for place in (Footstep(0.0, -0.085, 0.0), Footstep(-0.1, 0.085, 0.0))
    ]
    target, first = Footstep(0.2, 0.085, 0.0), np.array([0.0, -0.04])
    phase = DcmPhase(walk.swing, np.array([-0.02, -0.085]), np.array([0.02, -0.085]))
    since = 0.3 * walk.swing
    wanted = phase.dcm(first, since, 3.3)
    plan = PlannedSwing(1.0, *feet, target, phase, first, since, wanted, wanted + push)
    level, start = np.eye(3), np.array([-0.1, 0.085, 0.0])
    swing = Swing(0.0, walk.swing, start, level, target, level, 0.0, 0.05)
    assert recovery.step(plan._replace(dcm=wanted), swing, since) is None
    step = recovery.step(plan, swing, since)
    assert step is not None
    assert np.abs(step.target.point - target.point).max() > 0.01
    swing.redirect(since, step.target, since + step.remaining)
    assert recovery.step(plan, swing, since) is None
