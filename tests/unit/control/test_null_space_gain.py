"""Check that every null-space gain that is accepted makes e_N decay, in every metric.

V = ½ e_NᵀW e_N gives V' = -e_NᵀW K_N e_N: the symmetric part of W K_N must be positive
definite, at each configuration if W changes with it.
"""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from places import THOROUGH
from robot_cases import load
from wording import wording

import hsp_control as hsp
from hsp_control import Controller, FramePosition, Robot, TargetPosture
from hsp_control.common.arrays import Array
from hsp_control.common.errors import GainError
from hsp_control.control.fitting import checked_gain

COUNT = 2500 if THOROUGH else 500
"""Gains per robot, of four robots."""
ROBOTS = ("planar3r", "panda", "ur5", "talos_arm_free_flyer")
seeds = st.integers(0, 2**32 - 1)


def mass_matrices(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Return M at random configurations, by plain Pinocchio, shape (count, nv, nv)."""
    data, found = robot.model.createData(), np.empty((count, robot.nv, robot.nv))
    for M in found:
        full = np.triu(pin.crba(robot.model, data, robot.random_configuration(rng)))
        M[:] = full + np.triu(full, 1).T
    return found


def random_gain(nv: int, rng: np.random.Generator) -> Any:
    """Return a gain of one of the kinds that a user may try."""
    rates = 10.0 ** rng.uniform(-1.0, 2.0, nv)
    turn = np.linalg.qr(rng.normal(size=(nv, nv)))[0]
    kinds: tuple[Any, ...] = (
        rates[0],
        np.full(nv, rates[0]),
        rates[0] * np.eye(nv),
        rates,
        np.diag(rates),
        turn @ np.diag(rates) @ turn.T,
        np.diag(rates) + 0.3 * rng.normal(size=(nv, nv)),
        rates[0] * (np.eye(nv) + 1e-9 * rng.normal(size=(nv, nv))),
    )
    return kinds[rng.integers(len(kinds))]


def smallest_rates(W: Array, K_N: Array) -> Array:
    """Return the smallest eigenvalue of sym(W K_N) for each pair, relative to W."""
    decay = W @ K_N
    smallest = np.linalg.eigvalsh(0.5 * (decay + decay.transpose(0, 2, 1)))[:, 0]
    return np.asarray(smallest / np.linalg.eigvalsh(W)[:, 0])


@pytest.mark.parametrize("name", ROBOTS)
def test_accepted_gains_decay_at_every_configuration(name: str) -> None:
    """Over the mass matrix; some positive definite K_N must be refused, too."""
    robot, rng = load(name), np.random.default_rng(41)
    accepted, refused = [], []
    for _ in range(COUNT):
        gain = random_gain(robot.nv, rng)
        try:
            accepted.append(checked_gain(gain, robot, hsp.metrics.MassMatrixMetric()))
        except GainError:
            refused.append(np.diag(gain) if np.ndim(gain) == 1 else gain)
    assert min(len(accepted), len(refused)) > 0.2 * COUNT
    W = mass_matrices(robot, len(accepted), rng)
    assert (smallest_rates(W, np.array(accepted)) > 0.09).all()
    W = mass_matrices(robot, len(refused), rng)
    assert (smallest_rates(W, np.array(refused)) < 0.0).mean() > 0.1


@pytest.mark.parametrize("name", ROBOTS)
def test_in_a_constant_metric_exactly_decaying_gains_are_accepted(
    name: str,
) -> None:
    robot, rng = load(name), np.random.default_rng(42)
    here = mass_matrices(robot, 1, rng)[0]
    metrics: dict[str, tuple[hsp.metrics.Metric, Array]] = {
        "identity": (hsp.metrics.IdentityMetric(), np.eye(robot.nv)),
        "constant": (hsp.metrics.ConstantMetric(here), here),
    }
    for metric, W in metrics.values():
        outcomes = []
        for _ in range(COUNT // 10):
            gain = np.asarray(random_gain(robot.nv, rng))
            K_N = gain if gain.ndim == 2 else gain * np.eye(robot.nv)
            decays = smallest_rates(W[None], K_N[None])[0] > 0.0
            try:
                checked_gain(gain, robot, metric)
            except GainError:
                assert not decays
            else:
                assert decays
            outcomes.append(decays)
        assert any(outcomes)
        assert not all(outcomes)


@given(seeds)
def test_a_ramp_between_gains_that_decay_decays(seed: int) -> None:
    """V' is linear in K_N, so a mixture decays at least as fast as the slower one."""
    robot, rng = load("panda"), np.random.default_rng(seed)
    W = np.diag(10.0 ** rng.uniform(-1.0, 1.0, 7))[None]
    fair = [np.linalg.solve(W[0], damping(7, rng)) for _ in range(2)]
    for gain in fair:
        checked_gain(gain, robot, hsp.metrics.ConstantMetric(W[0]))
    s = rng.uniform()
    mixed = smallest_rates(W, (s * fair[0] + (1.0 - s) * fair[1])[None])
    assert mixed > 0.999 * min(smallest_rates(W, each[None]) for each in fair)


def damping(nv: int, rng: np.random.Generator) -> Array:
    """Return a positive definite matrix."""
    root = rng.normal(size=(nv, nv))
    return np.asarray(5.0 * np.eye(nv) + root @ root.T)


REFUSED = "null_space_gain is no multiple ... MassMatrixMetric ... one number ... 2.5"


def holding(gain: Any, metric: hsp.metrics.Metric) -> Controller:
    robot = load("panda")
    hand, field = FramePosition("panda_tcp"), TargetPosture(robot.home() + 0.2)
    return Controller(
        robot, [hand], field, null_space_gain=gain, metric=metric, limits=None
    )


@pytest.mark.parametrize(
    "gain", [[2.5, *range(3, 9)], np.diag([2.5, *range(3, 9)]), 2.5 + np.eye(7)]
)
def test_a_matrix_over_the_mass_matrix_is_refused(gain: Any) -> None:
    mass = hsp.metrics.MassMatrixMetric()
    if np.ndim(gain) == 2 and gain[0, 1]:
        gain = gain - 1.0  # off the diagonal, too
    with pytest.raises(GainError, match=wording(REFUSED)):
        holding(gain, mass)
    controller = holding(7 * [4.0], mass)
    with pytest.raises(GainError, match=wording("gain: ... " + REFUSED)):
        controller.at(1.0).null_space_gain(gain)
    np.testing.assert_array_equal(controller.null_space_gain, 4.0 * np.eye(7))
    controller.at(1.0).null_space_gain(6.0)
