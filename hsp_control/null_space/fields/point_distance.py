"""The paper's obstacle cost: the distance of frames from an obstacle's centre."""

from dataclasses import replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Name, Names, OrInstance
from hsp_control.geometry.scene import Obstacle, Start
from hsp_control.null_space.fields.cost import Cost
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameMotion
from hsp_control.trajectories import TrajectorySample


class PointDistance(Cost, type="point_distance"):
    """f = Σ 1/d_k² [m²/s], d_k from the origin of frame k to the obstacle's centre.

    The paper's fourth simulation uses joints two and three of the planar arm and a
    moving disk. (∇f)' contains the motion of the centre.
    """

    frames: Annotated[Names, Field(min_length=1)]
    """Names of the frames that move away from the obstacle [-]."""
    obstacle: Annotated[str | Obstacle, OrInstance(Name, Obstacle)]
    """Name of the obstacle in the scene, of which only the centre counts [-]; or, in
    Python, the obstacle itself."""

    def placed(self, start: Start) -> Self:
        """Return the cost with its obstacle from the scene, checked."""
        for k, frame in enumerate(self.frames):
            with within("frames", k):
                start.state.robot.frame_id(frame)
        if isinstance(self.obstacle, Obstacle):
            return self
        with within("obstacle"):
            return replace(self, obstacle=start.scene[self.obstacle])

    @property
    def _placed_obstacle(self) -> Obstacle:
        if isinstance(self.obstacle, Obstacle):
            return self.obstacle
        raise self._not_placed("obstacle")

    def minimum_distance(self, state: RobotState) -> float:
        """Return the minimum distance from a frame to the obstacle's centre [m]."""
        c = self._placed_obstacle.center.sample(state.t).position
        return min(
            float(np.linalg.norm(state.position(frame) - c)) for frame in self.frames
        )

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel; see `Cost.kernel`."""
        frames = tuple(map(state.frame, self.frames))
        return _point_distance, (frames, self._placed_obstacle.center)

    def value(self, state: RobotState) -> float:
        """Return f; see `Cost.value`.

        Raises:
            FieldError: If a frame is at the centre, where the cost is infinite.
        """
        value = super().value(state)
        if np.isfinite(value):
            return value
        c = self._placed_obstacle.center.sample(state.t).position
        for name in self.frames:
            if np.linalg.norm(state.position(name) - c) < NEAREST:
                raise FieldError(
                    f"field {self.name!r}: frame {name!r} is at the centre of obstacle "
                    f"{self._placed_obstacle.name!r}, where the cost is infinite"
                )
        return value


NEAREST = 1e-12
"""Below this distance a frame is at the centre [m]."""


@kernel
def _point_distance(
    frames: tuple[FrameMotion, ...],
    center: TrajectorySample,
    gradient: Array,
    rate: Array,
) -> float:
    """Write ∇f and (∇f)', and return f: the sum over the frames.

    With r from the centre to a frame and r' = J v - c' its terms are
    -2 Jᵀr/d⁴ and -2 (J'ᵀr + Jᵀr' - 4 (r·r'/d²) Jᵀr)/d⁴.
    """
    c, c_dot = center.position, center.velocity
    for i in range(gradient.shape[0]):
        gradient[i] = rate[i] = 0.0
    total = 0.0
    for frame in frames:
        J, J_dot, x, x_dot = (
            frame.jacobian,
            frame.jacobian_dot,
            frame.position,
            frame.velocity,
        )
        square = nearing = 0.0
        for a in range(3):
            r, r_dot = x[a] - c[a], x_dot[a] - c_dot[a]
            square += r * r
            nearing += r * r_dot
        if square < NEAREST * NEAREST:
            gradient[0] = np.inf  # the law reports that the field is not finite
            return np.inf
        scale = -2.0 / (square * square)
        for i in range(gradient.shape[0]):
            for a in range(3):
                r, r_dot = x[a] - c[a], x_dot[a] - c_dot[a]
                inner = r_dot - 4.0 * nearing / square * r
                gradient[i] += scale * J[a, i] * r
                rate[i] += scale * (J_dot[a, i] * r + J[a, i] * inner)
        total += 1.0 / square
    return total
