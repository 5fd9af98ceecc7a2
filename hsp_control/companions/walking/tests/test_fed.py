"""References and schedules that are set while a robot moves."""

import pickle
from copy import deepcopy

import numpy as np
import pinocchio as pin
import pytest

from hsp_control import FramePose
from hsp_control.common.errors import TrajectoryError
from hsp_control.companions.walking.contact_switch import Switch
from hsp_control.companions.walking.planned_references import Fed, FedOrientation
from hsp_control.engine.plans import planned
from hsp_control.trajectories import ComposedPose, OrientationSample, TrajectorySample

H = 1e-6


def test_between_two_writings_its_derivatives_fit_it():
    reference, x, v, a = Fed(3), *np.random.default_rng(0).normal(size=(3, 3))
    reference.write(2.0, x, v, a)
    before, now, after = (reference.sample(2.3 + d * H) for d in (-1.0, 0.0, 1.0))
    assert now.position == pytest.approx(x + 0.3 * v + 0.045 * a, abs=1e-15)
    assert (after.position - before.position) / (2 * H) == pytest.approx(
        now.velocity, abs=1e-8
    )
    assert (after.velocity - before.velocity) / (2 * H) == pytest.approx(
        now.acceleration, abs=1e-8
    )


def test_in_between_an_orientation_turns_about_its_mean_rate():
    reference, R = FedOrientation(), pin.exp3(np.array([0.2, -0.4, 1.0]))
    w, w_dot = np.random.default_rng(0).normal(size=(2, 3))
    reference.write(2.0, R, w, w_dot)
    now = reference.sample(2.3)
    turned = pin.exp3(0.3 * (w + 0.15 * w_dot)) @ R
    assert now.rotation == pytest.approx(turned, abs=1e-15)
    assert now.angular_velocity == pytest.approx(w + 0.3 * w_dot, abs=1e-15)
    assert now.angular_acceleration.tolist() == w_dot.tolist()
    assert reference.sample(1.0).rotation == pytest.approx(R, abs=1e-15)


def test_its_calls_read_later_values():
    reference, sample = Fed(2), TrajectorySample.allocate(2)
    reference.anchored([0.0, 0.0])
    calls = planned(reference.calls(sample))
    reference.write(1.0, [1.0, 2.0], [3.0, 0.0])
    calls.run(1.5)
    assert sample.position.tolist() == [2.5, 2.0]
    turning, pose = FedOrientation(), OrientationSample.allocate()
    calls = planned(turning.anchored(np.eye(3)).calls(pose))
    turning.write(0.0, np.diag([1.0, -1.0, -1.0]))
    calls.run(0.0)
    assert pose.rotation.tolist() == np.diag([1.0, -1.0, -1.0]).tolist()


def test_it_rests_where_the_robot_starts_until_it_is_fed():
    reference = Fed(3)
    assert reference.relative
    with pytest.raises(TrajectoryError, match="needs a start"):
        reference.anchored(None)
    with pytest.raises(TrajectoryError, match="has 3 coordinates; needs 2"):
        reference.anchored([1.0, 2.0])
    assert reference.anchored([1.0, 2.0, 3.0]) is reference
    sample = reference.sample(7.0)
    assert sample.position.tolist() == [1.0, 2.0, 3.0]
    assert not sample.velocity.any()


@pytest.mark.parametrize("copied", [deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_a_copy_of_a_task_goes_on_by_itself(copied):
    position = Fed(3)
    position.write(0.0, [1.0, 0.0, 0.0])
    task = FramePose("hand", ComposedPose(position, FedOrientation()))
    own = copied(task)
    position.write(1.0, [2.0, 0.0, 0.0])
    assert own.trajectory.position.sample(1.0).position[0] == 1.0
    own.trajectory.position.write(2.0, [3.0, 0.0, 0.0])
    assert position.sample(2.0).position[0] == 2.0


def test_a_switch_fades_and_then_goes():
    switch = Switch()
    assert switch.active(0.0)
    assert switch.weight(0.0) == 1.0
    switch.set(False, 1.0, 0.4)
    assert switch.weight(1.2) == pytest.approx(0.5)
    assert switch.active(1.39)
    assert not switch.active(1.4)
    assert not switch.is_on
    switch.set(True, 2.0, 0.2)
    assert switch.active(2.0)  # at once, with no force
    assert switch.weight(2.0) == 0.0
    assert switch.weight(2.1) == pytest.approx(0.5)
    assert switch.weight(2.2) == 1.0
    switch.reset()
    assert switch.weight(0.0) == 1.0


def test_a_change_during_a_ramp_continues_from_there():
    switch = Switch(on=False)
    switch.set(True, 0.0, 1.0)
    before = switch.weight(0.3)
    switch.set(False, 0.3, 0.5)
    assert switch.weight(0.3) == before
    weights = [switch.weight(t) for t in np.linspace(0.3, 0.8, 501)]
    assert np.abs(np.diff(weights)).max() < 1.9 * before / 500
    assert weights[-1] == 0.0
