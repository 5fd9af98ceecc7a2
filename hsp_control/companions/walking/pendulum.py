"""The linear inverted pendulum and its divergent component of motion, in closed form.

A centre of mass c at a constant height z above the ground, pushed by forces through the
point p of the ground (the virtual repellent point, projected), moves as

    c'' = ω² (c - p),      ω = √(g / z).

With ξ = c + c' / ω, the divergent component of motion (DCM, or capture point), this is
a stable and an unstable half (Takenaka et al. 2009; Pratt et al. 2006):

    c' = ω (ξ - c),        ξ' = ω (ξ - p).

While p moves on a line from a to b during T, with m = (b - a) / (ω T),

    ξ(t) = p(t) + m + (ξ(0) - a - m) exp(ω t)

(Englsberger, Ott and Albu-Schäffer 2015, "Three-dimensional bipedal walking control
based on divergent component of motion", IEEE Trans. Robotics 31). The exponential
grows, so that a plan is computed backwards, from the final rest position of the DCM.
"""

from collections.abc import Sequence
from math import exp, log
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array

GRAVITY = 9.81
"""Gravity [m/s²]."""


_DURATIONS = 201
"""Number of durations of a phase that are compared."""


class DcmPhase(NamedTuple):
    """A time in which the repellent point moves on a line at constant speed.

    Attributes:
        duration: T > 0 [s].
        start: a, where it begins, shape (2,) [m].
        end: b, where it ends, shape (2,) [m].
        lead: Offset of ξ at the start of the phase, because the point deviates from the
        line, and is on it again at the end, shape (2,) [m].
    """

    duration: float
    start: Array
    end: Array
    lead: Array = np.zeros(2)

    def point(self, t: float) -> Array:
        """Return p(t), t in s from the start of the phase; at rest before and after."""
        share = min(max(t / self.duration, 0.0), 1.0)
        return self.start + share * (self.end - self.start)

    def dcm(self, first: Array, t: float, frequency: float) -> Array:
        """Return ξ(t), t [s] since the phase began, without the offset."""
        m = (self.end - self.start) / (frequency * self.duration)
        at = self.start + (t / self.duration) * (self.end - self.start)
        own = first - self.lead
        return np.asarray(at + m + (own - self.start - m) * exp(frequency * t))

    def first_dcm(self, last: Array, frequency: float) -> Array:
        """Return the ξ(0) from which ξ(T) is reached, shape (2,) [m]."""
        m = (self.end - self.start) / (frequency * self.duration)
        decay = exp(-frequency * self.duration)
        return np.asarray(self.start + m + (last - self.end - m) * decay + self.lead)


def dcm_of(position: Array, velocity: Array, frequency: float) -> Array:
    """Return ξ = c + c' / ω of the first two coordinates, shape (2,) [m]."""
    return np.asarray(position[:2] + velocity[:2] / frequency)


def plan_dcm(phases: Sequence[DcmPhase], frequency: float) -> list[Array]:
    """Return ξ at the start of each phase; at the end of the last ξ is p, at rest."""
    last, starts = phases[-1].end, list[Array]()
    for phase in reversed(phases):
        last = phase.first_dcm(last, frequency)
        starts.append(last)
    return starts[::-1]


def in_step(
    phase: DcmPhase,
    last: Array,
    dcm: Array,
    frequency: float,
    bounds: tuple[float, float],
) -> DcmPhase:
    """Return a phase with the duration that fits the DCM at its beginning.

    When a foot lands early or late, the DCM is ahead of or behind its plan, but on its
    path: a duration that is longer or shorter by that time synchronises the plan.
    """
    T = np.linspace(*bounds, _DURATIONS)[:, None]
    m = (phase.end - phase.start) / (frequency * T)
    first = phase.start + m + (last - phase.end - m) * np.exp(-frequency * T)
    away = ((first - dcm) ** 2).sum(axis=1)
    return phase._replace(duration=float(T[int(away.argmin()), 0]))


def error_after(
    error: float, t: float, frequency: float, gain: float, reach: float
) -> float:
    """Return the error of the DCM after a time of feedback bounded by the sole.

    The repellent point is displaced by (1 + k/ω) ε, at most by r. So

        ε' = ω (ε - sat(ε (1 + k/ω))),

    which decays as exp(-k t) while |ε| ≤ r / (1 + k/ω), decreases while |ε| < r, and
    grows beyond: then only a step can help.
    """
    size, sign = abs(error), 1.0 if error >= 0.0 else -1.0
    linear = reach / (1.0 + gain / frequency)
    if size > linear:
        saturated = size + (size - reach) * (exp(frequency * t) - 1.0)
        if size >= reach or saturated >= linear:
            return sign * saturated
        t -= log((reach - linear) / (reach - size)) / frequency
        size = linear
    return sign * size * exp(-gain * t)
