"""The pose and the velocity of a floating base, from on-board measurements."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import EstimationError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.walking.estimation.invariant_filter import (
    ACCELEROMETER,
    FIXED,
    GYROSCOPE,
    POSITION,
    ROTATION,
    VELOCITY,
    Densities,
    InvariantFilter,
    skew,
)
from hsp_control.companions.walking.estimation.leg_kinematics import (
    LegKinematics,
    Seen,
    rolled,
)
from hsp_control.constraints.contacts import Contact
from hsp_control.control.interface import (
    Controller,
    Estimator,
    Inertial,
    LogChannel,
    Measurement,
    RunningEstimator,
)
from hsp_control.declaration.quantities import Names, NonNegative, Positive
from hsp_control.engine.rotations import (
    log3,
    quaternion_from_rotation,
    rotation_from_quaternion,
)


class BaseEstimator(Estimator, type="base"):
    """The base is estimated from an inertial measurement unit and the legs' joints.

    By the contact-aided invariant extended Kalman filter
    (`estimation/invariant_filter.py`). A contact is used while it is loaded; one
    without a measured force while it is fully active.

    It starts from the first measured pose. Heading and position drift from there: they
    are not observable on board. The noise is that of a small industrial unit, the
    ADIS16448, as in the EuRoC data set (Burri et al. 2016, Int. J. Robotics Research).
    """

    stage: ClassVar[float] = 10.0

    gyroscope_noise: Positive = 1.7e-4
    """Density of the gyroscope's white noise [rad/s/√Hz]."""
    accelerometer_noise: Positive = 2.0e-3
    """Density of the accelerometer's white noise [m/s²/√Hz]."""
    gyroscope_walk: Positive = 2.0e-5
    """Density of the rate of the gyroscope's bias [rad/s²/√Hz]."""
    accelerometer_walk: Positive = 3.0e-3
    """Density of the rate of the accelerometer's bias [m/s³/√Hz]."""
    slip: Positive = 5.0e-3
    """Density of the velocity with which a point of contact slips [m/s/√Hz]."""
    joint_noise: NonNegative = 1.0e-4
    """Standard deviation of the joints' measured positions [rad or m]."""
    leg_noise: Positive = 1.0e-3
    """Further uncertainty of a point of contact: the links bend, and the ground
    is soft [m]."""
    contacts: Names | None = None
    """Names of the contacts that do not move while they are loaded [-]; by default all
    that do not slide."""
    contact_force: Positive = 0.1
    """Normal force from which a contact is used, in robot weights [-]."""
    start_tilt: NonNegative = 0.02
    """Initial standard deviation of the tilt [rad]."""
    start_velocity: NonNegative = 0.05
    """Initial standard deviation of the velocity [m/s]."""
    start_gyroscope_bias: NonNegative = 3.0e-3
    """Initial standard deviation of the gyroscope's bias [rad/s]."""
    start_accelerometer_bias: NonNegative = 0.05
    """Initial standard deviation of the accelerometer's bias [m/s²]."""

    def begin(
        self, controller: Controller, inertial: Inertial | None
    ) -> "RunningBaseEstimator":
        """Return the estimator of a run; see `Estimator.begin`."""
        if inertial is None:
            raise EstimationError(
                "no inertial measurement unit is there; add one to the plant, for "
                "example plant.sensors: {imu: base_link}"
            )
        return RunningBaseEstimator(self, controller, inertial.frame)


class RunningBaseEstimator(RunningEstimator):
    """A `BaseEstimator` in one run.

    Attributes:
        filter: The filter; None before the first measurement.
    """

    def __init__(
        self, estimator: BaseEstimator, controller: Controller, frame: str
    ) -> None:
        """Set the estimator; see `BaseEstimator.begin`.

        Args:
            estimator: The estimator.
            controller: The controller, whose contacts carry the robot.
            frame: The frame of the inertial measurement unit.

        Raises:
            EstimationError: If the robot has no floating base, or no such contacts.
        """
        robot = controller.robot
        if robot.unactuated != tuple(range(6)):
            raise EstimationError(
                f"{robot.name} has no free-flyer root at its beginning: "
                "there is no floating base to estimate; remove the estimator"
            )
        if not controller.contacts:
            raise EstimationError(
                "there are no contacts, from which the legs' kinematics could locate "
                "the base; declare contacts, or remove the estimator"
            )
        there = {each.name: each for each in controller.contacts}
        still = [name for name, each in there.items() if not each.slides]
        names = estimator.contacts or tuple(still)
        for name in names:
            if name not in there:
                raise EstimationError(
                    f"contacts: there is no contact {name!r}"
                    f"{did_you_mean(name, there)} (there are {listing(there)})"
                )
        self.filter: InvariantFilter | None = None
        self._estimator, self._robot = estimator, robot
        self._contacts = {name: there[name] for name in names}
        self._legs = LegKinematics(robot, frame, tuple(self._contacts.values()))
        weight = sum(inertia.mass for inertia in robot.model.inertias)
        self._gravity: Array = robot.model.gravity.linear.copy()
        self._touch = (
            estimator.contact_force * weight * float(np.linalg.norm(self._gravity))
        )
        self._t = 0.0
        self._q, self._v = robot.neutral(), np.zeros(robot.nv)

    def update(self, measured: Measurement) -> Measurement:
        """Return a measurement whose base is estimated.

        Args:
            measured: The measurement; only its first base pose is used.

        Raises:
            EstimationError: If the unit reported nothing.
        """
        inertial = measured.inertial
        if inertial is None:
            raise EstimationError(
                f"at t = {measured.t:.3f} s the inertial measurement unit reported "
                "nothing"
            )
        self._legs.update(measured.q, measured.v)
        if self.filter is None:
            self.filter = self._started(self._legs, measured)
            bias = np.zeros(3)
        else:
            h = measured.t - self._t
            bias = self.filter.gyroscope_bias
            if h > 0.0:
                self.filter.predict(*inertial[1:], h)
        self._correct(self.filter, self._legs, measured, inertial)
        self._q, self._v = self._with_base(self.filter, self._legs, measured, bias)
        self._t = measured.t
        return measured._replace(q=self._q, v=self._v)

    def log_channels(self, q: Array, v: Array) -> Mapping[str, LogChannel]:
        """Return the last estimate and its errors; see `RunningEstimator`."""
        assert self.filter is not None
        P = self.filter.covariance
        R, R_true = _rotation(self._q), _rotation(q)
        turn = log3(R @ R_true.T)
        return {
            "estimate.base": LogChannel(self._q[:7], "m and -", "position, quaternion"),
            "estimate.twist": LogChannel(
                self._v[:6], "m/s and rad/s", "of the base, in its axes"
            ),
            "estimate.position_error": LogChannel(
                self._q[:3] - q[:3], "m", "estimated minus true"
            ),
            "estimate.rotation_error": LogChannel(
                turn, "rad", "from the true to the estimated one, world axes"
            ),
            "estimate.velocity_error": LogChannel(
                R @ self._v[:3] - R_true @ v[:3], "m/s", "estimated minus true, world"
            ),
            "estimate.tilt_deviation": LogChannel(
                np.sqrt(np.diag(P)[ROTATION][:2]),
                "rad",
                "standard deviation by the filter",
            ),
            "estimate.velocity_deviation": LogChannel(
                np.sqrt(np.diag(P)[VELOCITY]), "m/s", "standard deviation by the filter"
            ),
            "estimate.gyroscope_bias": LogChannel(
                self.filter.gyroscope_bias, "rad/s", "estimated"
            ),
            "estimate.accelerometer_bias": LogChannel(
                self.filter.accelerometer_bias, "m/s²", "estimated"
            ),
            "estimate.contacts": LogChannel(
                float(len({name for name, _ in self.filter.names})),
                "-",
                "contacts that count",
            ),
        }

    # -- the filter -------------------------------------------------------------------

    def _started(self, legs: LegKinematics, measured: Measurement) -> InvariantFilter:
        """Return a filter that starts from the measured base."""
        own, (R_unit, p_unit, twist) = self._estimator, legs.unit
        R, q, v = _rotation(measured.q), measured.q, measured.v
        velocity = R @ (v[:3] + np.cross(v[3:6], p_unit) + twist[:3])
        position = q[:3] + R @ p_unit
        P = np.zeros((FIXED, FIXED))
        upright = np.array([1.0, 1.0, 0.0])  # the heading is given
        P[ROTATION, ROTATION] = own.start_tilt**2 * np.diag(upright)
        P[VELOCITY, VELOCITY] = own.start_velocity**2 * np.eye(3)
        P[GYROSCOPE, GYROSCOPE] = own.start_gyroscope_bias**2 * np.eye(3)
        P[ACCELEROMETER, ACCELEROMETER] = own.start_accelerometer_bias**2 * np.eye(3)
        # Errors of the group are rotations about the world's origin.
        T = np.eye(FIXED)
        T[VELOCITY, ROTATION], T[POSITION, ROTATION] = skew(velocity), skew(position)
        densities = Densities(
            own.gyroscope_noise,
            own.accelerometer_noise,
            own.gyroscope_walk,
            own.accelerometer_walk,
            own.slip,
        )
        P = T @ P @ T.T
        return InvariantFilter(
            R @ R_unit, velocity, position, P, densities, self._gravity
        )

    def _correct(
        self,
        estimate: InvariantFilter,
        legs: LegKinematics,
        measured: Measurement,
        inertial: Inertial,
    ) -> None:
        """Update the filter with the stance contacts."""
        standing = [each for each in legs.contacts if self._stands(each, measured)]
        names = {each.name for each in standing}
        gone = [key for key in estimate.names if key[0] not in names]
        if gone:
            estimate.drop(gone)
        known = dict.fromkeys(name for name, _ in estimate.names)
        if known:
            seen = [legs.seen(self._contacts[name]) for name in known]
            omega = inertial.angular_velocity - estimate.gyroscope_bias
            ways = [
                rolled(
                    self._contacts[name],
                    estimate.rotation @ (omega + each.turning),
                    measured.t - self._t,
                )
                for name, each in zip(known, seen, strict=True)
            ]
            counts = [len(each.points) for each in seen]
            estimate.move(np.repeat(ways, counts, axis=0))
            estimate.correct(
                np.vstack([each.points for each in seen]), self._noise(seen)
            )
        for contact in standing:
            if contact.name not in known:
                new = legs.seen(contact)
                keys = [(contact.name, k) for k in range(len(new.points))]
                estimate.add(keys, new.points, self._noise([new]))

    def _stands(self, contact: Contact, measured: Measurement) -> bool:
        force = measured.normal_force(contact.frame, contact.axes[:, 2])
        if force is None:
            return bool(contact.weight(measured.t) >= 1.0)
        return bool(force > self._touch)

    def _noise(self, seen: list[Seen]) -> Array:
        """Return the covariance of the legs' measurements, in the unit's axes [m²]."""
        J = np.vstack([each.jacobian for each in seen])
        noise = self._estimator.joint_noise**2 * J @ J.T
        noise.ravel()[:: len(noise) + 1] += self._estimator.leg_noise**2
        return np.asarray(noise)

    def _with_base(
        self,
        estimate: InvariantFilter,
        legs: LegKinematics,
        measured: Measurement,
        bias: Array,
    ) -> tuple[Array, Array]:
        """Return configuration and velocity with the estimated base."""
        inertial = measured.inertial
        assert inertial is not None
        R_unit, p_unit, twist = legs.unit
        R = estimate.rotation @ R_unit.T
        omega = R_unit @ (inertial.angular_velocity - bias) - twist[3:]
        q, v = measured.q.copy(), measured.v.copy()
        q[:3] = estimate.position - R @ p_unit
        quaternion = quaternion_from_rotation(R)
        q[3:7] = quaternion / np.linalg.norm(quaternion)
        v[:3] = R.T @ estimate.velocity - np.cross(omega, p_unit) - twist[:3]
        v[3:6] = omega
        return q, v


def _rotation(q: Array) -> Array:
    """Return the rotation of the base, shape (3, 3)."""
    return rotation_from_quaternion(q[3:7])
