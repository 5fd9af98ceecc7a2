"""The IMU: integrating its readings reproduces the true motion."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import chi2

from hsp_control import Robot, load_experiment
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import RigidBody
from hsp_control.simulation.plants.sensors import Imu

pytest.importorskip("example_robot_data")
SILENT = dict.fromkeys(
    (
        f"{quantity}_{how}"
        for quantity in ("gyroscope", "accelerometer")
        for how in ("noise", "walk", "bias")
    ),
    0.0,
)
GRAVITY = np.array([0.0, 0.0, -9.81])
H = 0.002


def readings(imu, states, seed=0):
    """Return an IMU's readings at states."""
    robot = Robot.load("solo12")
    sense = imu.begin(robot, *states[0][1:], np.random.default_rng(seed))
    found = []
    for t, q, v in states:
        passed = sense(t, q, v)
        assert passed[0] is q
        assert passed[1] is v
        found.append(sense.reading)
    return found


def tumbling(periods=20):
    """Return the states of a robot in free flight with rotation."""
    robot, random = Robot.load("solo12"), np.random.default_rng(5)
    rk4 = Rk4(step=1e-3)
    plant = RigidBody(sensors=[Imu("base_link")]).build(robot, rk4).plant
    q, v = robot.home(), random.normal(size=robot.nv)
    tau = 0.3 * random.normal(size=robot.nv)
    tau[:6] = 0.0
    plant.reset(0.0, q, v)
    states = [(0.0, q, v)]
    for k in range(periods):
        q, v = plant.advance(k * H, (k + 1) * H, tau)
        states.append(((k + 1) * H, q.copy(), v.copy()))
    return robot, states


def skew(a):
    return np.cross(np.eye(3), a)


def test_the_readings_carry_orientation_and_velocity_on_exactly():
    robot, states = tumbling()
    found = readings(Imu("FL_LOWER_LEG", **SILENT), states)
    motions = []
    for each in states:
        frame = robot.state(*each).frame("FL_LOWER_LEG")
        motions.append((frame.rotation.copy(), frame.velocity[:3].copy()))
    for (R, v), (R_next, v_next), reading in zip(
        motions[:-1], motions[1:], found[1:], strict=True
    ):
        assert R @ expm(H * skew(reading.angular_velocity)) == pytest.approx(R_next)
        gained = H * (R @ reading.specific_force + GRAVITY)
        assert v + gained == pytest.approx(v_next)
        assert reading.frame == "FL_LOWER_LEG"


def test_a_body_at_rest_feels_its_weight():
    robot = Robot.load("solo12")
    q = robot.integrate(robot.home(), 0.3 * np.random.default_rng(1).normal(size=18))
    states = [(k * H, q, np.zeros(18)) for k in range(3)]
    R = robot.state(*states[0]).frame("base_link").rotation
    for reading in readings(Imu("base_link", **SILENT), states):
        assert reading.specific_force == pytest.approx(-R.T @ GRAVITY)
        assert reading.angular_velocity == pytest.approx(np.zeros(3))


def test_in_mujoco_a_body_that_falls_freely_feels_nothing():
    pytest.importorskip("hsp_control.companions.mujoco")
    experiment = load_experiment(
        "whole_body/solo12_trunk", "plant.sensors={imu: base_link}"
    )
    robot, plant = experiment.robot, experiment.plant
    q = experiment.q0.copy()
    q[2] += 1.0
    plant.reset(0.0, q, np.zeros(robot.nv))
    weightless = Imu("base_link", **SILENT).begin(robot, q, q, np.random.default_rng(0))
    v = np.zeros(robot.nv)
    for k in range(5):
        weightless(k * H, q, v)
        q, v = plant.advance(k * H, (k + 1) * H, np.zeros(robot.nv))
    assert weightless.reading.specific_force == pytest.approx(np.zeros(3), abs=0.02)
    plant.measure(0.0, q, v)
    assert plant.inertial().frame == "base_link"


def test_noise_and_biases_have_the_sizes_that_were_declared():
    robot = Robot.load("solo12")
    q, n = robot.home(), 1000
    states = [(k * H, q, np.zeros(18)) for k in range(n + 1)]
    white = SILENT | {"gyroscope_noise": 1e-3, "accelerometer_noise": 1e-2}
    found = readings(Imu("base_link", **white), states)[1:]
    omega = np.array([each.angular_velocity for each in found])
    force = np.array([each.specific_force for each in found])
    R = robot.state(*states[0]).frame("base_link").rotation
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 3 * n)
    for noise, density in ((omega, 1e-3), (force + R.T @ GRAVITY, 1e-2)):
        assert low < (noise**2).sum() * H / density**2 < high
    walk = SILENT | {"gyroscope_walk": 1e-2, "gyroscope_bias": 0.5}
    omega = np.array(
        [each.angular_velocity for each in readings(Imu("base_link", **walk), states)]
    )
    steps = np.diff(omega, axis=0)
    assert low < (steps**2).sum() / (H * 1e-2**2) < high
    first = [
        readings(Imu("base_link", **walk), states[:1], seed)[0].angular_velocity
        for seed in range(100)
    ]
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 300)
    assert low < np.square(first).sum() / 0.25 < high


def test_the_bias_of_the_accelerometer_walks_as_declared():
    q, n = Robot.load("solo12").home(), 1000
    states = [(k * H, q, np.zeros(18)) for k in range(n + 1)]
    walk = SILENT | {"accelerometer_walk": 1e-2}
    force = [each.specific_force for each in readings(Imu("base_link", **walk), states)]
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 3 * n)
    assert low < np.square(np.diff(force, axis=0)).sum() / (H * 1e-2**2) < high
