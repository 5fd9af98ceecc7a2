"""The barrier of the clearance fields: its formula, range, and number of
evaluations."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from clearance_cases import AIR, barrier_at, still
from hypothesis import given
from hypothesis import strategies as st
from loaded_robots import load
from oracles import slope

from hsp_control import Cost, Obstacle, load_experiment
from hsp_control.geometry.closed_form import ClosedFormDistances
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import FieldSample, ObstacleClearance
from hsp_control.null_space.metrics import IdentityMetric, MetricSample
from hsp_control.trajectories import Hold, UniformLine

# --- the barrier ---------------------------------------------------------------------

CORE = 0.02  # for smaller s it is a parabola


@given(s=st.floats(-2.0, 1.5), influence=st.floats(0.01, 10.0))
def test_barrier_is_its_formula_with_exact_derivatives(
    s: float, influence: float
) -> None:
    """-(1 - s)² ln s above the core, a parabola with the same tangent below.

    Differences of sixth order over a hundredth of the distance to the change of the
    formula.
    """
    value, first, second = barrier_at(s * influence, influence)
    s = s * influence / influence
    if s >= 1.0:
        assert (value, first, second) == (0.0, 0.0, 0.0)
        return
    at = max(s, CORE)
    b = -((1.0 - at) ** 2) * np.log(at)
    b1 = 2.0 * (1.0 - at) * np.log(at) - (1.0 - at) ** 2 / at
    b2 = -2.0 * np.log(at) + 4.0 * (1.0 - at) / at + ((1.0 - at) / at) ** 2
    down = s - at
    expected = [b + b1 * down + 0.5 * b2 * down**2, b1 + b2 * down, b2]
    np.testing.assert_allclose(
        [value, first * influence, second * influence**2], expected, rtol=1e-13
    )
    step = 0.01 * min(abs(s - CORE), 1.0 - s, max(s, 0.1))
    if step > 1e-6:
        rise = slope(lambda x: barrier_at((s + x) * influence, influence)[0], step)
        bend = slope(lambda x: barrier_at((s + x) * influence, influence)[1], step)
        assert rise / influence == pytest.approx(first, rel=1e-7, abs=1e-7 / influence)
        assert bend / influence == pytest.approx(second, rel=1e-7, abs=1e-6 / influence)


# --- out of influence, and once per state --------------------------------------------


def evaluate(field: Cost, state: Any) -> FieldSample:
    """Return g and g' in the identity metric."""
    metric = IdentityMetric()
    nv = state.robot.nv
    sample = metric.evaluate(state, MetricSample.allocate(nv))
    out = FieldSample(np.full(nv, np.nan), np.full(nv, np.nan))
    return field.evaluate(state, sample, metric.form, out)


def test_the_rate_is_zero_however_quick_the_obstacle() -> None:
    """Out of influence g is zero in a neighbourhood, so g' is exactly zero.

    At 20 m/s a ball moves 4 cm within a difference step of 2 ms: differences would
    reach into the influence and give a wrong rate.
    """
    robot = load("panda")
    start = np.array([0.5, 0.5, 0.5])
    state = robot.state(0.0, robot.home(), np.zeros(7))
    resting = Obstacle("ball", Sphere(0.1), Hold(start))
    field = ObstacleClearance([resting])
    d = field.minimum_distance(state)
    proximity = field.proximity(state)
    k = int(np.argmin(proximity.distances))
    n = proximity.witness(k)[0] - proximity.witness(k)[1]
    ball = Obstacle("ball", Sphere(0.1), UniformLine(20.0 * n / d, start))
    for gap in (0.001, 0.03, 0.051):
        quick = ObstacleClearance([ball], influence=d - gap)
        np.testing.assert_array_equal(evaluate(quick, state).g, 0.0)
        np.testing.assert_array_equal(quick.gradient_rate(state), 0.0)
    near = ObstacleClearance([ball], influence=d + 0.01)
    assert np.abs(near.gradient_rate(state)).max() > 0.0


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Count the calls of Pinocchio's distance computation."""
    made: list[int] = []
    measure = pin.computeDistances

    def counting(*arguments: Any) -> Any:
        made.append(1)
        return measure(*arguments)

    monkeypatch.setattr(pin, "computeDistances", counting)
    return made


def test_distances_are_measured_once_per_state(calls: list[int]) -> None:
    """For any number of requests; and four times more along the flow, for g'.

    This applies to Coal; distances in closed form have an exact rate.
    """
    robot = load("panda")
    ball = Obstacle("ball", Sphere(0.1), AIR)
    field = ObstacleClearance([ball], influence=1.0, proxy="hulls")
    state = still(robot)
    for _ in range(2):
        field.value(state)
        field.gradient(state)
        field.minimum_distance(state)
        field.proximity(state).nearest(state)
    assert len(calls) == 1
    evaluate(field, state)
    assert len(calls) == 5
    state.update(0.0, robot.home() + 0.01, np.zeros(7))
    field.gradient(state)
    field.value(state)
    assert len(calls) == 6
    far = ObstacleClearance([ball], influence=0.01, proxy="hulls")
    del calls[:]
    evaluate(far, state)
    assert len(calls) == 1
    del calls[:]
    evaluate(ObstacleClearance([ball], influence=1.0), state)
    assert not calls


def test_rows_of_a_log_bind_nothing_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """The values of the field and of its terms belong to one state."""
    bound: list[int] = []
    make = ClosedFormDistances.calls

    def counting(self: ClosedFormDistances, *arguments: Any) -> Any:
        bound.append(1)
        return make(self, *arguments)

    monkeypatch.setattr(ClosedFormDistances, "calls", counting)
    counts = []
    for duration in (0.02, 0.2):
        bound.clear()
        load_experiment("panda_obstacle", f"simulation.duration={duration}").run()
        counts.append(len(bound))
    assert counts[0] == counts[1]
