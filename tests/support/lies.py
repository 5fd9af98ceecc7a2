"""False readings of one joint or of all, as functions of the true measurements."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from live_rigs import PERIOD

from hsp_control.common.arrays import Array, Flags
from hsp_control.live import Measurement

Values = tuple[Array, Array]


@dataclass
class Sensors:
    """Input of a fault: all true measurements so far."""

    joints: Flags  # the affected joints, shape (nv,)
    begin: int  # the number of the read at which it begins
    rng: np.random.Generator
    period: float = PERIOD
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)
    first: Measurement | None = None  # the measurement at which it began
    reads: int = 0
    memory: Array | None = None

    def ago(self, seconds: float) -> Values:
        """Return q and v of some time ago, or of the beginning."""
        k = min(round(seconds / self.period), len(self.q) - 1)
        return self.q[-1 - k], self.v[-1 - k]

    @property
    def since(self) -> float:
        """Time since the fault began [s]."""
        return (self.reads - self.begin) * self.period

    def filtered(self, value: Array, frequency: float) -> Array:
        """Return a value after a first-order filter that starts with the fault."""
        before = value if self.memory is None else self.memory
        part = 1.0 - np.exp(-2.0 * np.pi * frequency * self.period)
        self.memory = before + part * (value - before)
        return self.memory

    def __call__(self, found: Measurement, lie: "Lie") -> Measurement:
        """Return a measurement with the fault, once it has begun."""
        self.reads += 1
        self.q.append(found.q)
        self.v.append(found.v)
        if self.reads < self.begin:
            return found
        self.first = self.first or found
        reported = lie(self, found)
        mine = self.joints
        applied = reported.applied
        if applied is not None and found.applied is not None:
            applied = np.where(mine, applied, found.applied)
        return reported._replace(
            q=np.where(mine, reported.q, found.q),
            v=np.where(mine, reported.v, found.v),
            applied=applied,
        )


Lie = Callable[[Sensors, Measurement], Measurement]


def _v(change: Callable[[Sensors, Array], Array]) -> Lie:
    return lambda s, m: m._replace(v=change(s, m.v))


def _q(change: Callable[[Sensors, Array], Array]) -> Lie:
    return lambda s, m: m._replace(q=change(s, m.q))


def _both(change: Callable[[Sensors], Values]) -> Lie:
    return lambda s, m: m._replace(**dict(zip("qv", change(s), strict=True)))


def begun(sensors: Sensors) -> Measurement:
    """Return the measurement at which a fault began."""
    assert sensors.first is not None
    return sensors.first


def _t(change: Callable[[Sensors, float], float]) -> Lie:
    return lambda s, m: m._replace(t=change(s, m.t))


def _applied(change: Callable[[Sensors, Array], Array]) -> Lie:
    def lie(sensors: Sensors, found: Measurement) -> Measurement:
        if found.applied is None:
            return found
        return found._replace(applied=change(sensors, found.applied))

    return lie


VELOCITY: dict[str, Lie] = {
    "+3": _v(lambda s, v: v + 3.0),
    "-3": _v(lambda s, v: v - 3.0),
    "+2": _v(lambda s, v: v + 2.0),
    "-2": _v(lambda s, v: v - 2.0),
    "+1": _v(lambda s, v: v + 1.0),
    "+0.5": _v(lambda s, v: v + 0.5),
    "+0.25": _v(lambda s, v: v + 0.25),
    "-0.1": _v(lambda s, v: v - 0.1),
    "the sign": _v(lambda s, v: -v),
    "degrees": _v(lambda s, v: np.rad2deg(v)),
    "turns": _v(lambda s, v: v / (2.0 * np.pi)),
    "rpm": _v(lambda s, v: v * 9.549),
    "twice": _v(lambda s, v: 2.0 * v),
    "half": _v(lambda s, v: 0.5 * v),
    "a third more": _v(lambda s, v: 1.33 * v),
    "-3 times": _v(lambda s, v: -3.0 * v),
    "none": _v(lambda s, v: 0.0 * v),
    "stuck": _v(lambda s, v: begun(s).v),
    "stuck at 1": _v(lambda s, v: np.ones_like(v)),
    "another joint's": _v(lambda s, v: np.roll(v, 1)),
    "the next joint's": _v(lambda s, v: np.roll(v, -1)),
    "reversed order": _v(lambda s, v: v[::-1]),
    "the effort's": _v(lambda s, v: 0.02 * s.reads * np.ones_like(v)),
    "delayed by 50 ms": _v(lambda s, v: s.ago(0.05)[1]),
    "delayed by 200 ms": _v(lambda s, v: s.ago(0.2)[1]),
    "a filter of 1 Hz": _v(lambda s, v: s.filtered(v, 1.0)),
    "drifting": _v(lambda s, v: v + 2.0 * s.since),
    "drifting slowly": _v(lambda s, v: v - 0.5 * s.since),
    "swinging": _v(lambda s, v: v + np.sin(30.0 * s.since)),
    "swinging fast": _v(lambda s, v: v + 2.0 * np.sin(300.0 * s.since)),
    "noise": _v(lambda s, v: v + s.rng.normal(0.0, 1.0, v.size)),
    "every second": _v(lambda s, v: v + 3.0 * (s.reads % 2)),
    "every third": _v(lambda s, v: v - 3.0 * (s.reads % 3 == 0)),
    "saturated": _v(lambda s, v: np.clip(v, -0.05, 0.05)),
    "at its limit": _v(lambda s, v: np.full_like(v, 2.1)),
    "coarse": _v(lambda s, v: np.round(v / 0.8) * 0.8),
    "its size": _v(lambda s, v: np.abs(v)),
    "minus its size": _v(lambda s, v: -np.abs(v) - 0.4),
}
POSITION: dict[str, Lie] = {
    "+0.1": _q(lambda s, q: q + 0.1),
    "+0.015": _q(lambda s, q: q + 0.015),
    "-0.015": _q(lambda s, q: q - 0.015),
    "stuck": _q(lambda s, q: begun(s).q),
    "the sign": _q(lambda s, q: -q),
    "a tenth more": _q(lambda s, q: 1.1 * q),
    "one hundredth more": _q(lambda s, q: 1.01 * q),
    "drifting": _q(lambda s, q: q + 1.0 * s.since),
    "drifting slowly": _q(lambda s, q: q - 0.4 * s.since),
    "another joint's": _q(lambda s, q: np.roll(q, 1)),
    "delayed by 50 ms": _q(lambda s, q: s.ago(0.05)[0]),
    "swinging": _q(lambda s, q: q + 0.018 * np.sin(50.0 * s.since)),
    "noise": _q(lambda s, q: q + s.rng.normal(0.0, 0.004, q.size)),
    "coarse": _q(lambda s, q: np.round(q / 0.02) * 0.02),
}
BOTH: dict[str, Lie] = {
    "stands": _both(lambda s: (begun(s).q, 0.0 * begun(s).v)),
    "frozen": _both(lambda s: (begun(s).q, begun(s).v)),
    "+1 and +0.1": _both(lambda s: (s.q[-1] + 0.1, s.v[-1] + 1.0)),
    "other joints'": _both(lambda s: (np.roll(s.q[-1], 1), np.roll(s.v[-1], 1))),
    "contrary": _both(lambda s: (s.q[-1] + 0.5 * s.since, s.v[-1] - 0.5)),
    "stuck, with +1": _both(lambda s: (begun(s).q, s.v[-1] + 1.0)),
    "mirrored": _both(lambda s: (2.0 * begun(s).q - s.q[-1], s.v[-1])),
}
EFFORT: dict[str, Lie] = {
    "+60": _applied(lambda s, tau: tau + 60.0),
    "-8": _applied(lambda s, tau: tau - 8.0),
    "the sign": _applied(lambda s, tau: -tau),
    "none": _applied(lambda s, tau: 0.0 * tau),
    "another joint's": _applied(lambda s, tau: np.roll(tau, 1)),
    "noise": _applied(lambda s, tau: tau + s.rng.normal(0.0, 20.0, tau.size)),
    "at its limit": _applied(lambda s, tau: np.full_like(tau, 87.0)),
}
TIME: dict[str, Lie] = {
    "+1": _t(lambda s, t: t + 1.0),
    "+0.01": _t(lambda s, t: t + 0.01),
    "twice as fast": _t(lambda s, t: t + s.since),
    "half as fast": _t(lambda s, t: t - 0.5 * s.since),
    "stands": _t(lambda s, t: begun(s).t),
    "backwards": _t(lambda s, t: 2.0 * begun(s).t - t),
    "jitter": _t(lambda s, t: t + s.rng.uniform(-0.005, 0.005)),
    "in milliseconds": _t(lambda s, t: 1000.0 * t),
}
LIES: dict[str, Lie] = {
    f"{signal}: {name}": lie
    for signal, lies in (
        ("velocity", VELOCITY),
        ("position", POSITION),
        ("both", BOTH),
        ("effort", EFFORT),
        ("time", TIME),
    )
    for name, lie in lies.items()
}


def is_seen_at_rest(lie: Lie) -> bool:
    """Return whether a fault changes the measurements of an arm at rest."""
    sensors = Sensors(np.ones(7, dtype=bool), 2, np.random.default_rng(0))
    q, tau = 0.1 * np.arange(7), np.arange(7.0)
    for k in range(4):
        true = Measurement(k, k * PERIOD, q, np.zeros(7), applied=tau)
        reported = sensors(true, lie)
        names = ("t", "q", "v", "applied")
        if any(np.any(getattr(reported, n) != getattr(true, n)) for n in names):
            return True
    return False


THE_SIGN: Lie = _both(lambda s: (2.0 * begun(s).q - s.q[-1], -s.v[-1]))
"""Position and velocity are consistent with each other, but not with the efforts."""
