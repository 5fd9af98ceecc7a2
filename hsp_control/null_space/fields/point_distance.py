"""The paper's obstacle cost: the distance of frames from an obstacle's centre."""

from dataclasses import replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Name, Names, OrInstance
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.cost import CompiledCost, Derivatives
from hsp_control.robot import RobotState
from hsp_control.trajectories import TrajectorySample


class PointDistance(CompiledCost, type="point_distance"):
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

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        obstacle, center = self._placed_obstacle, TrajectorySample.allocate(3)
        follow = obstacle.center.follow(center)
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
                        f"obstacle {obstacle.name!r}, where the cost is infinite"
                    )
                total += 1.0 / square
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
    gradient: Array,
    rate: Array,
) -> float:
    """Add the terms of one frame to ∇f and (∇f)', and return d².

    With r from the centre to the frame and r' = J v - c' the terms are
    -2 Jᵀr/d⁴ and -2 (J'ᵀr + Jᵀr' - 4 (r·r'/d²) Jᵀr)/d⁴.
    """
    square = nearing = 0.0
    for a in range(3):
        r, r_dot = position[a] - center[a], velocity[a] - center_velocity[a]
        square += r * r
        nearing += r * r_dot
    if square == 0.0:
        return square
    scale = -2.0 / (square * square)
    for i in range(gradient.shape[0]):
        for a in range(3):
            r, r_dot = position[a] - center[a], velocity[a] - center_velocity[a]
            inner = r_dot - 4.0 * nearing / square * r
            gradient[i] += scale * J[a, i] * r
            rate[i] += scale * (J_dot[a, i] * r + J[a, i] * inner)
    return square
