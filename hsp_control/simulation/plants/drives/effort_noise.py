"""Noise on the applied effort, such as torque ripple."""

from typing import ClassVar

import numpy as np

from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.drives.drive import Drive, Driving


class EffortNoise(Drive, type="noise"):
    """Gaussian white noise on the effort, constant during a period."""

    stage: ClassVar[float] = 40.0

    std: Weights
    """Standard deviation of effort noise [N·m or N], one number or nv."""

    @property
    def active(self) -> bool:
        """Whether there is noise."""
        return bool(np.any(self.std))

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return what adds noise to the effort; see `Drive.begin`."""
        with within("std"):
            std = per_dof(robot, self.std)
        return lambda tau: (tau + std * random.standard_normal(std.shape), 0.0)
