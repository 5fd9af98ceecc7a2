"""The hold of the safe stop: a spring and a damper about the rest position.

tau = g(q) - M₀ (ω² (q ⊖ q₀) + 2 ω v), M₀ the mass matrix at q₀.
"""

import numpy as np
import pinocchio as pin
import pytest
from live_rigs import PERIOD
from loaded_robots import panda

from hsp_control.common.arrays import Array
from hsp_control.live import Phase, SafeStop, StopSettings

FREE = np.full(7, np.inf)
SETTINGS = StopSettings(natural_frequency=7.0, rest_speed=0.02, longest_damping=0.05)


def mass_and_gravity(q: Array) -> tuple[Array, Array]:
    """By Pinocchio alone."""
    model = panda().model
    data = model.createData()
    M = np.array(pin.crba(model, data, q))
    return M, np.array(pin.computeGeneralizedGravity(model, data, q))


def stopped(speed: float = 0.0) -> tuple[SafeStop, Array]:
    """Return a safe stop in its hold, and the held configuration."""
    q = panda().random_configuration(np.random.default_rng(1))
    stop = SafeStop(panda(), SETTINGS, FREE, PERIOD)
    stop.effort(panda().state(0.0, q, np.full(7, speed)))
    return stop, q


def test_it_begins_at_rest_and_where_the_robot_then_is() -> None:
    """Damping ends only when the fastest joint is at rest."""
    q = panda().home()
    stop = SafeStop(panda(), SETTINGS, FREE, PERIOD)
    v = np.zeros(7)
    v[3] = -0.021
    for k in range(5):
        tau = stop.effort(panda().state(0.0, q, v))
        assert stop.phase is Phase.DAMPING
        assert stop.damped_for == pytest.approx((k + 1) * PERIOD)
        M, gravity = mass_and_gravity(q)
        np.testing.assert_allclose(tau, gravity - 20.0 * M @ v, rtol=0, atol=1e-9)
    v[3] = -0.019
    there = q + 0.1
    tau = stop.effort(panda().state(0.0, there, v))
    assert stop.phase is Phase.HOLDING
    M, gravity = mass_and_gravity(there)
    np.testing.assert_allclose(tau, gravity - 14.0 * M @ v, rtol=0, atol=1e-9)
    assert stop.damped_for == pytest.approx(5 * PERIOD)
    assert stop.held_for == pytest.approx(PERIOD)


def test_it_begins_at_the_latest_after_the_longest_damping() -> None:
    q, v = panda().home(), np.full(7, 0.5)
    stop = SafeStop(panda(), SETTINGS, FREE, PERIOD)
    damped = 0
    while stop.phase is Phase.DAMPING and damped < 1000:
        stop.effort(panda().state(0.0, q, v))
        damped += stop.phase is Phase.DAMPING
    assert damped == pytest.approx(0.05 / PERIOD, abs=1)


def test_it_pulls_back_to_where_it_began_with_the_inertia_there() -> None:
    """For any displacement of the robot and any command in between."""
    stop, q0 = stopped()
    M0, _ = mass_and_gravity(q0)
    rng = np.random.default_rng(2)
    for _ in range(10):
        q = q0 + rng.uniform(-0.5, 0.5, 7)
        v = rng.standard_normal(7)
        tau = stop.effort(panda().state(0.0, q, v))
        assert stop.phase is Phase.HOLDING  # it does not go back to damping
        _, gravity = mass_and_gravity(q)
        expected = gravity - M0 @ (49.0 * (q - q0) + 14.0 * v)
        np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-9)


def test_it_lasts_as_long_as_it_should() -> None:
    stop, q = stopped()
    held = 1
    while not stop.done and held < 10_000:
        stop.effort(panda().state(0.0, q, np.zeros(7)))
        held += 1
    assert held == round(SETTINGS.hold / PERIOD)
    assert stop.held_for == pytest.approx(SETTINGS.hold)


def test_it_begins_anew() -> None:
    stop, q = stopped()
    stop.begin()
    assert (stop.phase, stop.damped_for, stop.held_for) == (Phase.DAMPING, 0.0, 0.0)
    there = q + 0.2
    stop.effort(panda().state(0.0, there, np.zeros(7)))
    tau = stop.effort(panda().state(0.0, there, np.zeros(7)))
    np.testing.assert_allclose(tau, mass_and_gravity(there)[1], rtol=0, atol=1e-9)
    assert not stop.done


def test_its_pull_is_scaled_as_one_vector_into_the_limits() -> None:
    """The effort keeps its direction; the first motor to saturate sets its size."""
    stop, q0 = stopped()
    q = q0.copy()
    q[1] += 0.8
    M0, gravity = mass_and_gravity(q0)[0], mass_and_gravity(q)[1]
    pull = -M0 @ (49.0 * (q - q0))
    stop._effort_limits = np.abs(gravity) + 5.0
    tau = stop.effort(panda().state(0.0, q, np.zeros(7)))
    share = (tau - gravity) / pull
    np.testing.assert_allclose(share, share[1], rtol=1e-9)
    assert 0.0 < share[1] < 1.0
    assert np.abs(tau - gravity).max() == pytest.approx(5.0, rel=1e-9)
