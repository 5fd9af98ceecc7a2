"""In the interior the law is exact: steps, pushes and fields, in every metric.

The target is reachable, no limit is active, and the smallest singular value is above a
tenth of the robot's size. The only error is that of held efforts, at most 5e-3 of the
step per millisecond of the period.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from field_oracles import constant
from places import THOROUGH
from states import moved

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.edge.shares import NEAR
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import Push, RigidBodyPlant

ARMS = ("panda", "iiwa14", "xarm7", "ur5", "ur10", "kinova", "talos_arm", "z1")
PERIODS = (0.0005, 0.001, 0.0025, 0.005, 0.01)
STEP, TURN, FORCE = 0.2, np.deg2rad(60.0), 40.0
RATE, DURATION = 10.0, 0.5  # ω0 [rad/s], duration [s]
SAMPLED = 5.0  # error of a held effort, relative to the step, over a period [1/s]
CASES = 3 if THOROUGH else 1
STEPPED = np.array([0.0, 0.12, 0.05])  # of two hands, and on rails
BENT = (0.2, 0.6, 0.3, -1.6, 0.5, 1.3, 0.4)  # a posture of an arm of seven joints
WELL = 1.3 * NEAR  # at the start


def metric_of(rng: np.random.Generator, nv: int) -> Any:
    """Return one of the three kinds of metrics."""
    constant = hsp.metrics.ConstantMetric(np.diag(rng.uniform(0.3, 3.0, nv)))
    return (None, constant, hsp.metrics.MassMatrixMetric())[rng.integers(3)]


def random_vector(rng: np.random.Generator, longest: float) -> Array:
    """Return a random vector of a given maximum length."""
    d = rng.normal(size=3)
    return np.asarray(rng.uniform(0.05, 1.0) * longest * d / np.linalg.norm(d))


def simulated(
    robot: hsp.Robot, hand: hsp.Task, field: Any, metric: Any, q0: Array, period: float
) -> hsp.Rollout:
    """Return the rollout of a step, without limits."""
    controller = hsp.Controller(
        robot, [hand], field, limits=None, metric=metric, start=q0
    )
    return hsp.simulate(
        controller, q0, duration=DURATION, control_period=period,
        log_period=max(period, 0.005), integrator=Rk4(min(period, 1e-3)),
    )  # fmt: skip


def unmoved(state: hsp.RobotState) -> Array:
    """Return its rate."""
    return np.zeros(state.robot.nv)


def smallest(robot: hsp.Robot, frame: str, q: Array, rows: int) -> float:
    """Return the smallest singular value of J over the robot's size."""
    J = moved(robot, 0.0, q).frame(frame).jacobian[:rows]
    return float(np.linalg.svd(J, compute_uv=False)[-1]) / robot.size


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_steps_within_reach_are_the_law(name: str) -> None:
    """e(t) is that of e'' + Kv e' + Kp e = 0, and ‖e_N‖ decays as K_N has it."""
    robot, done = hsp.Robot.load(name), 0
    frame = robot.end_effector
    rng = np.random.default_rng(sum(map(ord, name)))
    lower, upper = robot.position_limits()
    lower, upper = np.maximum(lower, -2.5), np.minimum(upper, 2.5)
    while done < CASES:
        q0 = robot.integrate(
            robot.neutral(), rng.uniform(0.9 * lower + 0.1 * upper, upper)
        )
        rows = (3, 6)[rng.integers(2)]
        if smallest(robot, frame, q0, rows) < WELL:
            continue
        here = robot.state(0.0, q0, np.zeros(robot.nv)).frame(frame)
        goal = here.position + random_vector(rng, STEP)
        turned = pin.exp3(random_vector(rng, TURN)) @ here.rotation
        period = float(rng.choice(PERIODS))
        gains = hsp.Gains(natural_frequency=RATE)
        hand: hsp.Task = hsp.FramePosition(frame, hsp.Hold(goal), gains=gains)
        if rows == 6:
            hold = hsp.trajectories.HoldPose(goal, turned)
            hand = hsp.FramePose(frame, hold, gains=gains)
        g = 0.3 * rng.normal(size=robot.nv)
        field = hsp.fields.FunctionField(partial(constant, g), rate_function=unmoved)
        metric = metric_of(rng, robot.nv)

        run, alone = (
            simulated(
                robot, replace(hand, largest_error=bound), field, metric, q0, period
            )
            for bound in ("robot", "none")
        )
        if min(smallest(robot, frame, q, rows) for q in run.q[::4]) < NEAR:
            continue
        done += 1
        e = run[f"task.{hand.name}.error"]
        response = (1.0 + RATE * run.t) * np.exp(-RATE * run.t)
        for part in (e[:, :3], e[:, 3:]):
            if part.size:
                away = np.abs(part - response[:, None] * part[0]).max()
                assert away <= SAMPLED * period * np.linalg.norm(part[0])
        assert not run["damped"].any()
        # The null space's own equation is that of the law without an edge.
        e_N, exact = run["null_space_norm"], alone["null_space_norm"]
        np.testing.assert_allclose(e_N, exact, rtol=0, atol=1e-6 * exact.max() + 1e-12)


@pytest.mark.parametrize("metric", ["identity", "mass"])
@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_a_push_moves_the_hand_as_the_gains_have_it(name: str, metric: str) -> None:
    """On a task with gains: exactly e'' + Kv e' + Kp e = -Λ⁻¹f.

    The same rollout without bounds on the error is the law itself.
    """
    robot = hsp.Robot.load(name)
    frame, q0 = robot.end_effector, robot.integrate(robot.neutral(), np.array(BENT))
    assert smallest(robot, frame, q0, 6) > WELL
    force = (0.9 if name == "panda" else 0.5) * FORCE * np.array([0.6, 0.0, -0.8])

    def pushed(largest: Any) -> hsp.Rollout:
        gains = hsp.Gains(natural_frequency=RATE)
        hand = hsp.FramePose(frame, gains=gains, largest_error=largest, name="hand")
        own = hsp.metrics.MassMatrixMetric() if metric == "mass" else None
        controller = hsp.Controller(
            robot, [hand], hsp.TargetPosture(q0), limits=None, metric=own, start=q0
        )
        push = Push(frame, force, start=0.05, duration=0.2)
        return hsp.simulate(
            controller, q0, duration=0.5, control_period=0.001,
            plant=RigidBodyPlant(robot, [push]),
        )  # fmt: skip

    bounded, free = pushed("robot"), pushed("none")
    e = bounded["task.hand.error"]
    assert 0.01 < np.linalg.norm(e[:, :3], axis=1).max() < STEP
    assert np.linalg.norm(e[:, 3:], axis=1).max() < TURN
    assert min(smallest(robot, frame, q, 6) for q in bounded.q) > NEAR
    np.testing.assert_allclose(
        bounded["task.hand.error"], free["task.hand.error"], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        bounded["null_space_norm"], free["null_space_norm"], rtol=0, atol=1e-9
    )


def test_two_arms_and_rails_are_exact_too() -> None:
    """A tree of two arms, and a chain with prismatic joints, in the metric M."""
    for model, frames in (two_pandas(), (rails(), ["hand"])):
        robot = hsp.Robot.from_pinocchio(model)
        q0 = np.full(robot.nv, 0.4)
        here = robot.state(0.0, q0, np.zeros(robot.nv))
        tasks = [
            hsp.FramePosition(each, hsp.Hold(here.position(each) + STEPPED))
            for each in frames
        ]
        gains = hsp.Gains(natural_frequency=RATE)
        tasks = [hsp.FramePosition(t.frame, t.trajectory, gains=gains) for t in tasks]
        for metric in (None, hsp.metrics.MassMatrixMetric()):
            controller = hsp.Controller(
                robot, tasks, hsp.TargetPosture(q0), limits=None, metric=metric
            )
            run = hsp.simulate(
                controller, q0, duration=DURATION, control_period=0.001, log_period=0.01
            )
            response = (1.0 + RATE * run.t) * np.exp(-RATE * run.t)
            for task in tasks:
                e = run[f"task.{task.name}.error"]
                away = np.abs(e - response[:, None] * e[0]).max()
                assert away <= SAMPLED * 1e-3 * np.linalg.norm(e[0])


def two_pandas() -> tuple[pin.Model, list[str]]:
    """Return two arms on one base, and their hands."""
    one, model = hsp.Robot.load("panda").model, pin.Model()
    for k, side in enumerate(("left", "right")):
        arm = one.copy()
        for j in range(1, arm.njoints):
            arm.names[j] = f"{side}_{arm.names[j]}"
        for frame in arm.frames:
            frame.name = f"{side}_{frame.name}"
        at = pin.SE3(np.eye(3), np.array([0.0, 0.6 * k, 0.0]))
        model = pin.appendModel(model, arm, 0, at)
    return model, ["left_panda_tcp", "right_panda_tcp"]


def rails() -> pin.Model:
    """Return two crossed rails with an arm of four joints on them."""
    model, rng, joint = pin.Model(), np.random.default_rng(3), 0
    kinds = [pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ(),
             pin.JointModelRY(), pin.JointModelRX(), pin.JointModelRY()]  # fmt: skip
    for k, kind in enumerate(kinds):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.0 if k < 2 else 0.25]))
        limits = np.full((4, 1), 0.3 if k < 2 else 2.5)
        joint = model.addJoint(
            joint, kind, place, f"joint{k}", limits[0], limits[1], -limits[2], limits[3]
        )
        inertia = pin.Inertia(rng.uniform(1.0, 3.0), 0.1 * rng.normal(size=3),
                              0.05 * np.eye(3))  # fmt: skip
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2]))
    model.addFrame(pin.Frame("hand", joint, 0, tip, pin.FrameType.OP_FRAME))
    return model
