"""The motion of a swing foot to a place that may change, with a soft touchdown."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.footsteps import Footstep
from hsp_control.companions.walking.quintic import FootMotion, Quintic, at_rest, to_rest
from hsp_control.engine.rotations import exp3, log3
from hsp_control.trajectories.schedule import smooth_step

APPROACH = 0.92
"""Share of the swing after which the foot is above its place, and only descends."""
DESCENT = 3.6
"""Speed at which a foot descends that has not touched the ground in time, in lifts per
swing [-]: that of the lift. On two legs the body falls while it waits."""
_SETTLING = 0.1
"""Time in which it reaches that speed, in swings [-]."""
_LEVEL = np.zeros(2)


class Swing:
    """The motion of a foot from take-off to touchdown; C² also when redirected.

    It begins at rest at the foot's place, rotates towards the flat ground, and is at
    rest again above its target at the planned touchdown. Without ground there, it
    descends.

    Attributes:
        start: Its start time [s].
        end: The planned time of touchdown [s].
        target: The footstep.
    """

    def __init__(
        self,
        t: float,
        duration: float,
        position: Array,
        rotation: Array,
        target: Footstep,
        goal: Array,
        height: float,
        lift: float,
        slope: Array = _LEVEL,
    ) -> None:
        """Plan the motion, above ground of a slope, shape (2,) [-]."""
        self.start, self.end, self.target = t, t + duration, target
        self._rotation = rotation.copy()
        self._axis = log3(goal @ rotation.T)  # in world axes
        self._slope, self._level = slope, height - float(slope @ target.point)
        self._top = max(float(position[2]), height) + lift
        self._descent, self._settling = DESCENT * lift / duration, _SETTLING * duration
        along = at_rest([position[0], position[1], 0.0])
        self._along = to_rest(along, self._there, t, APPROACH * duration)
        self._up = to_rest(at_rest(position[2:]), [self._top], t, 0.5 * duration)
        self._down = self._descending(at_rest([self._top]), self._up.end)

    @property
    def _there(self) -> Array:
        """The final place, and the complete rotation: x, y, 1."""
        return np.array([self.target.x, self.target.y, 1.0])

    @property
    def _height(self) -> float:
        """The height of the foot there [m]."""
        return self._level + float(self._slope @ self.target.point)

    def _descending(self, now: FootMotion, t: float) -> Quintic:
        return to_rest(now, [self._height], t, max(self.end - t, 1e-3))

    def share(self, t: float) -> float:
        """Return the elapsed share of the swing at time t [s]."""
        return (t - self.start) / (self.end - self.start)

    def redirect(
        self, t: float, target: Footstep, end: float, *, rises: bool = True
    ) -> None:
        """Redirect it to another place of the same yaw, and another touchdown time."""
        along, vertical = self._along.sample(t), self._vertical(t)
        self.target, self.end = target, end
        until = self.start + APPROACH * (end - self.start)
        self._along = to_rest(along, self._there, t, max(until - t, 0.05))
        apex = 0.5 * (self.start + end)
        if rises and apex - t > 0.05 and t < self._up.end:
            self._up = to_rest(vertical, [self._top], t, apex - t)
            self._down = self._descending(at_rest([self._top]), self._up.end)
        else:
            self._up = Quintic(t, 0.0, np.zeros((6, 1)))  # it is over
            self._down = self._descending(vertical, t)

    def position(self, t: float) -> FootMotion:
        """Return x, x' and x'' of the foot's frame, shapes (3,)."""
        along, vertical = self._along.sample(t), self._vertical(t)
        return FootMotion(
            *(np.append(a[:2], z) for a, z in zip(along, vertical, strict=True))
        )

    def accelerations(self, times: Array) -> Array:
        """Return x'' of the foot's frame at times until touchdown, shape (m, 3)."""
        up = times < self._up.end
        vertical = np.where(
            up[:, None], self._up.accelerations(times), self._down.accelerations(times)
        )
        return np.hstack([self._along.accelerations(times)[:, :2], vertical])

    def orientation(self, t: float) -> FootMotion:
        """Return R, ω and ω', shapes (3, 3), (3,) and (3,)."""
        s, s_dot, s_ddot = (float(each[2]) for each in self._along.sample(t))
        rotation = exp3(s * self._axis) @ self._rotation
        return FootMotion(rotation, s_dot * self._axis, s_ddot * self._axis)

    def _vertical(self, t: float) -> FootMotion:
        """Return z, z' and z'', shapes (1,)."""
        if t < self._up.end:
            return self._up.sample(t)
        if t < self._down.end:
            return self._down.sample(t)
        settling, speed = self._settling, self._descent
        s, s_dot, _ = smooth_step(t, self._down.end, settling)
        late = t - self._down.end
        u = min(late / settling, 1.0)
        # The integral of the smooth step.
        fallen = u**4 * (2.5 + u * (u - 3.0)) * settling + max(late - settling, 0.0)
        return FootMotion(
            np.array([self._height - speed * fallen]),
            np.array([-speed * s]),
            np.array([-speed * s_dot]),
        )


def turned(yaw: float, rotation: Array) -> Array:
    """Return an orientation rotated about the vertical by an angle [rad]."""
    return exp3(np.array([0.0, 0.0, yaw])) @ rotation
