"""How far a streamed reference may be ahead of what follows it: a reference governor.

A robot may be unable to follow: the target is out of reach, or a limit binds. Then the
reference would run away from it and the error grow to any size, and with it the pull
through a singularity, and the way back. So the reference looks at where the robot is.
While it is farther ahead than it may be, its goal is no farther from the robot than the
reference itself: on the line from the robot to the target. It brakes, follows a target
that moves aside, and goes on once the robot has caught up. A force that pushes the
robot away does not take the reference along: the target stays its goal.

The reference stays what it is otherwise, a C² function of time within its bounds; only
its goal is another one. For such schemes see E. Garone, S. Di Cairano, I. Kolmanovsky,
"Reference and command governors for systems with constraints", Automatica 75, 2017.
"""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array


class Lead(NamedTuple):
    """How far the reference may be ahead; inf: as far as it goes.

    Attributes:
        linear: Distance of the linear coordinates [m, or the task's unit].
        angular: Angle [rad].
        linear_size: How many coordinates are linear; the others are a rotation vector.
    """

    linear: float
    angular: float
    linear_size: int

    def exceeded(self, x: Array, actual: Array) -> bool:
        """Return whether x is too far from where the robot is, each of shape (n,)."""
        n = self.linear_size
        linear = float(np.linalg.norm(x[:n] - actual[:n]))
        angular = float(np.linalg.norm(x[n:] - actual[n:]))
        return linear > self.linear or angular > self.angular

    def distance(self, goal: Array, actual: Array) -> float:
        """Return how far the goal is from the robot, in units of the lead [-]."""
        n = self.linear_size
        linear = float(np.linalg.norm(goal[:n] - actual[:n]))
        angular = float(np.linalg.norm(goal[n:] - actual[n:]))
        return linear / self.linear + angular / self.angular

    def nearer_goal(self, goal: Array, x: Array, actual: Array) -> Array:
        """Return the goal, brought as near to the robot as the reference is.

        Args:
            goal: Where the reference is to go, shape (n,).
            x: Where it is, shape (n,).
            actual: Where the robot is, shape (n,).
        """
        nearer, n = goal.copy(), self.linear_size
        for part, lead in (slice(None, n), self.linear), (slice(n, None), self.angular):
            ahead = float(np.linalg.norm(x[part] - actual[part]))
            away = goal[part] - actual[part]
            distance = float(np.linalg.norm(away))
            if ahead > lead and distance > ahead:
                nearer[part] = actual[part] + ahead / distance * away
        return nearer
