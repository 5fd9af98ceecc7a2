"""A frozen controller computes the same efforts as in Python, to the last bit."""

from pathlib import Path
from subprocess import CalledProcessError
from typing import Any

import numpy as np
import pytest
from frozen_runs import (
    computed,
    random_states,
    replayed,
    simulated_states,
)
from places import THOROUGH

import hsp_control as hsp
from hsp_control.common.errors import EngineError, FreezeError
from hsp_control.common.resources import bundled_configs
from hsp_control.engine import own_kinds
from hsp_control.engine.plans import PartCall
from hsp_control.frozen import cmake_folder, include_folder, library

SEED = 61


@pytest.mark.smoke
@pytest.mark.parametrize(
    "name",
    [
        "panda_limits",  # a barrier, limits with their QP
        "panda_obstacle",  # a pose, a moving obstacle
        "compliance/panda_joint_impedance",
        "paper/4_moving_obstacle",  # no limits
    ],
)
def test_the_same_bits(name: str, replay: Path, tmp_path: Path) -> None:
    experiment = hsp.load_experiment(name)
    controller = experiment.controller
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
    calm, wild = (
        random_states(controller.robot, experiment.q0, 100, SEED, away=away, speed=v)
        for away, v in ((0.05, 0.05), (0.5, 0.5))
    )
    for states in (simulated_states(experiment, 0.3), calm, wild):
        np.testing.assert_array_equal(
            replayed(replay, frozen, states), computed(controller, states)
        )


def test_a_pose_and_centering(replay: Path, tmp_path: Path) -> None:
    robot = hsp.Robot.load("panda")
    tasks = [hsp.FramePose("panda_tcp")]
    controller = hsp.Controller(robot, tasks, hsp.JointCentering(), limits=None)
    q = robot.home()
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp", start=q)
    states = random_states(robot, q, 200, SEED, away=0.3, speed=0.5)
    states[0, 1:] = *q, *np.zeros(robot.nv)  # where the pose is held
    np.testing.assert_array_equal(
        replayed(replay, frozen, states), computed(controller, states)
    )


def test_freezing_does_not_change_the_controller_and_begins_anew(
    tmp_path: Path,
) -> None:
    experiment = hsp.load_experiment("panda_limits")
    controller, q = experiment.controller, experiment.q0
    first = hsp.freeze(controller, tmp_path / "first.hsp").read_bytes()
    for k in range(3):
        tau = controller.compute(0.001 * k, q, np.ones(7)).tau
        controller.applied(tau, 0.001)
    before = controller.compute(0.003, q, np.ones(7)).tau
    second = hsp.freeze(controller, tmp_path / "second.hsp").read_bytes()
    assert first == second
    after = controller.compute(0.003, q, np.ones(7)).tau
    np.testing.assert_array_equal(after, before)


def test_the_library_does_not_depend_on_python() -> None:
    content = library().read_bytes()
    assert b"hsp_step" in content
    for word in (b"libpython", b"Py_", b"PyObject", b"PyErr", b"numpy"):
        assert word not in content


def test_the_files_of_a_build_exist() -> None:
    assert (include_folder() / "hsp_step.h").is_file()
    assert (cmake_folder() / "hsp_step-config.cmake").is_file()


def height(state: hsp.RobotState) -> float:
    return float(state.position("panda_tcp")[2])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            lambda controller: controller.at(1.0).null_space_gain(5.0),
            r"^changes: .* follows no time line",
        ),
    ],
)
def test_time_varying_parts_are_refused(
    changed: object, message: str, tmp_path: Path
) -> None:
    controller = hsp.load_experiment("panda_limits").controller
    changed(controller)  # type: ignore[operator]
    with pytest.raises(FreezeError, match=message):
        hsp.freeze(controller, tmp_path / "frozen.hsp")


def test_a_function_of_python_is_refused_with_its_key(tmp_path: Path) -> None:
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp")
    field = hsp.JointCentering() + hsp.FunctionCost(height)
    controller = hsp.Controller(robot, [hand], field, start=robot.home())
    with pytest.raises(FreezeError, match=r"^field\.1: .* is Python"):
        hsp.freeze(controller, tmp_path / "frozen.hsp")
    path = hsp.trajectories.CallableTrajectory(lambda t: np.array([0.5, 0.0, 0.5]), 3)
    led = hsp.FramePosition("panda_tcp", path, name="led")
    controller = hsp.Controller(robot, [led], start=robot.home())
    with pytest.raises(FreezeError, match=r"^tasks\.led\.trajectory: .* is Python"):
        hsp.freeze(controller, tmp_path / "frozen.hsp")
    assert not (tmp_path / "frozen.hsp").exists()


@pytest.mark.parametrize("period", [0.0, -0.001, np.inf, np.nan])
def test_a_wrong_period_is_refused(period: float, tmp_path: Path) -> None:
    controller = hsp.load_experiment("panda_limits").controller
    with pytest.raises(FreezeError, match="period is"):
        hsp.freeze(controller, tmp_path / "frozen.hsp", period=period)


HEIGHT = """
#include <hsp/records.hpp>

struct Height {
  static constexpr const char* doc = "f = (z - height)² of a frame.";
  hsp::FrameMotion<hsp::In> frame;
  double height;
  hsp::Out<'n'> gradient, rate;

  double operator()() {
    const auto J = frame.jacobian.row(2).transpose();
    const auto J_dot = frame.jacobian_dot.row(2).transpose();
    const double away = frame.position[2] - height;
    gradient = 2.0 * away * J;
    rate = 2.0 * (frame.velocity[2] * J + away * J_dot);
    return away * away;
  }
};

extern "C" auto hsp_kinds_1() { return hsp::kinds<Height>(); }
"""


class ElbowHeight(hsp.Cost):
    """f = (z - 0.6)² of the Panda's elbow, in C++."""

    library: str
    """The library."""

    def call(self, state: hsp.RobotState) -> PartCall:
        kind = own_kinds.load(self.library).Height
        return PartCall(kind, frame=state.frame("panda_link4"), height=0.6)

    def value(self, state: hsp.RobotState) -> float:
        return float((state.position("panda_link4")[2] - 0.6) ** 2)


@pytest.mark.smoke
def test_a_user_s_kind_is_found_in_its_library(replay: Path, tmp_path: Path) -> None:
    source = tmp_path / "height.cpp"
    source.write_text(HEIGHT)
    try:
        own = own_kinds.build(source)
    except EngineError as error:
        pytest.skip(str(error))
    robot = hsp.Robot.load("panda")
    q = robot.home()
    field = hsp.JointCentering() + ElbowHeight(str(own), weight=20.0)
    hand = hsp.FramePosition("panda_tcp")
    controller = hsp.Controller(robot, [hand], field, start=q)
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
    states = random_states(robot, q, 50, SEED, away=0.1, speed=0.1)
    np.testing.assert_array_equal(
        replayed(replay, frozen, states), computed(controller, states)
    )
    own.unlink()
    with pytest.raises(CalledProcessError):
        replayed(replay, frozen, states)


@pytest.mark.smoke
@pytest.mark.parametrize("static", ["none", 0.8])
def test_rows_of_barriers_and_of_static_efforts(
    static: Any, replay: Path, tmp_path: Path
) -> None:
    """Rows that Python writes on demand have memory in the file."""
    robot = hsp.Robot.load("panda")
    q = robot.home()
    wrist = robot.state(0.0, q, np.zeros(7)).position("panda_link6")
    ball = hsp.Obstacle("ball", hsp.Sphere(0.1), wrist + np.array([0.05, 0.1, 0.2]))
    apart = hsp.limits.ObstacleDistance(obstacles=["ball"], minimum=0.05)
    barriers = [apart, hsp.limits.SelfDistance(minimum=0.02)]
    controller = hsp.Controller(
        robot,
        [hsp.FramePose("panda_tcp")],
        hsp.JointCentering(),
        limits=hsp.Limits(barriers=barriers, static_effort=static),
        scene=[ball],
        start=q,
    )
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
    for away, speed in ((0.05, 0.1), (0.4, 0.5)):
        states = random_states(robot, q, 100, SEED, away=away, speed=speed)
        expected = computed(controller, states)
        assert len(set(expected[:, 0])) > 1
        np.testing.assert_array_equal(replayed(replay, frozen, states), expected)


@pytest.mark.process
def test_every_bundled_configuration(replay: Path, tmp_path: Path) -> None:
    """Configurations that can be frozen give the same bits; others name the key."""
    refused = {}
    for name in bundled_configs():
        experiment = hsp.load_experiment(name)
        controller = experiment.controller
        try:
            frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
        except FreezeError as error:
            refused[name] = error.path
            continue
        given = controller.robot, experiment.q0, 200 if THOROUGH else 50, SEED
        for states in (
            simulated_states(experiment, 0.2 if THOROUGH else 0.05),
            random_states(*given, away=0.4, speed=0.5),
        ):
            np.testing.assert_array_equal(
                replayed(replay, frozen, states), computed(controller, states), name
            )
    # those that press, walk, or change at run time
    folders = {name.split("/")[0] for name in refused}
    assert folders == {"compliance", "forces", "walking", "whole_body"}
    assert len(refused) == 10
    assert all(refused.values())
