"""The effect of legs on the centre of pressure, and how a plan compensates it.

A swinging leg has an angular momentum L about the centre of mass. If the trunk does not
turn, the centre of pressure is displaced from the repellent point p to

    p + (-L_y', L_x') / (m g)

(Popovic, Goswami and Herr 2005, "Ground reference points in legged locomotion", Int. J.
Robotics Research 24): by up to the length of a sole for a long and fast step. A plan
that keeps p in the middle of the sole would need the whole sole for that, and beyond
its edge the arms. So here p moves in the opposite direction, by δ = K a with a the
acceleration of the swing foot, and the centre of pressure stays in the middle. As
ξ' = ω (ξ - p), the divergent component then differs from that for p at rest by

    η(t) = ω ∫ exp(ω (t - τ)) δ(τ) dτ,   τ from t to touchdown,

which is zero at touchdown: a foot that starts and ends at rest has no net effect.

The legs also rotate as the centre of mass moves above stance feet: with K_c of its
acceleration, the centre of pressure is the p of a pendulum that is longer by g K_c.

K and K_c follow from the law: from the accelerations by which its metric moves one
foot, or the centre of mass, while the other foot and the trunk stay.
"""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.footsteps import Footstep
from hsp_control.companions.walking.pendulum import GRAVITY
from hsp_control.companions.walking.swing import Swing
from hsp_control.control.interface import Controller
from hsp_control.law import MetricSample
from hsp_control.robot import RobotState

_FOOT, _BODY = slice(0, 3), slice(12, 15)
"""Rows of the accelerations: of the swing foot, and of the centre of mass."""
_SINGULAR = 1e-6
"""Directions with a smaller share of the largest response are not moved."""
_SAMPLES = 49
"""Number of samples of a swing's reaction; it is linear between them."""


class Reaction(NamedTuple):
    """The reaction of a swing from some time until touchdown; zero after it.

    Attributes:
        start: Its start time [s].
        step: The time between two samples [s].
        points: δ, the displacement of the repellent point, shape (n, 2) [m].
        shifts: η, the displacement of the divergent component, shape (n, 2) [m].
    """

    start: float
    step: float
    points: Array
    shifts: Array

    def point(self, t: float) -> Array:
        """Return δ at time t [s], shape (2,) [m]."""
        return self._at(self.points, t)

    def shift(self, t: float) -> Array:
        """Return η at time t [s], shape (2,) [m]."""
        return self._at(self.shifts, t)

    def _at(self, samples: Array, t: float) -> Array:
        place = max((t - self.start) / self.step, 0.0)
        k = int(place)
        if k + 1 >= len(samples):
            return np.zeros_like(samples[0])
        return np.asarray(samples[k] + (place - k) * (samples[k + 1] - samples[k]))


def reaction_of(points: Array, start: float, step: float, frequency: float) -> Reaction:
    """Return the reaction of a repellent point that moves through points."""
    decay = float(np.exp(-frequency * step))
    m = np.diff(points, axis=0) / (frequency * step)
    # Contribution of each interval at its beginning, exact for lines.
    own = points[:-1] + m - (points[1:] + m) * decay
    fades = decay ** np.arange(len(own))[:, None]
    later = np.cumsum((fades * own)[::-1], axis=0)[::-1] / fades
    return Reaction(start, step, points, np.vstack([later, 0.0 * points[:1]]))


class LegReaction:
    """K of both legs, at the beginning and at the end of their last swings."""

    def __init__(
        self, controller: Controller, trunk: str, frames: dict[float, str]
    ) -> None:
        """Set the robot."""
        self._metric, self._trunk, self._frames = controller.metric, trunk, frames
        self._sample = MetricSample.allocate(controller.robot.nv)
        self._first: dict[float, Array] = {}
        self._last: dict[float, Array] = {}

    def begin(
        self, state: RobotState, yaw: float, duration: float, frequency: float
    ) -> None:
        """Compute K of both legs before the first step."""
        self._frequency = frequency
        for side in self._frames:
            self.lifts(state, side, yaw)
            self.lands(state, side, yaw)
        # A lead is linear in the length and in the height of a step.
        place, one = Footstep(1.0, 1.0, 0.0), np.eye(3)
        unit = Swing(0.0, duration, np.zeros(3), one, place, one, 0.0, 1.0)
        times, step = _times(0.0, duration)
        shape = unit.accelerations(times)
        later = (times / duration)[:, None] * shape
        self._share = reaction_of(shape, 0.0, step, frequency).shift(0.0)
        self._later = reaction_of(later, 0.0, step, frequency).shift(0.0)

    def lifts(self, state: RobotState, side: float, yaw: float) -> None:
        """Compute K of a leg at the beginning of its swing."""
        self._first[side] = self._gain(state, side, yaw)

    def lands(self, state: RobotState, side: float, yaw: float) -> None:
        """Compute K of a leg at the end of its swing; see `lifts`."""
        self._last[side] = self._gain(state, side, yaw)

    def lead(self, side: float, standing: Footstep, way: Array) -> Array:
        """Return η at the beginning of a planned swing, shape (2,) [m]."""
        turned = _turn(standing.yaw)
        local, first = way @ turned, self._first[side]
        own = first @ (self._share * local)
        own = own + (self._last[side] - first) @ (self._later * local)
        return np.asarray(turned[:2, :2] @ own)

    def of(self, swing: Swing, t: float, side: float, standing: Footstep) -> Reaction:
        """Return the reaction of a swing from a time on."""
        times, step = _times(t, max(swing.end, t + 1e-3))
        shares = (times - swing.start)[:, None] / (swing.end - swing.start)
        turned = _turn(standing.yaw)
        local = swing.accelerations(times) @ turned
        first, last = self._first[side], self._last[side]
        points = (
            local @ first.T + np.minimum(shares, 1.0) * (local @ (last - first).T)
        ) @ turned[:2, :2].T
        return reaction_of(points, t, step, self._frequency)

    def pendulum(self, state: RobotState) -> float:
        """Return the pendulum's length in excess of its height, due to the legs [m].

        While both feet stand, the legs rotate as the centre of mass moves, with an
        angular momentum of κ m g times its velocity. The centre of pressure then is the
        p of the longer pendulum c'' = ω² (c - p) with ω² = g / (z + κ g).
        """
        rate = self._rate(state, 1.0)[:, _BODY]
        gain = np.array([rate[1, 0], -rate[0, 1]]).mean() / state.centroidal.mass
        return float(max(gain, 0.0))

    def _gain(self, state: RobotState, side: float, yaw: float) -> Array:
        """Return K in the axes of the stance foot, shape (2, 3) [s²]."""
        rate, turned = self._rate(state, side)[:, _FOOT], _turn(yaw)
        gain = np.array([rate[1], -rate[0]]) / (state.centroidal.mass * GRAVITY)
        return np.asarray(turned[:2, :2].T @ gain @ turned)

    def _rate(self, state: RobotState, side: float) -> Array:
        """Return L' for unit accelerations of foot and body, shape (3, 18)."""
        body = state.centroidal
        rows = np.vstack(
            [
                state.frame(self._frames[side]).jacobian,
                state.frame(self._frames[-side]).jacobian,
                body.jacobian,
                state.frame(self._trunk).jacobian[3:],
            ]
        )
        W = self._metric.evaluate(state, self._sample).W
        raised = np.linalg.solve(W, rows.T)
        # Straight legs make rows that depend on each other.
        return np.asarray(
            body.momentum_matrix @ raised @ np.linalg.pinv(rows @ raised, _SINGULAR)
        )


def _times(first: float, last: float) -> tuple[Array, float]:
    """Return the times of samples, and the time between two [s]."""
    return np.linspace(first, last, _SAMPLES), (last - first) / (_SAMPLES - 1)


def _turn(yaw: float) -> Array:
    """Return a rotation about the vertical, shape (3, 3)."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
