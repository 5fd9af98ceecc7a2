"""The filter: its Jacobians, its symmetry, its consistency, its convergence."""

from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, logm
from walked_filter import DENSITIES, GRAVITY, SEEN, walked

from hsp_control.companions.walking.estimation.invariant_filter import (
    ACCELEROMETER,
    FIXED,
    GYROSCOPE,
    POSITION,
    ROTATION,
    VELOCITY,
    Densities,
    InvariantFilter,
    skew,
)


def random_filter(random, points=2):
    """Return a filter at a random state, with points."""
    made = InvariantFilter(
        expm(skew(random.normal(size=3))),
        random.normal(size=3),
        random.normal(size=3),
        0.01 * np.eye(FIXED),
        DENSITIES,
        GRAVITY,
    )
    made.gyroscope_bias = 0.1 * random.normal(size=3)
    made.accelerometer_bias = 0.1 * random.normal(size=3)
    if points:
        seen = random.normal(size=(points, 3))
        made.add(range(points), seen, SEEN**2 * np.eye(3 * points))
    return made


def group_element(estimate):
    """Return X as a matrix, from the definition of SE_{n+2}(3)."""
    columns = [estimate.velocity, estimate.position, *estimate.points]
    X = np.eye(3 + len(columns))
    X[:3, :3] = estimate.rotation
    X[:3, 3:] = np.transpose(columns)
    return X


def error_of(estimate, true):
    """Return ξ and ζ by matrix logarithm: X̂ X⁻¹ = exp(ξ)."""
    logarithm = logm(group_element(estimate) @ np.linalg.inv(group_element(true))).real
    turn = logarithm[[2, 0, 1], [1, 2, 0]]
    velocity, position, *points = logarithm[:3, 3:].T
    biases = (
        estimate.gyroscope_bias - true.gyroscope_bias,
        estimate.accelerometer_bias - true.accelerometer_bias,
    )
    return np.concatenate([turn, velocity, position, *biases, *points])


def displaced(true, error):
    """Return the filter with a given error."""
    estimate = deepcopy(true)
    estimate.retract(error)
    return estimate


def test_the_transition_is_the_derivative_of_the_motion():
    random = np.random.default_rng(2)
    estimate = random_filter(random)
    omega, force, h = random.normal(size=3), 10.0 * random.normal(size=3), 0.05

    def after(error):
        """Return the error after a period with the same readings."""
        true = displaced(estimate, -error)  # to first order
        before = error_of(estimate, true)
        hat = deepcopy(estimate)
        for each in (hat, true):
            each.predict(omega, force, h)
        return before, error_of(hat, true)

    moved, step = deepcopy(estimate), 1e-5
    turn = h * (omega - estimate.gyroscope_bias)
    left = sum(  # of SO(3), by its series
        np.linalg.matrix_power(skew(turn), k) / np.prod(range(1, k + 2))
        for k in range(20)
    )  # fmt: skip
    moved.predict(omega, force, h)
    Phi = moved._transition(estimate.rotation, -h * estimate.rotation @ left, h)
    for k in range(FIXED + 6):
        error = step * np.eye(FIXED + 6)[k]
        (b_plus, plus), (b_minus, minus) = after(error), after(-error)
        found = (plus - minus) / (2.0 * step)
        expected = Phi @ ((b_plus - b_minus) / (2.0 * step))
        assert found == pytest.approx(expected, abs=1e-7), k


def test_a_period_adds_the_variance_of_its_noise():
    """From zero covariance at the origin, at rest: density² h, for any period."""
    made, n, h = random_filter(np.random.default_rng(7)), DENSITIES, 0.02
    made.velocity, made.position = np.zeros(3), np.zeros(3)
    made.points, made.covariance = np.zeros((2, 3)), np.zeros((FIXED + 6, FIXED + 6))
    still = made.accelerometer_bias - made.rotation.T @ GRAVITY
    made.predict(made.gyroscope_bias, still, h)
    of = [n.gyroscope, n.accelerometer, n.gyroscope_walk, n.accelerometer_walk]
    blocks = [ROTATION, VELOCITY, GYROSCOPE, ACCELEROMETER, slice(FIXED, None)]
    for block, density in zip(blocks, [*of, n.slip], strict=True):
        assert np.diag(made.covariance)[block] == pytest.approx(h * density**2)


def test_the_innovation_is_linear_in_the_error():
    random = np.random.default_rng(3)
    true = random_filter(random)
    y = (true.points - true.position) @ true.rotation
    H, step = true.observation(), 1e-6
    for k in range(FIXED + 6):
        hat = displaced(true, step * np.eye(FIXED + 6)[k])
        z = (y @ hat.rotation.T + hat.position - hat.points).ravel()
        assert z / step == pytest.approx(H[:, k], abs=1e-5)


def test_a_correction_is_that_of_least_squares():
    """P⁻¹ grows by Hᵀ N⁻¹ H, and the error is -P Hᵀ N⁻¹ z: without a gain."""
    random = np.random.default_rng(6)
    before = random_filter(random)
    A = random.normal(size=(FIXED + 6, FIXED + 6))
    before.covariance = A @ A.T
    seen, n = random.normal(size=(2, 3)), np.diag(random.uniform(0.5, 2.0, 6))
    after, turned = deepcopy(before), np.kron(np.eye(2), before.rotation)
    after.correct(seen, n)
    H, N = before.observation(), turned @ n @ turned.T
    grown = np.linalg.inv(before.covariance) + H.T @ np.linalg.solve(N, H)
    assert after.covariance == pytest.approx(np.linalg.inv(grown), rel=1e-6, abs=1e-8)
    z = (seen @ before.rotation.T + before.position - before.points).ravel()
    wanted = -np.linalg.solve(grown, H.T @ np.linalg.solve(N, z))
    assert displaced(before, wanted).points == pytest.approx(after.points)
    assert displaced(before, wanted).velocity == pytest.approx(after.velocity)


def test_a_new_point_has_the_error_of_where_it_is_seen_from():
    random = np.random.default_rng(4)
    true = random_filter(random, points=0)
    true.covariance = random.normal(size=(FIXED, FIXED))
    true.covariance = true.covariance @ true.covariance.T
    place, noise = random.normal(size=(1, 3)), np.diag([1.0, 4.0, 9.0])
    grown, step = deepcopy(true), 1e-6
    grown.add(["point"], place, noise)
    # As a function of the error and of the measurement noise.
    columns = []
    for k in range(FIXED + 3):
        hat = displaced(true, step * np.eye(FIXED + 3)[k][:FIXED])
        ideal = deepcopy(true)
        ideal.add(["point"], place, noise)
        hat.add(["point"], place + step * np.eye(FIXED + 3)[k][FIXED:], noise)
        columns.append(error_of(hat, ideal) / step)
    J = np.transpose(columns)
    P = np.zeros((FIXED + 3, FIXED + 3))
    P[:FIXED, :FIXED], P[FIXED:, FIXED:] = true.covariance, noise
    assert grown.covariance == pytest.approx(J @ P @ J.T, rel=1e-4, abs=1e-3)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), yaw=st.floats(-3.0, 3.0))
def test_it_does_not_matter_where_the_world_begins(seed, yaw):
    """Another heading and origin of the world transform the estimate only."""
    random = np.random.default_rng(seed)
    here, turn = random_filter(random), expm(skew(np.array([0.0, 0.0, yaw])))
    offset = random.normal(size=3)
    there = deepcopy(here)
    there.rotation, there.velocity = turn @ here.rotation, turn @ here.velocity
    there.position = turn @ here.position + offset
    there.points = here.points @ turn.T + offset
    # The adjoint of the group carries the covariance.
    size = FIXED + 6
    Ad = np.eye(size)
    for rows in (ROTATION, VELOCITY, POSITION, slice(15, 18), slice(18, 21)):
        Ad[rows, rows] = turn
    for rows in (POSITION, slice(15, 18), slice(18, 21)):
        Ad[rows, ROTATION] = skew(offset) @ turn
    there.covariance = Ad @ here.covariance @ Ad.T
    for _ in range(5):
        omega, force = random.normal(size=3), 10.0 * random.normal(size=3)
        seen = (here.points - here.position) @ here.rotation
        seen += 0.01 * random.normal(size=seen.shape)
        for each in (here, there):
            each.predict(omega, force, 0.01)
            each.correct(seen, SEEN**2 * np.eye(6))
    assert there.rotation == pytest.approx(turn @ here.rotation, abs=1e-9)
    assert there.velocity == pytest.approx(turn @ here.velocity, abs=1e-8)
    assert there.position == pytest.approx(turn @ here.position + offset, abs=1e-8)
    assert there.gyroscope_bias == pytest.approx(here.gyroscope_bias, abs=1e-8)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_covariance_stays_one(seed):
    random = np.random.default_rng(seed)
    made = random_filter(random, points=1)
    for k in range(30):
        made.predict(random.normal(size=3), 20.0 * random.normal(size=3), 0.01)
        if random.random() < 0.3:
            made.add([("new", k)], random.normal(size=(1, 3)), SEEN**2 * np.eye(3))
        if random.random() < 0.2 and made.names:
            made.drop(made.names[:1])
        before, n = np.trace(made.covariance), len(made.names)
        made.correct(random.normal(size=(n, 3)), SEEN**2 * np.eye(3 * n))
        assert np.trace(made.covariance) <= before * (1.0 + 1e-9)
        assert made.covariance == pytest.approx(made.covariance.T)
        assert np.linalg.eigvalsh(made.covariance).min() > -1e-12
        assert made.rotation @ made.rotation.T == pytest.approx(np.eye(3), abs=1e-12)


START = np.repeat([0.05, 0.1, 0.02, 0.01, 0.1], 3)


def test_without_noise_observable_states_converge():
    """Tilt, velocity and biases, from a wrong start; the heading keeps its error."""
    start = START.copy()
    start[9:] = [*3 * [0.02], *3 * [0.05]]
    random = np.random.default_rng(7)
    quiet = Densities(1e-4, 1e-3, 1e-6, 1e-5, 1e-5)
    walker, estimate = walked(random, start, 6.0, quiet, 1e-4, noise=0.0)
    error = error_of(estimate, walker.true(estimate))
    down = np.array([0.0, 0.0, 1.0])
    tilt = estimate.rotation.T @ down - walker.rotation.T @ down
    velocity = walker.rotation.T @ walker.velocity
    assert np.abs(tilt).max() < 1e-4
    assert estimate.rotation.T @ estimate.velocity == pytest.approx(velocity, abs=1e-4)
    assert np.abs(error[GYROSCOPE]).max() < 1e-4
    assert np.abs(error[ACCELEROMETER]).max() < 1e-3
    assert abs(error[2]) > 0.01
