"""The safe stop: damping dissipates, the hold holds, the watchdog acts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_rigs import PERIOD, gravity, start, watched
from loaded_robots import panda

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.live import LiveSettings, Phase, SafeStop, StopSettings
from hsp_control.live.dead_reckoning import DeadReckoning
from hsp_control.live.report import Deadlines
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant
from hsp_control.simulation.plants.model_changes import Inertias, changed

FREE = np.full(7, np.inf)
LIMITED = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
seeds = st.integers(0, 2**32 - 1)


def at_random(seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return panda().random_configuration(rng), rng.standard_normal(7)


@given(seed=seeds, limited=st.booleans())
def test_damping_dissipates_energy_for_any_inertia(seed: int, limited: bool) -> None:
    q, v = at_random(seed)
    most = LIMITED if limited else FREE
    stop = SafeStop(panda(), StopSettings(damping=8.0), most, PERIOD)
    tau = stop.effort(panda().state(0.0, q, v))
    power = float(v @ (tau - gravity(q)))  # not into potential energy
    M = panda().state(0.0, q, v).mass_matrix
    assert stop.phase is Phase.DAMPING
    assert power < 0.0
    assert (np.abs(tau) <= most * (1.0 + 1e-12)).all()
    if not limited:
        np.testing.assert_allclose(power, -8.0 * v @ M @ v, rtol=1e-9)


def test_a_share_of_the_damping_brakes_where_clipped_damping_would_drive() -> None:
    rng = np.random.default_rng(0)
    driven = 0
    state = panda().state(0.0, start(), np.zeros(7))
    for _ in range(1000):
        q = panda().random_configuration(rng)
        v = rng.standard_normal(7) * rng.choice([0.0, 1.0, 3.0], 7)
        most = np.abs(gravity(q)) + rng.uniform(
            0.5, 20.0, 7
        )  # little is left for braking
        stop = SafeStop(panda(), StopSettings(rest_speed=1e-9), most, PERIOD)
        tau = stop.effort(state.update(0.0, q, v))
        assert v @ (tau - gravity(q)) <= 1e-9
        assert (np.abs(tau) <= most * (1.0 + 1e-12)).all()
        clipped = np.clip(gravity(q) - 20.0 * state.mass_matrix @ v, -most, most)
        driven += v @ (clipped - gravity(q)) > 1.0  # [W]
    assert driven > 0


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "factor"), [(0, 0.6), (1, 1.0), (2, 1.6)])
def test_it_stops_a_robot_that_is_not_the_model(seed: int, factor: float) -> None:
    """With wrong masses it comes to rest; the hold's error is that of gravity."""
    _, v = at_random(seed)
    own = changed(panda(), [Inertias(factor, 1.0, [0.0, 0.0, 0.0])])
    plant = IntegratedPlant(RigidBodyPlant(own), Rk4(PERIOD))
    stop = SafeStop(panda(), StopSettings(), LIMITED, PERIOD)
    q, t = start(), 0.0
    plant.reset(0.0, q, v)
    state = panda().state(0.0, q, v)
    for k in range(4000):
        tau = stop.effort(state.update(t, q, v))
        q, v = plant.advance(t, (k + 1) * PERIOD, tau)
        t = (k + 1) * PERIOD
    assert stop.phase is Phase.HOLDING
    assert np.abs(v).max() < 0.01
    # In equilibrium K (q - q0) = (factor - 1) g: the PD's sag, first order in it.
    sag = np.abs(panda().difference(stop.held_q, q))
    assert sag.max() < 0.5 * abs(factor - 1.0) + 1e-6


@given(seed=seeds)
def test_the_share_is_the_greatest_that_fits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    most = rng.uniform(0.1, 5.0, 6)
    most[0] = np.inf
    base = rng.uniform(-1.3, 1.3, 6) * np.where(np.isfinite(most), most, 1.0)
    direction = rng.standard_normal(6) * rng.choice([0.0, 0.1, 10.0], 6)
    given = {"base": base, "direction": direction, "limits": most}
    s = engine.ScaleIntoLimits(**given, tau=np.zeros(6))()
    assert 0.0 <= s <= 1.0
    inside = (np.abs(base) <= most).all()
    if inside:
        assert (np.abs(base + s * direction) <= most * (1.0 + 1e-12)).all()
        if s < 1.0:
            more = np.abs(base + 1.01 * s * direction + 1e-9 * direction)
            assert (more > most).any()


def test_reckoning_is_the_model_s_motion() -> None:
    q, v = at_random(3)
    reckoning = DeadReckoning(panda(), PERIOD)
    reckoning.correct(0.0, q, v)
    tau = gravity(q)
    reckoning.predict(tau)
    moved = panda().difference(q, reckoning.state.q)
    np.testing.assert_allclose(moved, PERIOD * reckoning.state.v, atol=1e-12)
    for _ in range(49):
        reckoning.predict(tau)
    assert reckoning.predicted_for == pytest.approx(0.05)
    plant = IntegratedPlant(RigidBodyPlant(panda()), Rk4(PERIOD))
    plant.reset(0.0, q, v)
    for i in range(50):
        q, v = plant.advance(i * PERIOD, (i + 1) * PERIOD, tau)
    # Semi-implicit Euler: first order, |a| h t/2 of about 40 · 1e-3 · 0.025.
    assert np.abs(panda().difference(q, reckoning.state.q)).max() < 2e-3
    assert reckoning.state.t == pytest.approx(0.05)
    before = reckoning.state.q.copy()
    reckoning.predict(np.full(7, np.nan))
    np.testing.assert_array_equal(reckoning.state.q, before)


# --- the robot's watchdog ------------------------------------------------------------


def test_its_watchdog_counts_and_resets() -> None:
    robot = watched(LiveSettings(watchdog=5))
    tau = gravity(start()) + 0.3
    for _ in range(3):
        robot.advance([tau])
        for _ in range(5):
            robot.advance([])
            np.testing.assert_array_equal(robot.tau, tau)  # held
    assert robot.phase is Phase.RUNNING
    robot.advance([])
    assert robot.phase is Phase.DAMPING
    assert robot.reason == "the watchdog: no valid effort for 6 periods"
    for _ in range(1500):
        robot.advance([tau + 50.0])  # commands are ignored from now on
        assert np.isfinite(robot.tau).all()
    assert robot.done
    assert np.abs(robot.v).max() < 0.01
    assert robot.reason.startswith("the watchdog")


# --- deadlines -----------------------------------------------------------------------


def test_deadlines_are_counted_over_all_and_sorted_over_the_last() -> None:
    deadlines = Deadlines(0.001, capacity=100)
    assert deadlines.response is None
    deadlines.add(0.5, 0.01)  # the worst one, long ago
    for k in range(150):
        deadlines.add(0.001, 1e-5 * (k % 100 + 1))
    assert deadlines.periods == 151
    assert deadlines.missed == 1
    response, interval = deadlines.response, deadlines.interval
    assert response is not None
    assert interval is not None
    assert response.worst == 0.01
    assert interval.worst == 0.5
    assert response.median == pytest.approx(0.00051, rel=0.03)
    assert response.p99 == pytest.approx(0.001, rel=0.02)
    assert interval.median == 0.001
