"""Whole bodies in an independent physics engine: bundled configurations."""

from functools import cache

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control import Rollout, load_experiment
from hsp_control.control.actuation import Status

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
COARSE = "simulation.control_period=0.002"  # at its own period a robot stands below


@cache
def run(name: str, *overrides: str) -> Rollout:
    return load_experiment(f"whole_body/{name}", *overrides).run()


def rms(rollout: Rollout, task: str) -> float:
    """Return the root mean square of a task's error where it is active [m or rad]."""
    error = rollout[f"task.{task}.error"]
    return float(np.sqrt(np.nanmean((error**2).sum(axis=1))))


def check_forces(rollout: Rollout) -> None:
    """Forces push, stay within friction cones, and agree with the engine's."""
    names = [c.split(".")[1] for c in rollout.columns if c.endswith("friction_used")]
    assert names
    for name in names:
        assert (rollout[f"contact.{name}.force"][:, 2] >= 0.0).all()
        assert np.nanmax(rollout[f"contact.{name}.friction_used"]) <= 1.0 + 1e-6
    requested = sum(rollout[f"contact.{name}.force"][:, 2] for name in names)
    engine = [c for c in rollout.columns if c.startswith("plant.contact.")]
    answered = sum(rollout[c][:, 2] for c in engine if c.endswith(".force"))
    settled = rollout.t > 0.3
    np.testing.assert_allclose(answered[settled], requested[settled], rtol=0.05)


def test_talos_on_two_feet() -> None:
    """Centre of mass, hand and trunk within a fraction of a millimetre in contact."""
    rollout = run("talos_circle", "simulation.duration=0.8")
    assert rollout.meta["status"] == "completed"
    assert rms(rollout, "center_of_mass") < 2e-4
    assert rms(rollout, "hand") < 3e-4
    assert rms(rollout, "trunk") < 3e-4
    assert rollout["status"].max() <= Status.LIMITED
    check_forces(rollout)


def test_talos_with_a_weak_arm() -> None:
    """At its torque limit the hand deviates and returns; other tasks continue."""
    name, shorter = "talos_weak_arm", "simulation.duration=3.4"
    rollout = run(name, shorter, "simulation.log_period=0.01", COARSE)
    assert rollout.meta["status"] == "completed"
    limits = load_experiment(f"whole_body/{name}").controller.limits
    assert limits is not None
    used = np.abs(rollout["tau"]) / limits.effort
    names = rollout.meta["robot"]["dofs"]
    elbow = names.index("arm_right_4_joint")
    assert used.max() <= 1.0 + 1e-9
    assert (used[:, elbow] > 0.999).sum() > 10  # the limit is active for a while
    assert rollout["status"].max() == Status.LIMITED
    assert (rollout["status"] == Status.LIMITED).mean() > 0.3
    mass = np.linalg.norm(rollout["task.center_of_mass.error"], axis=1)
    hand = np.linalg.norm(rollout["task.hand.error"], axis=1)
    assert mass.max() < 5e-4
    assert rms(rollout, "trunk") < 1e-3
    assert 0.01 < hand.max() < 0.04
    assert hand[rollout.t > 3.2].max() < 1e-3
    assert np.abs(rollout["v"]).max() < 6.5
    check_forces(rollout)


def test_solo_lifts_a_foot_and_puts_it_down() -> None:
    rollout = run("solo12_swing", COARSE)
    assert rollout.meta["status"] == "completed"
    assert rms(rollout, "trunk") < 3e-4
    t = rollout.t
    up = (t > 2.2) & (t < 3.4)
    assert rollout["task.foot.actual"][up, 2].min() > 0.06  # in the air
    assert not rollout["plant.contact.FL_FOOT.force"][up].any()
    assert rollout["plant.contact.FL_FOOT.force"][-1, 2] > 4.0  # in contact again
    assert np.isnan(rollout["task.foot.error"][t < 1.5]).all()
    assert rollout["status"].max() < Status.RELAXED
    jumps = np.abs(np.diff(rollout["tau"], axis=0)).max(axis=1)
    assert jumps.max() < 0.35 * np.abs(rollout["tau"]).max()


def test_baxter_tracks_with_both_hands() -> None:
    rollout = run("baxter_two_hands", "simulation.duration=0.6")
    assert rms(rollout, "left_hand") < 1e-4
    assert rms(rollout, "right_hand") < 1e-4
    assert rollout.meta["tasks"]["left_hand"]["level"] == 0
    assert rollout.meta["tasks"]["right_hand"]["level"] == 1


FAR = (
    "tasks.hand.trajectory={type: line, origin: start, end: [0.9, 0, 0], duration: 1.0}"
)


@pytest.mark.slow
def test_talos_stands_while_a_hand_target_is_out_of_reach() -> None:
    """0.9 m ahead: with all tasks at one priority it falls within two seconds."""
    experiment = hsp.load_experiment(
        "whole_body/talos_circle", FAR, "simulation.duration=2", COARSE
    )
    order = [[task.name for task in level] for level in experiment.controller.levels]
    assert order == [["center_of_mass", "trunk"], ["hand"]]
    run = experiment.run()
    assert run.status == "completed"
    assert run.q[:, 2].min() > 0.9 * run.q[0, 2]
    tilt = 2.0 * np.arccos(np.clip(np.abs(run.q[:, 6]), 0.0, 1.0))
    assert tilt.max() < np.radians(25.0)
