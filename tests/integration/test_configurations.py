"""The bundled configurations achieve their purpose with the field, not without it.

Whole runs, but at 250 Hz and logged every 20 ms, so that all of them take seconds.
"""

import json
from collections.abc import Callable

import numpy as np
import pytest
import yaml
from places import ROOT

from hsp_control import Controller, JointPosture, RobotState, Rollout, load_experiment
from hsp_control.common.resources import bundled_configs
from hsp_control.config import Experiment
from hsp_control.null_space.fields import FieldSum

CONFIGURATIONS = [name for name in bundled_configs() if "/" not in name]
COARSE = (
    "simulation.control_period=0.004",
    "simulation.integrator={type: rk4, step: 0.004}",
    "simulation.log_period=0.02",
)
TRACKING = 1e-3
"""Tolerance on a hand's error at 250 Hz [m]: the effect of held efforts."""


def run_both(name: str) -> tuple[Experiment, Rollout, Rollout]:
    """Return a configuration, its run, and the run without its first field.

    The other run has no limits either, since they would act like the field.
    """
    text = bundled_configs()[name].read_text(encoding="utf-8")
    others = json.dumps(yaml.safe_load(text)["null_space"]["fields"][1:])
    experiment = load_experiment(name, *COARSE)
    without = load_experiment(
        name, *COARSE, "limits=none", f"null_space.fields={others}"
    )
    return experiment, experiment.run(), without.run()


def errors(rollout: Rollout) -> np.ndarray:
    """Return the largest position error of any task at every row [m]."""
    tasks = [rollout[f"task.{task}.error"][:, :3] for task in rollout.meta["tasks"]]
    return np.max([np.linalg.norm(error, axis=1) for error in tasks], axis=0)


def limit_margin(experiment: Experiment, rollout: Rollout) -> float:
    """Return the smallest distance of a joint from its limits."""
    lower, upper = experiment.robot.position_limits()
    q = rollout["joint_positions"]
    return float(np.minimum(q - lower, upper - q).min())


def minimum_distance(experiment: Experiment, rollout: Rollout) -> float:
    """Return the smallest distance of the pairs of the first field [m]."""
    field = experiment.controller.field
    if isinstance(field, FieldSum):
        field = field.terms[0]
    state = RobotState(experiment.robot)
    rows = zip(rollout.t, rollout.q, rollout.v, strict=True)
    return min(field.minimum_distance(state.update(*row)) for row in rows)


def least_manipulability(rollout: Rollout) -> float:
    return float(np.sqrt(rollout["manipulability"].min()))


# Checks of a configuration's purpose, with bounds somewhat looser than measured.


def the_hand_stays_able(experiment: Experiment, ours: Rollout, other: Rollout) -> None:
    assert least_manipulability(ours) > 0.06
    assert least_manipulability(other) < 0.01


def the_elbow_dodges_the_ball(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    assert ours["distance.obstacle_clearance"].min() > 0.03
    assert minimum_distance(experiment, other) < -0.03


def no_joint_comes_near_its_limits(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    assert limit_margin(experiment, ours) > 0.15
    assert limit_margin(experiment, other) < -1.5


def the_elbow_swings_opposite_the_lantern(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    assert ours["distance.point_distance"].min() > 0.48
    assert minimum_distance(experiment, other) < 0.02
    settled = ours.t > 2.0
    self_motion = np.linalg.norm(ours.v[settled], axis=1)
    error = np.linalg.norm(ours["null_space_error"][settled], axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.sqrt(np.mean(self_motion**2))
    state = RobotState(experiment.robot)
    rows = zip(ours.t, ours.q, ours.v, strict=True)
    elbow = [state.update(*row).position("iiwa_link_4")[1] for row in rows]
    assert max(elbow) > 0.2
    assert min(elbow) < -0.2


def the_way_back_is_gentle_and_exact(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    bounded = ours.t[ours["damped"] > 0]
    assert bounded[0] > 2.5
    assert bounded[-1] < 6.5
    assert errors(ours)[ours.t < bounded[0] - 0.1].max() < TRACKING
    assert errors(ours).max() < 0.08  # 6 cm of it are out of reach
    assert errors(ours)[-1] < 1e-5
    peaks = [np.abs(run["acceleration"]).max() for run in (ours, other)]
    assert peaks[0] < 6.0
    assert peaks[1] > 2.0 * peaks[0]


def the_arms_cross_and_do_not_touch(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    assert ours["distance.self_clearance"].min() > 0.06
    assert minimum_distance(experiment, other) < -0.03
    crossed = [ours[f"task.{hand}.actual"][:, 1] for hand in ("left", "right")]
    assert (crossed[0] - crossed[1]).max() > 0.3
    assert (crossed[0] - crossed[1]).min() < -0.3


def base_and_torso_follow(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    assert limit_margin(experiment, ours) > 0.04
    assert limit_margin(experiment, other) < -0.1
    assert np.linalg.norm(ours.q[-1, :2] - ours.q[0, :2]) > 1.5
    assert np.ptp(ours["joint_positions"][:, 3]) > 0.1


def the_wrist_stays_off_the_board(
    experiment: Experiment, ours: Rollout, other: Rollout
) -> None:
    assert ours["distance.obstacle_clearance"].min() > 0.03
    assert minimum_distance(experiment, other) < -0.08


POINTS: dict[str, Callable[[Experiment, Rollout, Rollout], None]] = {
    "panda_manipulability": the_hand_stays_able,
    "panda_obstacle": the_elbow_dodges_the_ball,
    "panda_limits": no_joint_comes_near_its_limits,
    "iiwa_null_space": the_elbow_swings_opposite_the_lantern,
    "iiwa_singular": the_way_back_is_gentle_and_exact,
    "dual_panda": the_arms_cross_and_do_not_touch,
    "tiago_reach": base_and_torso_follow,
    "ur5_position": the_wrist_stays_off_the_board,
}


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_a_configuration_makes_its_point(name: str) -> None:
    experiment, ours, other = run_both(name)
    assert experiment.scenario.title
    assert experiment.scenario.description
    for run in (ours, other):
        assert run.status == "completed"
        assert all(np.isfinite(column).all() for column in run.columns.values())
        if name != "iiwa_singular":
            assert errors(run).max() < TRACKING
            assert not run["damped"].any()
    model = experiment.robot.model
    assert (np.abs(ours.tau) < model.upperEffortLimit).all()
    assert (np.abs(ours.v) < model.upperVelocityLimit).all()
    assert limit_margin(experiment, ours) > 0.0
    POINTS[name](experiment, ours, other)


@pytest.mark.parametrize(
    "name", [*bundled_configs(), str(ROOT / "examples" / "stream" / "panda.yaml")]
)
def test_the_first_effort_is_that_of_gravity(name: str) -> None:
    """Within a tenth of every limit, for runs that begin at rest."""
    experiment = load_experiment(name)
    robot, law, q = experiment.robot, experiment.controller, experiment.q0
    assert not experiment.v0.any() or name.startswith("paper/")  # on its trajectory
    rest = np.zeros(robot.nv)
    gravity = robot.inverse_dynamics(q, rest, rest)
    if robot.unactuated:  # only a posture on its feet
        still = JointPosture(q, joints=robot.joint_names[1:])
        holding = Controller(robot, [still], limits=None, contacts=law.contacts)
        gravity = holding.compute(0.0, q, rest).tau
    first = law.compute(0.0, q, experiment.v0).tau
    limit = np.asarray(robot.model.effortLimit)
    limited = limit > 0.0  # planar3r has no effort limits
    assert (np.abs(first - gravity) <= 0.1 * limit)[limited].all()


@pytest.mark.filterwarnings("error:the first effort of joint:UserWarning")
@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_a_configuration_runs_as_it_is_written(name: str) -> None:
    rollout = load_experiment(name, "simulation.duration=0.1").run()
    assert rollout.status == "completed"
    assert errors(rollout).max() < 1e-4
