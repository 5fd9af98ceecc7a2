"""A foot lands where the ground is detected: on MuJoCo, measured and estimated."""

import numpy as np
import pytest

from hsp_control import load_experiment

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
FOOT = "FL_FOOT"
PUT_DOWN = (
    "contacts.front_left.schedule=null",
    "tasks.foot.schedule=null",
    # The reference continues to a centimetre below the ground.
    "tasks.foot.trajectory.waypoints=[[0, 0, 0], [0, 0, 0.03], [0, 0, -0.01]]",
    "tasks.foot.trajectory.times=[0.75, 1.0, 1.4]",
    "tasks.trunk.trajectory.position.times=[0, 0.5, 1.7, 2.2]",
    "tasks.foot.gains={natural_frequency: 30}",
    "plan={type: sensed, contacts: {front_left: {force: 0.5, task: foot, ramp: 0.15, "
    "starts: true, wanted: [[null, 0.55], [0.9, null]]}}}",
    "simulation.duration=1.7",
    "simulation.control_period=0.002",
    "simulation.log_period=0.002",
)


@pytest.mark.system
@pytest.mark.slow
@pytest.mark.parametrize("estimated", [False, True])
def test_a_foot_is_put_down_where_the_ground_is_felt(estimated):
    estimators = {False: "{}", True: "{contact_forces: {instead: true}}"}[estimated]
    run = load_experiment(
        "whole_body/solo12_swing", *PUT_DOWN, f"estimators={estimators}"
    ).run()
    assert run.status == "completed"
    t, bears = run.t, run["plan.front_left.active"]
    measured = run[f"plant.contact.{FOOT}.force"][:, 2]
    lands = np.flatnonzero(np.diff(bears) > 0)[0] + 1
    touches = np.flatnonzero((measured > 0.0) & (t > 1.0))[0]
    # Before the reference's end, and soon after the ground is touched.
    assert 1.1 < t[lands] < 1.4
    assert 0.0 <= t[lands] - t[touches] < 0.05
    assert not measured[(t > 0.8) & (t < 1.1)].any()
    assert bears[lands:].all()
    assert measured[-1] > 2.0
    assert run["plan.front_left.events"][-1] == 2.0
    assert (run["plan.front_left.estimated"] == float(estimated)).all()
    # The force fades and rises over its ramp, so that no effort jumps.
    weight = run["contact.front_left.weight"]
    assert np.abs(np.diff(weight)).max() < 2.0 / 0.15 * 0.002  # a smooth step: 1.9
    jumps = np.abs(np.diff(run.tau, axis=0)).max(axis=1)
    fades = np.flatnonzero(weight == 0.0)[0]
    for switch in (fades, lands):
        assert jumps[switch - 1 : switch + 2].max() < 0.2 * np.abs(run.tau).max()
