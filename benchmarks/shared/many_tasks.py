"""Larger robots with several pose tasks: this law and TSID on the same problem."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import planned
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import RigidBodyPlant
from hsp_control.trajectories import Blend, ComposedPose, HoldOrientation, PoseSample

FREQUENCY, NULL_SPACE_GAIN, POSTURE_RATE = 10.0, 10.0, 1.0
PERIOD, STEP = 1e-3, 2.5e-4  # [s]
ASIDE = np.array([0.05, 0.0, 0.0])  # from the start to the circle's centre [m]


@dataclass
class Poses:
    """Frames of one robot follow small circles; a posture is held in the null space.

    Attributes:
        name: Name in the table.
        robot: The robot.
        q0: Start configuration, shape (nq,) = (nv,).
        frames: Names of the frames, with six task rows per frame.
        trajectories: One pose trajectory per frame.
    """

    name: str
    robot: hsp.Robot
    q0: Array
    frames: tuple[str, ...]

    def __post_init__(self) -> None:
        """Make circles through the start positions of the frames."""
        state = self.robot.state(0.0, self.q0, np.zeros(self.robot.nv))
        self.trajectories = []
        for frame in self.frames:
            start = state.frame(frame)
            circle = hsp.Circle(
                0.05, 2.0, start.position + ASIDE, phase=np.pi, normal=[0.0, 0.0, 1.0]
            )
            self.trajectories.append(
                ComposedPose(
                    Blend(circle, 1.0, start=start.position),
                    HoldOrientation(start.rotation),
                )
            )

    def law(
        self, static_effort: Literal["none", "robot"] = "none"
    ) -> Callable[[float, Array, Array], Array]:
        """Return this law as a function (t, q, v) ↦ tau.

        Without a limit on static efforts it has the limits that TSID has.
        """
        gains = hsp.Gains(natural_frequency=FREQUENCY)
        tasks = [
            hsp.FramePose(frame, trajectory, gains=gains)
            for frame, trajectory in zip(self.frames, self.trajectories, strict=True)
        ]
        posture = hsp.TargetPosture(self.q0, weights=POSTURE_RATE)
        controller = hsp.Controller(
            self.robot,
            tasks,
            posture,
            null_space_gain=NULL_SPACE_GAIN,
            limits=hsp.Limits(
                velocity=None, position=None, static_effort=static_effort
            ),
        )

        def compute(t: float, q: Array, v: Array) -> Array:
            return controller.compute(t, q, v).tau

        compute.controller = controller  # type: ignore[attr-defined]
        return compute

    def tsid(self) -> Callable[[float, Array, Array], Array]:
        """Return TSID as in `controllers/tsid_peer.py`, with one pose task a frame."""
        import tsid

        model, nv = self.robot.model, self.robot.nv
        robot = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
        problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        problem.computeProblemData(0.0, self.q0, np.zeros(nv))
        kp, kv = FREQUENCY**2, 2.0 * FREQUENCY
        tasks = []
        for frame in self.frames:
            task = tsid.TaskSE3Equality(frame, robot, frame)
            task.useLocalFrame(False)
            task.setKp(kp * np.ones(6))
            task.setKd(kv * np.ones(6))
            problem.addMotionTask(task, 1.0, 1, 0.0)
            tasks.append(task)
        posture = tsid.TaskJointPosture("posture", robot)
        posture.setKp(NULL_SPACE_GAIN * POSTURE_RATE * np.ones(nv))
        posture.setKd((NULL_SPACE_GAIN + POSTURE_RATE) * np.ones(nv))
        problem.addMotionTask(posture, 1e-3, 1, 0.0)
        bounds = tsid.TaskActuationBounds("effort", robot)
        effort = np.array(model.upperEffortLimit)
        effort[effort <= 0.0] = 1e3
        bounds.setBounds(-effort, effort)
        problem.addActuationTask(bounds, 1.0, 0, 0.0)
        solver = tsid.SolverHQuadProgFast("qp")
        solver.resize(problem.nVar, problem.nEq, problem.nIn)
        samples = [tsid.TrajectorySample(12, 6) for _ in tasks]
        still = tsid.TrajectorySample(nv)
        still.value(self.q0)
        still.derivative(np.zeros(nv))
        desired = [PoseSample.allocate() for _ in tasks]
        followers = [
            planned(trajectory.calls(out)).run
            for trajectory, out in zip(self.trajectories, desired, strict=True)
        ]
        place, rate, rate_dot = np.zeros(12), np.zeros(6), np.zeros(6)

        def compute(t: float, q: Array, v: Array) -> Array:
            for task, sample, out, follow in zip(
                tasks, samples, desired, followers, strict=True
            ):
                follow(t)
                x, R = out
                place[:3], place[3:] = x.position, R.rotation.T.ravel()
                rate[:3], rate[3:] = x.velocity, R.angular_velocity
                rate_dot[:3], rate_dot[3:] = x.acceleration, R.angular_acceleration
                sample.value(place)
                sample.derivative(rate)
                sample.second_derivative(rate_dot)
                task.setReference(sample)
            posture.setReference(still)
            solution = solver.solve(problem.computeProblemData(t, q, v))
            if solution.status != 0:
                raise RuntimeError(f"TSID found no solution at t = {t:.4f} s")
            return problem.getActuatorForces(solution)

        compute.kept = (robot, tasks, posture, bounds)  # type: ignore[attr-defined]
        parts = problem, solver, [*tasks, posture]
        compute.parts = parts  # type: ignore[attr-defined]
        return compute

    def run(
        self, compute: Callable[[float, Array, Array], Array], duration: float
    ) -> tuple[float, list[tuple[float, Array, Array]]]:
        """Run in closed loop; return the rms error [m] of the last half, and states."""
        plant, integrator = RigidBodyPlant(self.robot), Rk4(STEP)
        q, v, tau = self.q0.copy(), np.zeros(self.robot.nv), np.zeros(self.robot.nv)
        state, states, squares = hsp.RobotState(self.robot), [], []

        def accelerate(t: float, q: Array, v: Array) -> Array:
            return plant.acceleration(t, q, v, tau)

        for k in range(round(duration / PERIOD)):
            t = k * PERIOD
            states.append((t, q, v))
            if t >= 0.5 * duration:
                state.update(t, q, v)
                for frame, trajectory in zip(
                    self.frames, self.trajectories, strict=True
                ):
                    error = trajectory.sample(t).position.position
                    error = error - state.position(frame)
                    squares.append(float(error @ error))
            tau[:] = compute(t, q, v)
            q, v = integrator.advance(self.robot, accelerate, t, t + PERIOD, q, v)
        return float(np.sqrt(np.mean(squares))), states


def two_arms() -> Poses:
    """Return two Pandas a metre apart: 14 joints, 12 rows."""
    arm = hsp.Robot.load("panda")
    robot = hsp.Robot.combine(
        {
            "left": (arm, pin.SE3(np.eye(3), np.array([0.0, 0.5, 0.0]))),
            "right": (arm, pin.SE3(np.eye(3), np.array([0.0, -0.5, 0.0]))),
        }
    )
    frames = ("left_panda_tcp", "right_panda_tcp")
    return Poses("two Pandas, 14 joints, 12 rows", robot, robot.home(), frames)


def humanoid() -> Poses:
    """Return Talos with a fixed pelvis: poses of both hands and a foot, 18 rows."""
    robot = hsp.Robot.load("talos", root="fixed")
    frames = ("gripper_left_base_link", "gripper_right_base_link", "left_sole_link")
    q = robot.home()
    for name, angle in BENT.items():
        q[robot.joints[name].idx_q] = angle
    return Poses(f"Talos, {robot.nv} joints, 18 rows", robot, q, frames)


BENT = {
    "leg_left_3_joint": -0.4, "leg_left_4_joint": 0.8, "leg_left_5_joint": -0.4,
    "arm_left_1_joint": 0.25, "arm_left_2_joint": 0.2, "arm_left_4_joint": -1.2,
    "arm_right_1_joint": -0.25, "arm_right_2_joint": -0.2, "arm_right_4_joint": -1.2,
}  # fmt: skip
"""Elbows and a knee are flexed, so that no task is singular [rad]."""
