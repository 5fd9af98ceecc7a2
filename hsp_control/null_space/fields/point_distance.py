"""The paper's obstacle cost: the distance of frames from an obstacle's centre."""

from dataclasses import replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Name, Names, OrInstance
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.geometry.scene import Obstacle, Start
from hsp_control.null_space.fields.cost import Cost
from hsp_control.robot import RobotState


class PointDistance(Cost, type="point_distance"):
    """f = Σ 1/d_k² [m²/s], d_k from the origin of frame k to the obstacle's centre.

    The paper's fourth simulation uses joints two and three of the planar arm and a
    moving disk. (∇f)' contains the motion of the centre.
    """

    frames: Annotated[Names, Field(min_length=1)]
    """Names of the frames that move away from the obstacle [-]."""
    obstacle: Annotated[str | Obstacle, OrInstance(Name, Obstacle)]
    """Name of the obstacle in the scene, of which only the centre is used [-]; or, in
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

    def derivatives(self, state: RobotState, gradient: Array, rate: Array) -> PartCalls:
        """Return the calls, which add the frames to f, ∇f and (∇f)'."""
        center, moving = self._placed_obstacle.center.supplied()
        total = np.zeros(1)
        adding = [
            PartCall(
                engine.PointDistance,
                first=k == 0,
                frame=state.frame(frame),
                center=center,
                total=total,
                gradient=gradient,
                rate=rate,
            )
            for k, frame in enumerate(self.frames)
        ]
        return [*moving, *adding]

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
