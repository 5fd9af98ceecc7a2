"""Forces of contacts without sensors, from the efforts that the model does not explain.

The generalized momentum observer (De Luca and Mattone, ICRA 2003;
`control/compensation/momentum_observer.py`) estimates r, a low-pass of all external
efforts Σ J_cᵀ w_c. The wrenches are the least-squares solution of that, with M⁻¹ as the
weight, as for constraint forces: J M⁻¹ Jᵀ w = J M⁻¹ r.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import EstimationError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.interface import (
    Controller,
    Estimator,
    Inertial,
    LogChannel,
    Measurement,
    RunningEstimator,
    RunningObserver,
)
from hsp_control.declaration.quantities import Flag, Positive
from hsp_control.robot import RobotState

_SMALLEST = 1e-9
"""Eigenvalues below this share of the largest belong to unobservable wrenches."""


class ContactForces(Estimator, type="contact_forces"):
    """Wrenches of contacts without sensors are estimated.

    Joint friction, payloads and pushes elsewhere appear as forces of contacts. A wrench
    without an effect on motion (stretched legs) is estimated as zero.
    """

    stage: ClassVar[float] = 20.0

    bandwidth: Positive = 100.0
    """Rate at which the estimate converges [1/s]."""
    instead: Flag = False
    """Whether measured wrenches are replaced, too [-]; by default only missing ones are
    estimated."""

    def begin(
        self, controller: Controller, inertial: Inertial | None
    ) -> "RunningContactForces":
        """Return the estimator of a run; see `Estimator.begin`."""
        return RunningContactForces(self, controller)


class RunningContactForces(RunningEstimator):
    """A `ContactForces` in one run.

    Attributes:
        wrenches: The estimates, by the name of the frame; see `Measurement.wrenches`.
    """

    def __init__(self, estimator: ContactForces, controller: Controller) -> None:
        """Begin with zeros.

        Raises:
            EstimationError: If there are no contacts.
        """
        if not controller.contacts:
            raise EstimationError(
                "there are no contacts whose forces could be estimated; declare "
                "contacts, or remove the estimator"
            )
        robot = controller.robot
        self._contacts = tuple(controller.contacts)
        self._instead = estimator.instead
        self._momentum = RunningObserver(estimator.bandwidth, np.zeros(robot.nv))
        self._state = RobotState(robot)
        self._t = 0.0
        self.wrenches = {each.frame: np.zeros(6) for each in self._contacts}

    def update(self, measured: Measurement) -> Measurement:
        """Return a measurement with the wrenches that were missing."""
        state = self._state.update(measured.t, measured.q, measured.v)
        applied = np.zeros(len(state.v)) if measured.applied is None else (
            measured.applied
        )  # fmt: skip
        period = measured.t - self._t
        effort = self._momentum.update(state, applied, period if period > 0 else 1.0)
        self._t = measured.t
        self._solve(state, effort)
        missing = {
            frame: wrench
            for frame, wrench in self.wrenches.items()
            if self._instead or frame not in measured.wrenches
        }
        return measured._replace(
            wrenches={**measured.wrenches, **missing},
            estimated=measured.estimated | frozenset(missing),
        )

    def log_channels(self, q: Array, v: Array) -> Mapping[str, LogChannel]:
        """Return the estimated forces and moments; see `RunningEstimator`."""
        channels: dict[str, LogChannel] = {}
        for frame, wrench in self.wrenches.items():
            prefix = f"estimate.contact.{frame}"
            channels[f"{prefix}.force"] = LogChannel(
                wrench[:3], "N", "of the world on the robot, world axes, estimated"
            )
            channels[f"{prefix}.moment"] = LogChannel(
                wrench[3:], "N·m", "about the frame's origin, estimated"
            )
        return channels

    def _solve(self, state: RobotState, effort: Array) -> None:
        """Distribute an external effort among the contacts."""
        rows = [_rows(each, state) for each in self._contacts]
        J = np.vstack(rows)
        response = np.linalg.solve(state.mass_matrix, J.T)
        values, vectors = np.linalg.eigh(J @ response)
        kept = values > _SMALLEST * values[-1]
        share = vectors[:, kept].T @ (response.T @ effort) / values[kept]
        found, start = vectors[:, kept] @ share, 0
        for contact, own in zip(self._contacts, rows, strict=True):
            w = found[start : start + len(own)]
            start += len(own)
            moment = w[3:] if len(w) == 6 else np.cross(_arm(contact, state), w)
            self.wrenches[contact.frame] = np.concatenate([w[:3], moment])


def _arm(contact: Contact, state: RobotState) -> Array:
    """Return where the force of a point contact acts, from its frame's origin."""
    return np.asarray(contact.arms(state.frame(contact.frame))[0])


def _rows(contact: Contact, state: RobotState) -> Array:
    """Return the Jacobian of a contact's wrench: of a point or of a whole sole."""
    J = state.frame(contact.frame).jacobian
    if contact.rows == 6:
        return J.copy()
    return np.asarray(J[:3] - np.cross(_arm(contact, state), J[3:], axis=0))
