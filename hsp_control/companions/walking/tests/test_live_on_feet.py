"""Legged robots in a live loop: measurements, standing, stops and falls."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from live_rigs import start
from loaded_robots import panda
from places import THOROUGH, further

import hsp_control as hsp
from hsp_control.cli.live_experiment import check_live, simulated_robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    CompensationError,
    EstimationError,
    HardwareError,
    LiveError,
    PlanError,
)
from hsp_control.config import Experiment
from hsp_control.control.compensation import CompensatedController
from hsp_control.control.measurement import Inertial
from hsp_control.live import (
    InProcessRobot,
    LoopReport,
    Measurement,
    OperatorRequests,
    Phase,
    StopSettings,
    run_loop,
)
from hsp_control.live.safe_stop import SafeStop, StandingFeet
from hsp_control.live.udp import SensorLayout
from hsp_control.live.valid_measurement import valid_measurement

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
BRIEF = ("live.stop.coming_to_rest=0", "simulation.log_period=0.001")
COARSE = "simulation.control_period=0.002"


@cache
def trotting(*overrides: str) -> Experiment:
    return hsp.load_experiment("walking/solo12_trot", *overrides)


class Watched(InProcessRobot):
    """A robot that records efforts and velocities of all periods."""

    def __init__(self, experiment: Experiment) -> None:
        super().__init__(simulated_robot(experiment))
        self.rows: list[tuple[float, Phase, Array, Array]] = []

    def read(self, timeout: float) -> Measurement:
        robot = self.robot
        before, found = robot.v.copy(), super().read(timeout)
        if robot.t > 0.0:
            self.rows.append((robot.t, robot.phase, robot.tau.copy(), before))
        return found


def live(
    experiment: Experiment, log: Path | None = None, **options: object
) -> tuple[LoopReport, Watched]:
    robot, scenario = Watched(experiment), experiment.scenario
    report = run_loop(
        CompensatedController(experiment.controller, experiment.compensation),
        robot,
        plan=scenario.plan,
        estimators=scenario.estimators,
        settings=scenario.live,
        log=log,
        log_period=scenario.simulation.log_period,
        scene=experiment.scene,
        meta={"name": "live", "title": "", "config": experiment.config},
        **options,  # type: ignore[arg-type]
    )
    return report, robot


# --- plans and estimators ------------------------------------------------------------


@pytest.mark.system
@pytest.mark.slow
def test_a_live_plan_equals_the_simulated_one(tmp_path: Path) -> None:
    """The estimator's errors, the plan's phases and the efforts are those of a run."""
    brief = ("estimators.base=true", "simulation.duration=0.35", *BRIEF)
    experiment = trotting(*brief)
    report, _ = live(experiment, tmp_path / "trot.journal", duration=0.35)
    log = hsp.Rollout.load(tmp_path / "trot.journal")
    run = hsp.load_experiment("walking/solo12_trot", *brief).run()
    count = int((log["live.phase"] == Phase.RUNNING).sum())
    assert 348 <= count <= 350
    for name in ("q", "v", "tau", "plan.phase", "plan.velocity", "estimate.base"):
        np.testing.assert_allclose(
            log[name][:count], run[name][:count], rtol=1e-7, atol=1e-9, err_msg=name
        )
    assert 2.0 in run["plan.phase"], "no foot swung: the test would compare standing"
    if THOROUGH:  # a run of the log is a run of its configuration
        again = hsp.load_experiment(log.meta["config"]).run()
        for name in ("q", "tau", "plan.phase"):
            np.testing.assert_array_equal(again[name], run[name])
    assert log.meta["config"] == experiment.config
    assert report.ended == "fault", "it was not given the time to come to rest"


@pytest.mark.system
@pytest.mark.slow
@pytest.mark.parametrize("by", ["operator", *further("duration")])  # like a walk below
def test_a_regular_end_lets_the_plan_come_to_rest(by: str) -> None:
    experiment, requests = trotting(COARSE), OperatorRequests()

    def stop(t: float) -> None:
        if t > 0.7 and by == "operator":
            requests.stop("enough")

    duration = 0.7 if by == "duration" else None
    report, robot = live(
        experiment, duration=duration, requests=requests, on_period=stop
    )
    assert report.ended == {"duration": "completed", "operator": "operator"}[by]
    assert report.at_rest
    assert 0.7 < report.t < 0.7 + 4.0  # `StopSettings.coming_to_rest`
    # It stands: the contacts carry its weight; its trunk is level and at full height.
    wrenches = robot.robot.measured().wrenches
    assert set(wrenches) == set(FEET)
    weight = 9.81 * sum(each.mass for each in experiment.robot.model.inertias)
    total = sum(wrench[2] for wrench in wrenches.values())
    assert total == pytest.approx(weight, rel=0.02)
    assert robot.robot.q[2] > 0.9 * experiment.q0[2]


@pytest.mark.system
@pytest.mark.slow
@pytest.mark.parametrize("plan", [
    "plan={type: walk, speed: 0.3}",
    "plan={type: walk, footsteps: [[0.2, 0.1, 0], [0.4, -0.1, 0], [0.6, 0.1, 0], "
    "[0.8, -0.1, 0]], first: left}",
])  # fmt: skip
def test_a_walk_that_is_stopped_brings_its_feet_together(plan: str) -> None:
    experiment = hsp.load_experiment("walking/talos_walk", plan, COARSE)
    report, robot = live(experiment, duration=2.0)
    assert report.ended == "completed", report.reason
    assert report.at_rest
    end = experiment.robot.state(0.0, robot.robot.q, robot.robot.v)
    left, right = (end.position(f"{side}_sole_link") for side in ("left", "right"))
    assert left[0] > 0.2, "it walked"
    assert abs(left[0] - right[0]) < 0.02
    assert robot.robot.q[2] > 0.9 * experiment.q0[2]


@pytest.mark.system
@pytest.mark.slow
def test_a_fall_is_detected_reported_and_ends_with_damped_joints() -> None:
    push = "{frame: base_link, moment: [6, 0, 0], start: 0.1, duration: 0.3}"
    shove = f"plant.pushes=[{push}]"
    for plan in ("plan.speed=0.3", "plan=null"):
        tasks = (
            "tasks={trunk: {type: frame_orientation, frame: base_link}, "
            "body: {type: center_of_mass}}",
        )
        own = tasks if plan == "plan=null" else ()
        experiment = trotting(shove, "live.velocity_margin=20", plan, *own)
        report, robot = live(experiment, duration=5.0)
        assert report.ended == "fault"
        assert "the robot falls: at t = 0." in report.reason
        assert "base_link is tilted by" in report.reason
        assert "at most 45°" in report.reason
        stopped = [row for row in robot.rows if row[0] > report.t - 0.2]
        assert len(stopped) > 100
        for _, _, tau, v in robot.rows[-200:]:
            assert not tau[:6].any()
            # Damping dissipates energy in the joints, within the limits.
            assert tau @ v <= 1e-12
        assert report.t < 4.0, "a fall must end the run"


@pytest.mark.system
def test_missing_input_of_a_plan_or_estimator_is_reported_before_the_run() -> None:
    felt = "plan={type: sensed, contacts: {front_left: {force: 1}}}"
    tasks = "tasks={trunk: {type: frame_orientation, frame: base_link}}"

    class Deaf(InProcessRobot):
        def read(self, timeout: float) -> Measurement:
            return super().read(timeout)._replace(wrenches={}, inertial=None)

    sensed = trotting(felt, tasks)
    with pytest.raises(PlanError, match="nothing measures or estimates the force"):
        run_loop(
            sensed.controller, Deaf(simulated_robot(sensed)), plan=sensed.scenario.plan
        )
    based = trotting("estimators.base=true")
    with pytest.raises(EstimationError, match="no inertial measurement unit is there"):
        run_loop(
            based.controller,
            Deaf(simulated_robot(based)),
            plan=based.scenario.plan,
            estimators=based.scenario.estimators,
        )
    wipes = hsp.load_experiment("forces/panda_wipe")
    with pytest.raises(CompensationError, match="no sensor measures the force at"):
        run_loop(
            CompensatedController(wipes.controller, wipes.compensation),
            Deaf(simulated_robot(wipes)),
        )


# --- the feet and the safe stop ------------------------------------------------------


@pytest.mark.system
def test_joints_and_feet_exert_the_force_of_a_safe_stop() -> None:
    """x = Sᵀ tau + Jᵀ f; tau and x have equal power while the feet are at rest."""
    experiment = trotting()
    robot, contacts = experiment.robot, experiment.controller.contacts
    state = robot.state(0.0, experiment.q0, experiment.v0)
    feet, random = StandingFeet(robot, contacts), np.random.default_rng(3)
    settings, free = StopSettings(rest_speed=1e-9), np.full(robot.nv, np.inf)
    rest = np.zeros(robot.nv)
    gravity = robot.inverse_dynamics(experiment.q0, rest, rest)
    J = np.vstack([state.frame(each.frame).jacobian[:3] for each in contacts])
    arms = [each.arms(state.frame(each.frame))[0] for each in contacts]
    angular = [state.frame(each.frame).jacobian[3:] for each in contacts]
    J -= np.vstack([np.cross(r, w, axis=0) for r, w in zip(arms, angular, strict=True)])
    for _ in range(5):
        v = random.standard_normal(robot.nv)
        v -= np.linalg.pinv(J) @ (J @ v)
        state.update(0.0, experiment.q0, v)
        force = gravity - settings.damping * state.mass_matrix @ v
        tau = SafeStop(robot, settings, free, 1e-3, feet).effort(state)
        assert not tau[:6].any()
        forces, *_ = np.linalg.lstsq(J.T, force - tau)
        np.testing.assert_allclose(J.T @ forces, force - tau, atol=1e-10)
        assert v @ tau == pytest.approx(v @ force, abs=1e-9)
    state.update(0.0, experiment.q0, experiment.v0)
    held = SafeStop(robot, settings, free, 1e-3, feet).effort(state)
    law = experiment.controller.compute(state).tau
    assert np.abs(held).max() < 3.0 * np.abs(law).max() + 1.0


@pytest.mark.system
def test_feet_that_are_not_pressed_do_not_bear() -> None:
    experiment = trotting()
    feet = StandingFeet(experiment.robot, experiment.controller.contacts)
    q, v = experiment.q0, experiment.v0
    pressed = {name: np.zeros(6) for name in FEET}
    pressed["HL_FOOT"][2], pressed["HR_FOOT"][2] = 2.0, -2.0  # noise may pull
    feet.update(Measurement(1, 0.0, q, v, wrenches=pressed))
    assert [each.frame for each in feet.contacts] == ["HL_FOOT"]
    assert feet.hold
    feet.update(Measurement(1, 0.0, q, v))  # no sensors: their schedules apply
    assert len(feet.contacts) == 4
    feet.lift()
    assert not feet.hold
    wall = replace(experiment.controller.contacts[0], normal=[1.0, 0.0, 0.5])
    assert not StandingFeet(experiment.robot, [wall]).hold, "a wall may only be pushed"
    assert StandingFeet(panda(), ()).hold


@pytest.mark.system
def test_no_motor_of_a_floating_base_is_ever_sent_an_effort() -> None:
    experiment = trotting()
    limits = experiment.scenario.live.effort_limits(experiment.robot)
    assert not limits[:6].any()
    assert (limits[6:] > 0.0).all()
    with pytest.raises(LiveError, match=r"live\.compensates_gravity: solo12 has a"):
        check_live(trotting("live.compensates_gravity=true"))


# --- measurements --------------------------------------------------------------------


@pytest.mark.system
def test_a_state_with_sensors_comes_back() -> None:
    q, v = start(), np.arange(7.0)
    wrench = np.arange(6.0)
    for applied in (None, v + 20.0):
        unit = Inertial("panda_link8", np.arange(3.0) + 30.0, np.arange(3.0) + 40.0)
        sent = Measurement(
            0, 0.0, q, v, applied=applied, inertial=unit,
            wrenches={"a": wrench + 50.0, "b": wrench + 60.0},
        )  # fmt: skip
        layout = SensorLayout.of(sent)
        assert layout == SensorLayout(("a", "b"), "panda_link8")
        numbers = layout.pack(sent)
        found = layout.unpack(numbers, panda())
        np.testing.assert_array_equal(layout.pack(found), numbers)
        for frame, given in sent.wrenches.items():
            np.testing.assert_array_equal(found.wrenches[frame], given)
        assert found.inertial is not None
        np.testing.assert_array_equal(found.inertial.specific_force, unit[2])
        assert (found.applied is None) == (applied is None)
    for size, message in (
        (20, r"the state's wrench at b has shape \(0,\); needs \(6,\)"),
        (31, r"the state's specific force has shape \(2,\); needs \(3,\)"),
        (33, r"the state's applied has shape \(1,\); needs \(7,\)"),
    ):
        with pytest.raises(HardwareError, match=message):
            valid_measurement(layout.unpack(numbers[:size], panda()), panda(), 0.001)


@pytest.mark.system
@pytest.mark.parametrize(("changed", "message"), [
    ({"wrenches": {"a": np.full(6, np.nan)}}, r"not finite: wrench at a\[0\]"),
    ({"wrenches": {"a": np.zeros(3)}}, r"wrench at a has shape \(3,\)"),
    ({"inertial": (1, 2, 3)}, "inertial is of type tuple; needs an Inertial"),
    ({"inertial": Inertial("a", np.zeros(3), np.full(3, 1e9))},
     r"absurd: specific force\[0\] is 1e\+09"),
])  # fmt: skip
def test_a_sensor_that_cannot_be_right_is_refused(
    changed: dict[str, object], message: str
) -> None:
    raw = Measurement(1, 0.0, start(), np.zeros(7))._replace(**changed)  # type: ignore[arg-type]
    with pytest.raises(HardwareError, match=message):
        valid_measurement(raw, panda(), 0.001)
