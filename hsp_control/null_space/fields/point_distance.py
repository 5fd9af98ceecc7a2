"""The paper's obstacle cost: the distance of frames from an obstacle's centre."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.geometry.scene import Obstacle
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.robot import Robot, RobotState
from hsp_control.trajectories import TrajectorySample


class PointDistance(CompiledCost):
    """f = weight · Σ 1/d_k², d_k from the origin of frame k to the obstacle's centre.

    The paper's fourth simulation uses joints two and three of the planar arm and a
    moving disk. (∇f)' contains the motion of the centre.

    Attributes:
        frames: Names of the frames.
        obstacle: The obstacle.
        weight: The weight [m²/s].
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
            frames: Names of the frames that move away from the obstacle.
            obstacle: The obstacle, of which only the centre counts.
            weight: Weight ≥ 0 [m²/s].
            name: Name of the field in the log.

        Raises:
            FrameNotFoundError: If a frame does not exist.
            FieldError: If there is no frame, or the weight is negative or not finite.
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

    def minimum_distance(self, state: RobotState) -> float:
        """Return the minimum distance from a frame to the obstacle's centre [m]."""
        c = self.obstacle.center.sample(state.t, self._center).position
        return min(
            float(np.linalg.norm(state.position(frame) - c)) for frame in self.frames
        )

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        center = TrajectorySample.allocate(3)
        follow = self.obstacle.center.follow(center)
        pushes = []
        for name in self.frames:
            frame = state.frame(name)
            push = bind(
                _push,
                frame.jacobian,
                frame.jacobian_dot,
                frame.position,
                frame.velocity,
                center.position,
                center.velocity,
                self.weight,
                gradient,
                rate,
            )
            pushes.append((name, push))

        def derivatives() -> float:
            follow(state.t)
            gradient.fill(0.0)
            rate.fill(0.0)
            total = 0.0
            for name, push in pushes:
                state.frame(name)
                square = push()
                if square < 1e-24:  # a distance of 1e-12 m
                    raise FieldError(
                        f"field {self.name!r}: frame {name!r} is at the centre of "
                        f"obstacle {self.obstacle.name!r}, where the cost is infinite"
                    )
                total += self.weight / square
            return total

        return derivatives


@kernel
def _push(
    J: Array,
    J_dot: Array,
    position: Array,
    velocity: Array,
    center: Array,
    center_velocity: Array,
    weight: float,
    gradient: Array,
    rate: Array,
) -> float:
    """Add the terms of one frame to ∇f and (∇f)', and return d².

    With r from the centre to the frame and r' = J v - c' the terms are
    -2 weight Jᵀr/d⁴ and -2 weight (J'ᵀr + Jᵀr' - 4 (r·r'/d²) Jᵀr)/d⁴.
    """
    square = nearing = 0.0
    for a in range(3):
        r, r_dot = position[a] - center[a], velocity[a] - center_velocity[a]
        square += r * r
        nearing += r * r_dot
    if square == 0.0:
        return square
    scale = -2.0 * weight / (square * square)
    for i in range(gradient.shape[0]):
        for a in range(3):
            r, r_dot = position[a] - center[a], velocity[a] - center_velocity[a]
            inner = r_dot - 4.0 * nearing / square * r
            gradient[i] += scale * J[a, i] * r
            rate[i] += scale * (J_dot[a, i] * r + J[a, i] * inner)
    return square
