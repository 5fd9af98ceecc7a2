"""The paper's obstacle cost: frames keep away from an obstacle's centre."""

from collections.abc import Sequence

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.cost import Cost
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Obstacle
from hsp_control.trajectories import TrajectorySample


class PointDistance(Cost):
    """f = weight · Σ 1/d_k², d_k from the origin of frame k to the obstacle's centre.

    The paper's fourth simulation: joints two and three of the planar arm and a moving
    disk. The centre's motion enters through ∂∇f/∂t.
    """

    def __init__(
        self,
        robot: Robot,
        frames: Sequence[str],
        obstacle: Obstacle,
        *,
        weight: float = 1.0,
        name: str = "point_distance",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            frames: Names of the frames that keep away.
            obstacle: What they keep away from.
            weight: Weight ≥ 0 [m² /s].
            name: What the log calls it.

        Raises:
            FrameNotFoundError: If a frame does not exist.
            FieldError: If no frame is named or the weight is negative.
        """
        super().__init__(robot, name)
        if not frames:
            raise FieldError(f"field {name!r} needs at least one frame")
        if not 0.0 <= weight < np.inf:
            raise FieldError(f"field {name!r}: weight {weight} must be at least 0")
        for frame in frames:
            robot.frame_id(frame)
        self.frames = tuple(frames)
        self.obstacle = obstacle
        self.weight = float(weight)
        self._center = TrajectorySample.allocate(3)

    def least_distance(self, state: RobotState) -> float:
        """Return the least distance from a frame to the obstacle's centre [m]."""
        c = self.obstacle.center.sample(state.t, self._center).position
        return min(
            float(np.linalg.norm(state.position(frame) - c)) for frame in self.frames
        )

    def value(self, state: RobotState) -> float:
        """Return f."""
        c = self.obstacle.center.sample(state.t, self._center).position
        total = 0.0
        for frame in self.frames:
            total += self.weight / self._square(frame, state.position(frame) - c)
        return total

    def gradient(self, state: RobotState) -> Array:
        """Return -2 weight Σ Jᵀr/d⁴ with r from the centre to the frame."""
        c = self.obstacle.center.sample(state.t, self._center).position
        result = np.zeros(self.robot.nv)
        for name in self.frames:
            frame = state.frame(name)
            r = frame.position - c
            result += frame.jacobian[:3].T @ r / self._square(name, r) ** 2
        return -2.0 * self.weight * result

    def gradient_rate(self, state: RobotState) -> Array:
        """Return -2 weight Σ (J'ᵀr + Jᵀr' - 4 (r·r'/d²) Jᵀr)/d⁴ with r' = Jv - c'."""
        c, c_dot, _ = self.obstacle.center.sample(state.t, self._center)
        result = np.zeros(self.robot.nv)
        for name in self.frames:
            frame = state.frame(name)
            J, J_dot = frame.jacobian[:3], frame.jacobian_dot[:3]
            r = frame.position - c
            r_dot = frame.velocity[:3] - c_dot
            square = self._square(name, r)
            bent = r_dot - 4.0 * float(r @ r_dot) / square * r
            result += (J_dot.T @ r + J.T @ bent) / square**2
        return -2.0 * self.weight * result

    def _square(self, frame: str, r: Array) -> float:
        """Return d².

        Raises:
            FieldError: If it is 0, where the cost is infinite.
        """
        square = float(r @ r)
        if square < 1e-24:  # a distance of 1e-12 m
            raise FieldError(
                f"field {self.name!r}: frame {frame!r} is at the centre of obstacle "
                f"{self.obstacle.name!r}, where the cost is infinite"
            )
        return square
