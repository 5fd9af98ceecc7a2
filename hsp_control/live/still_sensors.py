"""Detects a joint's sensor that died while the joint was at rest."""

from math import ceil, exp

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.engine import Dynamics
from hsp_control.live.reaction_check import ReactionCheck
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

_QUIET, _FEWEST = 0.05, 5
"""Time for which a reading is constant to the last bit before it is checked [s], and
the minimum number of states."""
_REST = 0.05
"""Speed below which changes are noise [rad/s or m/s]."""
_NOISE = 1e-9
"""Minimum change that is noise: those of a simulated robot at rest are rounding."""
_MEMORY, _ALIVE = 1.0, 0.3
"""Time over which noise is detected [s], and the share of states that have it."""
_GRAVITY = 0.2
"""Tolerated error of a joint's modelled gravity, relative to it."""

_EFFORT = {"rad": "N·m", "m": "N"}


class StillSensors:
    """Checks joints whose position and velocity stay the same to the last bit.

    The reading of a joint at rest may be constant for ever. Its sensor is dead if it
    had noise before: changes in both directions, of different sizes, which excludes a
    coarse encoder at the edge of a step. Or if the effort exceeds the holding effort by
    more than friction (`LiveSettings.friction`) and the model's errors: the joint would
    move. Or if the reaction on the other joints shows that this one moves
    (`ReactionCheck`).

    Attributes:
        dead: Joints whose sensor is dead, shape (nv,).
        beyond: The joints' efforts beyond their holding efforts, shape (nv,) [N·m].
    """

    def __init__(
        self, robot: Robot, settings: LiveSettings, effort: Array, period: float
    ) -> None:
        """``effort`` limits the efforts, shape (nv,), inf where unlimited."""
        self._robot, self._period = robot, period
        self._quiet = max(_FEWEST, ceil(_QUIET / period))
        limited = np.isfinite(effort)
        self._friction = np.where(limited, effort, 0.0) * settings.friction
        self._friction[~limited] = np.inf
        self._judged = np.ones(robot.nv, dtype=bool)
        self._judged[list(robot.unactuated)] = False
        self._none = np.zeros(robot.nv, dtype=bool)
        self._reaction = ReactionCheck(settings.velocity_error)
        self.restart()

    def restart(self) -> None:
        """Forget all states."""
        nv = self._judged.size
        self._way, self._v, self._alive = np.zeros((3, nv))
        self._changes = np.zeros((2, nv))
        self._count = np.zeros(nv, dtype=np.int64)
        self.dead: Flags = self._none
        self.beyond: Array = np.zeros(nv)
        self._reaction.restart()

    def update(self, way: Array, v: Array, mean: Array, passed: float) -> None:
        """Add a new measurement.

        Args:
            way: Displacement since the last one, shape (nv,) [rad or m].
            v: Measured velocity, shape (nv,).
            mean: Mean velocity of some milliseconds, shape (nv,).
            passed: Time since the last one [s].
        """
        changes = np.stack([way - self._way, v - self._v])
        last, self._changes = self._changes, changes
        self._way, self._v = way, v
        sizes = np.abs(np.abs(changes) - np.abs(last)) > _NOISE
        noise = (sizes & (changes * last < -(_NOISE**2))).any(axis=0)
        noise &= np.abs(mean) < _REST
        still = (np.abs(way) < 1e-12) & (changes[1] == 0.0)
        self._count = np.where(still, self._count + 1, 0)
        self._reaction.update(mean, passed)
        # A silent joint keeps the record of its noise.
        part = 1.0 - exp(-passed / _MEMORY)
        self._alive = np.where(
            still, self._alive, self._alive + part * (noise - self._alive)
        )

    def judge(
        self, q: Array, v: Array, tau: Array, dynamics: Dynamics | None = None
    ) -> None:
        """Detect dead sensors, at a state under the acting effort, shape (nv,).

        ``dynamics``: those of a robot that carries something.
        """
        quiet = (self._count >= self._quiet) & self._judged
        if not quiet.any():
            self.dead = self._none
            return
        dead = quiet & (self._alive > _ALIVE)
        self.beyond = np.zeros(v.size)
        if not self._robot.unactuated:
            inertia = self._robot.mass_matrix(q, dynamics)
            free = self._robot.forward_dynamics(q, v, tau, dynamics)
            silent = np.flatnonzero(quiet)
            self.beyond[silent] = _holding(silent, inertia, free)
            gravity = self._robot.inverse_dynamics(q, 0.0 * v, 0.0 * v, dynamics)
            allowed = self._friction + _GRAVITY * np.abs(gravity)
            dead |= np.abs(self.beyond) > allowed
            self._reaction.expect(quiet, inertia, free)
            if self._reaction.felt:
                dead |= quiet
        self.dead = dead

    @property
    def gained(self) -> Array:
        """Velocity that joints with dead sensors have gained, by the others', (nv,)."""
        felt = self._reaction.felt
        return self._reaction.gained if felt else np.zeros(self._v.size)

    def why(self, i: int) -> str:
        """Return the reason why a joint's sensor is dead."""
        if self._alive[i] > _ALIVE:
            return "its sensor's noise has vanished; it is dead"
        if self._reaction.felt:
            return "the other joints show that it moves; its sensor is dead"
        return (
            f"its effort is {self.beyond[i]:.3g} {_EFFORT[self._robot.units[i]]} "
            "beyond the holding effort; its sensor is dead, or it is blocked"
        )


def _holding(silent: Indices, inertia: Array, free: Array) -> Array:
    """Return the force that keeps some joints at rest under an effort.

    By Gauss's principle M⁻¹ of these joints times the force is the missing
    acceleration.
    """
    among = np.linalg.inv(inertia)[np.ix_(silent, silent)]
    held: Array = np.linalg.solve(among, free[silent])
    return held
