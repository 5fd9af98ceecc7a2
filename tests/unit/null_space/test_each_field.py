"""Properties of single fields, and sums of fields."""

from dataclasses import replace

import numpy as np
import pytest
from field_cases import draw, evaluate, metrics, placed, posture
from field_oracles import OBSTACLE, TIME, load, spread, swirl_field, target

from hsp_control import (
    Controller,
    FramePosition,
    JointCentering,
    NullSpaceField,
    Rest,
    Robot,
    RobotState,
    TargetPosture,
)
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError
from hsp_control.law import IDENTITY, FieldSample, MetricSample
from hsp_control.null_space.fields import (
    FieldSum,
    InverseCondition,
    Manipulability,
    ObstacleClearance,
    PointDistance,
    Ramp,
    StateWeight,
    Uncontrolled,
)
from hsp_control.null_space.fields.weight import Product
from hsp_control.trajectories import Hold

# --- members, one by one -------------------------------------------------------------


def test_joint_centering_draws_no_joint_faster_than_its_weight() -> None:
    """A finger's range is 4 cm: scaled by it, the rate would be 2500 1/s."""
    robot = Robot.load("panda", locked={})
    speeds = JointCentering().gradient_rate(
        robot.state(0.0, robot.home(), np.ones(robot.nv))
    )
    assert robot.units[7] == "m"
    assert speeds[7] == 1.0
    assert (speeds <= 1.0).all()


@pytest.mark.slow
def test_target_posture_is_smooth_all_the_way_round() -> None:
    """Three turns through pi: slope and rate change within their bounds.

    ∇f = w sin d has slope w, (∇f)' = w cos d v has slope w |v|: a rotation by 0.02 rad
    changes them by 0.02 of that; ½d² would jump by 2 pi w.
    """
    robot = load("planar3r")
    field = posture("planar3r", weights=[2.0, 3.0, 0.0])
    v, step = np.array([1.0, -1.0, 1.0]), 0.02
    q = target("planar3r")
    slopes, rates, values = [], [], []
    for _ in range(int(6.0 * np.pi / step)):
        state = robot.state(0.0, q, v)
        slopes.append(field.gradient(state))
        rates.append(field.gradient_rate(state))
        values.append(field.value(state))
        q = robot.integrate(q, step * v)
    bound = 3.0 * step * (1 + 1e-9)
    assert np.abs(np.diff(slopes, axis=0)).max() <= bound
    assert np.abs(np.diff(rates, axis=0)).max() <= bound
    assert np.abs(np.diff(values)).max() <= 5.0 * step * (1 + 1e-9)
    assert max(values) == pytest.approx(10.0, abs=3e-4)
    # It is periodic: the same after a whole turn.
    turn = round(2.0 * np.pi / step)
    np.testing.assert_allclose(slopes[turn], slopes[0], atol=3 * step)


# --- placing -------------------------------------------------------------------------


def test_postures_are_placed() -> None:
    """Joint positions have shape (nv,), configurations (nq,): both mean one posture."""
    for name in ("planar3r", "rolling ur5", "panda"):
        robot = load(name)
        q, _ = draw(name, 32)
        start = robot.state(0.0, q, np.zeros(robot.nv))
        positions = spread(robot.nv, -0.7, 0.9)
        for field, expected in (
            (TargetPosture(), q),
            (TargetPosture("start"), q),
            (TargetPosture("home"), robot.home()),
            (TargetPosture(positions), target(name)),
            (posture(name), target(name)),
        ):
            found = placed(field, start)
            np.testing.assert_array_equal(found.target, expected)
            assert found == TargetPosture(expected)
            assert placed(found, robot.state(0.0, robot.home(), start.v)) == found
    assert TargetPosture() == TargetPosture("start")


def test_frames_obstacles_and_terms_are_placed() -> None:
    robot = load("panda")
    state = robot.state(0.0, robot.home(), np.zeros(7))
    far = replace(OBSTACLE, name="far", center=Hold([9.0, 9.0, 9.0]))
    scene = [OBSTACLE, far]
    for field in (Manipulability(), InverseCondition(axes="xy")):
        found = placed(field, state)
        assert found.frame == robot.end_effector
        assert found == replace(field, frame=robot.end_effector)
        assert placed(found, state) == found
    distance = PointDistance(["panda_link4"], "far")
    assert placed(distance, state, scene) == replace(distance, obstacle=far)
    for obstacles, expected in (
        (None, (OBSTACLE, far)),
        (["far"], (far,)),
        ([far, "ball"], (far, OBSTACLE)),
    ):
        found = placed(ObstacleClearance(obstacles), state, scene)
        assert found.obstacles == expected
        assert placed(found, state) == found
    total = 2.0 * distance + TargetPosture("home") + Manipulability(weight=3.0)
    found = placed(total, state, scene)
    assert found.name == total.name
    assert [f.weight for f in found.terms] == [2.0, 1.0, 3.0]
    assert found.terms == tuple(placed(term, state, scene) for term in total.terms)
    named = FieldSum([Rest(), Rest()], name="two rests")
    assert placed(named, state) == named


def test_a_field_with_a_value_of_its_own_is_diagnosed_by_it() -> None:
    """A subclass that overrides `value` only does not inherit the call of another."""

    class Halved(JointCentering):
        def value(self, state: RobotState) -> float:
            return 0.5 * super().value(state)

    robot = load("panda")
    q, v = draw("panda", 3)
    found = []
    for field in (Halved(), JointCentering()):
        controller = Controller(robot, [FramePosition("panda_tcp", Hold())], field)
        controller.compute(TIME, q, v)
        found.append(controller.diagnose().field_value)
    assert found[0] == 0.5 * found[1] > 0.0


class _HalfAsFast(JointCentering):
    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        super().evaluate(state, metric, form, out)
        out.g[:] *= 0.5
        return out


class _HalfAsSteep(JointCentering):
    def gradient(self, state: RobotState) -> Array:
        return 0.5 * super().gradient(state)


class _HalfAsClear(ObstacleClearance):
    def gradient(self, state: RobotState) -> Array:
        return 0.5 * super().gradient(state)


@pytest.mark.parametrize(
    "own", [_HalfAsFast(), _HalfAsSteep(), _HalfAsClear([OBSTACLE], influence=2)]
)
def test_a_step_calls_methods_that_a_subclass_overrides(own: NullSpaceField) -> None:
    """Although the base class has kernels, which a step prefers."""
    of_package = type(own).__mro__[1](**own.all_fields())
    robot, found = load("panda"), []
    state = robot.state(TIME, *draw("panda", 3))
    metric = MetricSample.allocate(robot.nv)
    for field in (own, of_package):
        sample = FieldSample.allocate(robot.nv)
        state.run(field.calls(state, metric, IDENTITY, sample))
        found.append(sample.g)
    np.testing.assert_allclose(found[0], 0.5 * found[1], rtol=1e-13)
    assert np.any(found[0])


# --- fading --------------------------------------------------------------------------


def test_a_sum_of_ramped_fields_is_exact_at_both_ends_and_flat() -> None:
    """Bit for bit the first field before the start, the second one after the end."""
    robot = load("panda")
    before = 0.3 * JointCentering() + swirl_field("panda", rate=True)
    slow = StateWeight(lambda s: 1.5 + np.sin(s.t))
    after = 0.7 * posture("panda") + slow * swirl_field("panda", rate=True)
    fading = Ramp(initial=1.0, final=0.0, start=1.0, duration=0.5)
    rising = Ramp(initial=0.0, final=1.0, start=1.0, duration=0.5)
    faded = fading * before + rising * after
    assert len(faded.terms) == 4
    assert isinstance(faded.terms[3].weight, Product)
    for t, only in ((0.9, before), (1.0, before), (1.5, after), (1.7, after)):
        state = robot.state(t, *draw("panda", 33))
        metric = metrics(robot)["mass matrix"][0]
        for found, expected in zip(
            evaluate(faded, metric, state), evaluate(only, metric, state), strict=True
        ):
            np.testing.assert_array_equal(found, expected)
        assert faded.value(state) == only.value(state)
    with pytest.raises(FieldError, match="an uncontrolled null space has no weight"):
        rising * Uncontrolled()
