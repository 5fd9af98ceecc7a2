"""The trusted part of a joint's measured motion: velocity, positions, or neither."""

from math import inf

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.control.measurement import Measurement
from hsp_control.engine import Dynamics
from hsp_control.live.expected_motion import ExpectedMotion
from hsp_control.live.fault_isolation import FaultIsolation
from hsp_control.live.momentum_check import Driving, MomentumCheck, smaller
from hsp_control.live.response_check import ResponseCheck
from hsp_control.live.settings import LiveSettings
from hsp_control.live.still_sensors import StillSensors
from hsp_control.live.velocity_check import VelocityCheck
from hsp_control.robot import Robot

_LEAP = 0.03
"""Change of a velocity that is none, besides twice the largest recent surprise [rad/s
or m/s]."""
_SPREAD = 0.25
"""Tolerance of a joint's velocity, relative to the expected one."""
_LAST = 20
"""Number of periods of the safe stop after the sensor of a joint at rest has died."""
_SMALL = 2.0
"""Maximum contradiction due to the lag, relative to the error of velocities."""
_MOVES = 0.2
"""Expected speed above which a joint's reading cannot stay the same to the last bit
[rad/s or m/s]: encoders of 1e-4 rad change in each 0.5 ms."""
_EFFORT = {"rad": "N·m", "m": "N"}


class TrustedMotion:
    """Checks measured positions and velocities, and selects those to use.

    If they contradict each other, the one that deviates from the model's expectation is
    wrong (`FaultIsolation`). If that is not clear, both are wrong if they differ much,
    otherwise the velocity. If both are wrong, or the sensor is dead, the expectation is
    used. A source that was wrong is not used again.

    If both agree and are wrong, the efforts reveal it: a joint whose readings do not
    change though it is pushed (`StillSensors`), one that moves against its effort
    (`ResponseCheck`), one with an unexplained change of momentum (`MomentumCheck`), and
    in the safe stop one that is braked and accelerates. Then no effort of the loop
    helps, and the robot must stop itself.

    A joint that is pushed hard has hit something, or is measured wrong. Until the loop
    falls silent it is braked by the smaller of its measured and its expected velocity,
    or not at all if they have different signs: in either case it does not accelerate.

    Attributes:
        fault: The contradiction, or None.
        doubtful: Whether the last measurement should not be used, though it is not a
        fault yet.
        dead: Joints whose sensors have died, shape (nv,).
        complete: Whether all measurements are trusted.
        stopping: Whether the joints are braked.
        unknown_for: Time for which some joint was only expected, not measured [s].
        last: The last measurement, as it came; None before the first.
    """

    def __init__(
        self,
        robot: Robot,
        settings: LiveSettings,
        period: float,
        dynamics: Dynamics | None = None,
    ) -> None:
        """``dynamics``: those of a robot that carries something."""
        self._robot, self._error = robot, settings.velocity_error
        self._dynamics = dynamics = dynamics or robot.dynamics()
        self._check = VelocityCheck(robot, settings, period)
        self._expected = ExpectedMotion(robot, self._error, period, dynamics)
        limits = settings.effort_limits(robot)
        self._sensors = StillSensors(robot, settings, limits, period)
        self._momentum = MomentumCheck(robot, settings, limits, period)
        # The forces at the feet of a robot with a floating base are unknown.
        self._judged = np.full(robot.nv, not robot.unactuated)
        self._response = ResponseCheck(settings.velocity_error, self._judged)
        self._soon = max(settings.prediction_time - _LAST * period, 0.0)
        self.restart()

    def restart(self) -> None:
        """Trust everything."""
        self._check.restart()
        self._sensors.restart()
        self._response.restart()
        self._momentum.restart()
        self._contrary = np.zeros(self._robot.nv, dtype=bool)
        self._isolation = FaultIsolation(self._robot.nv)
        self.dead: Flags = np.zeros(self._robot.nv, dtype=bool)
        self._pushed = np.zeros(self._robot.nv, dtype=bool)
        self.last: Measurement | None = None
        self._q: Array = np.zeros(0)  # the last trusted configuration
        self.complete = True
        self._useless = False  # whether joints do not follow their efforts
        self.stopping = False  # whether the joints are braked
        self._driving: Driving | None = None
        self._moving = False  # whether the robot's clock has begun
        self._positions = np.ones(self._robot.nv, dtype=bool)
        self._velocities = np.ones(self._robot.nv, dtype=bool)
        self.fault: str | None = None
        self.doubtful = False
        self.unknown_for = 0.0

    @property
    def mean_velocity(self) -> Array | None:
        """Mean velocity of some milliseconds, (nv,); None if it is not trusted.

        It is measured, or the slope of the positions where that is less: the noise of
        a velocity is no motion.
        """
        if not (self._moving and self.complete):
            return None
        mean, slope = self._check.mean, self._check.slope
        return np.where(np.abs(slope) < np.abs(mean), slope, mean)

    @property
    def ambiguous(self) -> bool:
        """Whether it is undecided if a joint was pushed hard or is measured wrong."""
        return bool(self._pushed.any())

    @property
    def silent(self) -> Flags:
        """Joints whose trusted readings did not change by a bit, shape (nv,)."""
        return self._check.stands

    @property
    def trusted_positions(self) -> Flags:
        """Joints whose positions are trusted, shape (nv,)."""
        return self._positions

    @property
    def _known_acceleration(self) -> Array:
        """The expected acceleration with the load if it is one, shape (nv,).

        Before a stop, what holds a joint is no load: its sensor may be dead.
        """
        expected = self._expected
        return expected.loaded if self.stopping else expected.acceleration

    def stop(self) -> None:
        """Begin braking: a joint that accelerates now has a wrong sensor or motor."""
        self.stopping = True

    def applied(
        self, q: Array, v: Array, tau: Array, load: Array, inertia: Array | None = None
    ) -> None:
        """Record the effort that acts from now on, shape (nv,), at a state.

        ``load`` is the external effort on the joints, shape (nv,); ``inertia`` the mass
        matrix, shape (nv, nv); None: it is computed.
        """
        self._expected.apply(q, v, tau, load)
        robot, dynamics = self._robot, self._dynamics
        known = load if self.stopping else np.zeros_like(load)
        if self.complete and self._moving:
            self._sensors.judge(q, v, tau + known, dynamics)
        if robot.unactuated:
            return
        if inertia is None:
            inertia = robot.mass_matrix(q, dynamics)
        effort = inertia @ self._known_acceleration
        gravity = robot.inverse_dynamics(q, 0.0 * v, 0.0 * v, dynamics)
        self._driving = Driving(inertia, effort, gravity)

    def update(self, new: Measurement, passed: float, jumps: Flags) -> Measurement:
        """Return a measurement with its trusted part; set the fault.

        Args:
            new: A valid measurement.
            passed: Time since the last one [s]; 0: the robot has not started.
            jumps: Joints whose position the robot cannot have reached, shape (nv,).
        """
        last, self.last = self.last, new
        self.fault, self.doubtful = None, False
        if last is None or passed <= 0.0:
            if self.complete:
                self._expected.begin(new.v)
                self._q = new.q
            return new
        check, expected = self._check, self._expected
        way = self._robot.difference(last.q, new.q)
        if not self._moving:  # a robot starts at rest
            self._moving = True
            expected.begin(smaller(way / passed, new.v))
        expected.advance(passed)
        acceleration = self._known_acceleration
        check.update(way, new.v, passed, acceleration)
        self._sensors.update(way, new.v, check.mean, passed)
        if self.complete:
            self._response.update(acceleration, check.mean, passed)
            if (driving := self._driving) is not None:
                now = np.stack([new.v, way / passed])
                means = np.stack([check.mean, check.slope])
                self._momentum.update(now, means, driving, passed)
        trusted = np.stack([self._velocities, self._positions])
        measured = np.stack([check.mean, check.slope])
        expected.follow(measured, trusted, passed, braked=self.stopping)
        self._judge(new.v, jumps)
        if self.complete:
            self.doubtful = bool(check.doubtful.any())
            self._q = new.q
            return new
        self._leave(new.v, trusted)
        all_known = (self._velocities | self._positions).all()
        self.unknown_for = 0.0 if all_known else self.unknown_for + passed
        if (self._sensors.dead | self._pushed).any():  # its speed is unknown
            self.unknown_for = max(self.unknown_for, self._soon)
        unknown = ~(self._positions | self._velocities)
        # If one joint's sensors are dead, another one that rests although it should
        # move may be dead, too.
        stands = check.stands & (np.abs(expected.v[2]) > _MOVES)
        if self._useless or (unknown.any() and stands.any()):
            self.unknown_for = inf
        both = self._positions & self._velocities
        self.doubtful = self.fault is None and bool((check.doubtful & both).any())
        v = np.where(self._positions, check.slope, expected.v[2])
        v = np.where(self._velocities, new.v, v)
        v = np.where(both, self._alike(new.v), v)
        v = np.where(self._pushed, smaller(new.v, v), v)
        way = self._robot.difference(self._q, new.q)
        way = np.where(self._positions, way, passed * v)
        self._q = self._robot.integrate(self._q, way)
        return new._replace(q=self._q, v=v)

    def _alike(self, v: Array) -> Array:
        """Return the velocities of joints of which no source was found wrong, (nv,).

        The cause of wrong velocities may act on all joints, and its effect be too small
        to be found in these; the same holds for positions.
        """
        slope = self._check.slope
        if not (self._positions & ~self._velocities).any():
            return v
        if not (self._velocities & ~self._positions).any():
            return slope
        return smaller(v, slope)

    def _leave(self, v: Array, before: Flags) -> None:
        """Expect the motion of joints with fewer trusted sources, shape (2, nv).

        A sensor that has died reports the velocity of that time.
        """
        expected, sensors = self._expected, self._sensors
        trusted = np.stack([self._velocities, self._positions])
        expected.leave((before & ~trusted).any(axis=0), trusted)
        died = self._check.stands & before.all(axis=0) & ~trusted.any(axis=0)
        self.dead |= died
        followed = expected.before[0]
        reported = np.where(sensors.dead, v + sensors.gained, followed)
        stopped = np.copysign(self._check.before, followed)
        reported = np.where(self._check.dead, stopped, reported)
        expected.v[2] = np.where(died, reported, expected.v[2])

    def _judge(self, v: Array, jumps: Flags) -> None:
        """Find the wrong sources, and those not trusted from now on."""
        check = self._check
        dead = check.dead | self._sensors.dead
        contrary = self._response.contrary
        # Motion hidden by a dead sensor appears as a push on the other joints, too.
        pushed = self._momentum.beyond & ~check.halted.any()
        wrong = check.contradicted | jumps
        runs = self._left(v) if self.stopping else np.zeros(v.size, dtype=bool)
        if self.complete and not (wrong | dead | contrary | pushed | runs).any():
            return
        both = self._positions & self._velocities
        wrong &= both
        lost = dead | self._isolate(wrong, jumps, v)
        lost &= self._positions | self._velocities
        if self.complete:
            self._contrary |= contrary & both
            self._pushed |= pushed & both & ~(wrong | dead)
            lost |= (contrary | pushed) & both
        lost |= runs | self._left(v) & (self._positions ^ self._velocities)
        # If a joint moves against its efforts they are harmful: only the robot can
        # brake.
        self._useless |= bool(runs.any() or self._contrary.any())
        self._positions &= ~lost
        self._velocities &= ~lost
        self._check.trust(self._positions, self._velocities)
        self.complete = bool(self._positions.all() and self._velocities.all())
        if (wrong | lost).any():
            i = int(np.flatnonzero(wrong | lost)[0])
            self.fault = self._described(i, v, runs=bool(runs[i]))

    def _isolate(self, wrong: Flags, jumps: Flags, v: Array) -> Flags:
        """Trust the right sources of joints of which one is wrong, shape (nv,).

        Returns the joints of which no source can be right, shape (nv,).
        """
        check, expected, isolation = self._check, self._expected, self._isolation
        slight = check.difference < self._error
        right_v, right_q = isolation.isolate(
            wrong & ~jumps,
            expected.surprise[:2],
            check.constant,
            slight,
            np.stack([self._velocities, self._positions]),
        )
        decided = isolation.undecided & (right_v ^ right_q)
        expected.begin_again(decided, np.where(right_v, v, check.slope))
        small = check.difference < _SMALL * self._error
        frozen = wrong & ~right_q & (check.stands | (check.unmoved & ~right_v))
        right_q |= wrong & ~right_v & small
        right_q &= ~jumps
        # Where velocities jump as well as positions, neither of the joint is right; in
        # several joints, the whole message is wrong.
        leaps = np.abs(v - expected.before[0])
        leaps -= np.minimum(_LEAP + 2.0 * expected.usual[0], 0.5 * self._error)
        smooth = bool((leaps[jumps] < 0.0).all())
        right_v = np.where(jumps, smooth, right_v)
        if not smooth and jumps.sum() > 1:
            frozen[:] = True
        self._positions = np.where(wrong | decided, right_q, self._positions)
        self._velocities = np.where(wrong | decided, right_v, self._velocities)
        undecided = wrong & ~(right_v | right_q | frozen | jumps)
        isolation.undecided = (isolation.undecided & ~decided) | undecided
        return frozen

    def _left(self, v: Array) -> Flags:
        """Return the joints that deviate from the expectation by a trusted source.

        A joint that is slower than expected may be braked by its friction; a wrong
        sensor drives it, so that it is faster, or moves in the other direction.
        """
        slope, by_v, by_q = self._check.slope, self._expected.v[0], self._expected.v[1]
        # Of a velocity, less the largest effect of noise.
        used = np.where(self._velocities, smaller(v, self._check.mean), slope)
        expected = np.where(self._velocities, by_v, by_q)
        least, most = np.minimum(expected, 0.0), np.maximum(expected, 0.0)
        beyond = np.maximum(used - most, least - used)
        allowed = self._error + _SPREAD * np.abs(self._expected.v[2])
        left: Flags = (beyond > allowed) & self._judged
        left &= self._positions | self._velocities
        return left

    def _described(self, i: int, v: Array, *, runs: bool) -> str:
        name, unit = self._robot.dof_names[i], self._robot.units[i]
        if self._check.dead[i]:
            return (
                f"{name} does not move from one state to the next, where the model "
                f"expects {self._expected.v[2, i]:.3g} {unit}/s: its sensor is dead"
            )
        if self._sensors.dead[i]:
            return (
                f"the state of {name} stays the same to the last bit: "
                f"{self._sensors.why(i)}"
            )
        if self._contrary[i]:
            return (
                f"{name} moves against its effort: its sensor or its motor has the "
                "wrong sign"
            )
        if self._pushed[i]:
            return (
                f"{name} is pushed by {self._momentum.rest[i]:.3g} {_EFFORT[unit]} "
                "beside its effort: it has hit something hard, or its sensors are "
                "wrong"
            )
        if runs:
            return (
                f"{name} is braked, and moves at {v[i]:.3g} {unit}/s where "
                f"{self._expected.v[2, i]:.3g} {unit}/s are expected: its motor does "
                "not follow the efforts"
            )
        return (
            f"the velocity of {name} contradicts its positions: {v[i]:.3g} {unit}/s "
            f"are measured, and its positions change by {self._check.slope[i]:.3g} "
            f"{unit}/s"
        )
