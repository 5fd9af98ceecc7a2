"""The common case: one robot, trajectory, start, field, obstacle and set of gains.

Every controller gets the same numbers, and the same field g in the form that its
interface allows: see `Case.posture_acceleration`.
"""

import copy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import planned
from hsp_control.geometry import Scene
from hsp_control.geometry.scene import Start
from hsp_control.geometry.shapes import Sphere
from hsp_control.law import IDENTITY
from hsp_control.null_space.fields import FieldSample, ObstacleClearance
from hsp_control.null_space.metrics import IdentityMetric, MetricSample
from hsp_control.trajectories import Blend, ComposedPose, HoldOrientation, PoseSample

FRAME = "panda_tcp"
CENTER = np.array([0.1, 0.0, 0.0])  # of the circle, from the start [m]


@dataclass
class Case:
    """A Panda's hand draws a circle while a ball moves near its elbow.

    Attributes:
        rows: Rows of the hand task: 6 for a pose, 3 for a position.
        obstacle: Whether the field avoids the ball; the ball moves in both cases.
        period: How long an effort is held [s].
        duration: Length of a run [s].
        settled: When the transient is over and measuring begins [s].
        natural_frequency: ω0 of the critically damped task [rad/s].
        null_space_gain: K_N [1/s].
        posture_rate: α of the field's posture part, g = -α (q - q_home) [1/s].
        clearance_weight: Weight of the field's obstacle part.
        frame: Name of the hand's frame.
        robot: The robot.
    """

    rows: int = 6
    obstacle: bool = True
    period: float = 1e-3
    duration: float = 8.0
    settled: float = 2.0
    natural_frequency: float = 10.0
    null_space_gain: float = 10.0
    posture_rate: float = 1.0
    clearance_weight: float = 0.3
    frame: str = FRAME
    robot: hsp.Robot = field(init=False)

    def __post_init__(self) -> None:
        """Build the robot, trajectory, ball, gains and field of all controllers."""
        self.robot = robot = hsp.Robot.load("panda")
        self.q0 = robot.home()
        state = robot.state(0.0, self.q0, np.zeros(robot.nv))
        start = state.frame(FRAME)
        circle = hsp.Circle(
            0.1, 2.0, start.position + CENTER, phase=np.pi, normal=[0.0, 0.0, 1.0]
        )
        self.trajectory = ComposedPose(
            Blend(circle, 1.0, start=start.position), HoldOrientation(start.rotation)
        )
        ball = hsp.Circle(
            0.3, 1.1, [-0.1, 0.51, 0.61], phase=np.pi / 2, normal=[0.0, 0.0, 1.0]
        )
        self.ball = hsp.Obstacle("ball", Sphere(0.1), ball)
        self.gains = hsp.Gains(natural_frequency=self.natural_frequency)
        posture = hsp.TargetPosture(self.q0, weights=self.posture_rate)
        self.clearance = ObstacleClearance([self.ball], influence=0.25)
        self.field: hsp.NullSpaceField = posture
        if self.obstacle:
            self.field = posture + self.clearance_weight * self.clearance
        self._placed = self.field.placed(Start(state, Scene()))
        self._metric = IdentityMetric().evaluate(state, MetricSample.allocate(robot.nv))
        self._sample = FieldSample.allocate(robot.nv)
        self._state = hsp.RobotState(robot)
        self._pose = PoseSample.allocate()
        self._follow = planned(self.trajectory.calls(self._pose)).run

    # -- references of the peers ------------------------------------------------------

    @property
    def kp(self) -> float:
        """Task stiffness [1/s²], critically damped with `kv`."""
        return self.natural_frequency**2

    @property
    def kv(self) -> float:
        """Task damping [1/s]."""
        return 2.0 * self.natural_frequency

    @property
    def posture_kp(self) -> float:
        """Posture stiffness of K_N and α, see `posture_acceleration` [1/s²]."""
        return self.null_space_gain * self.posture_rate

    @property
    def posture_kv(self) -> float:
        """Posture damping of K_N and α [1/s]."""
        return self.null_space_gain + self.posture_rate

    def desired(self, t: float) -> PoseSample:
        """Return the hand's pose at time t [s] and its derivatives; one buffer."""
        self._follow(t)
        return self._pose

    def repulsion(self, t: float, q: Array) -> Array:
        """Return the obstacle's part of g, shape (nv,), or zeros [rad/s]."""
        if not self.obstacle:
            return np.zeros(self.robot.nv)
        state = self._state.update(t, q, np.zeros(self.robot.nv))
        return -self.clearance_weight * self.clearance.gradient(state)

    def posture_acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Return the null-space acceleration of controllers without g'.

        K_N (g - v) + g', with g' = -α v of the posture part and without the obstacle's:
        Kp (q_home - q) - Kv v + K_N g_ball, a posture task plus the gradient of an
        artificial potential, which is common practice.
        """
        posture = self.posture_kp * (self.q0 - q) - self.posture_kv * v
        return posture + self.null_space_gain * self.repulsion(t, q)

    def exact_acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Return K_N (g - v) + g' with this package's exact rate of the whole field."""
        sample = self._evaluate(self._state.update(t, q, v))
        return self.null_space_gain * (sample.g - v) + sample.g_dot

    def save(self, path: Path, states: list[tuple[float, Array, Array]]) -> None:
        """Write the case for an environment without this package."""
        times = np.arange(round(self.duration / self.period) + 1) * self.period
        poses = [copy.deepcopy(self.desired(t)) for t in times]
        np.savez(
            path,
            urdf=str(self.robot.source.urdf),
            frame=self.frame,
            rows=self.rows,
            period=self.period,
            settled=self.settled,
            q0=self.q0,
            gains=[self.kp, self.kv, self.posture_kp, self.posture_kv],
            position=np.stack([np.stack(pose.position) for pose in poses]),
            rotation=np.stack([pose.orientation.rotation for pose in poses]),
            turning=np.stack([np.stack(pose.orientation[1:]) for pose in poses]),
            times=[t for t, _, _ in states],
            q=[q for _, q, _ in states],
            v=[v for _, _, v in states],
        )

    # -- measurements -----------------------------------------------------------------

    def measure(self, t: float, q: Array, v: Array) -> dict[str, float]:
        """Measure one instant, in the same way for every controller."""
        state = self._state.update(t, q, v)
        frame, desired = state.frame(FRAME), self.desired(t)
        rotation_error = pin.log3(desired.orientation.rotation.T @ frame.rotation)
        J = frame.jacobian[: self.rows]
        g = self._evaluate(state).g
        P = np.eye(self.robot.nv) - np.linalg.pinv(J) @ J
        M = state.mass_matrix
        J_M = np.linalg.solve(M, J.T)
        P_M = np.eye(self.robot.nv) - J_M @ np.linalg.solve(J @ J_M, J)
        error_M, flow_M = P_M @ (g - v), P_M @ g
        return {
            "position": float(
                np.linalg.norm(desired.position.position - frame.position)
            ),
            "orientation": (
                float(np.linalg.norm(rotation_error)) if self.rows == 6 else 0.0
            ),
            "null_space_error": float(np.linalg.norm(P @ (g - v))),
            "null_space_flow": float(np.linalg.norm(P @ g)),
            "null_space_error_M": float(np.sqrt(error_M @ M @ error_M)),
            "null_space_flow_M": float(np.sqrt(flow_M @ M @ flow_M)),
            "manipulability": float(np.linalg.det(J @ J.T)),
            "posture": float(np.linalg.norm(q - self.q0)),
            "distance": self.clearance.minimum_distance(state),
        }

    def _evaluate(self, state: hsp.RobotState) -> FieldSample:
        return self._placed.evaluate(state, self._metric, IDENTITY, self._sample)
