"""Integral feedback of contact forces: measured forces follow their commands."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.contacts.contact import NORMAL
from hsp_control.control.actuation import Status
from hsp_control.control.compensation.stage import Run, Stage
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Names, Positive
from hsp_control.robot import RobotState

_MISSED = 0.01
"""Error of a force in the QP, relative to its command, that stops the integral."""
_SMALLEST = 1e-9
"""Mobility, relative to the largest, below which a direction is treated as immobile."""


class ForceFeedback(Part, error=CompensationError):
    """The normal force of contacts follows its command in spite of model errors.

    With λ_d the commanded and λ_m the measured normal force, the controller commands

        λ = λ_d + K_i ∫ (λ_d - λ_m) dt

    A rigid contact answers with λ_m = λ - (the model's error), so the error decays
    like exp(-K_i t). The integral rests while the contact is not fully active, and
    while limits leave no room for its addition.
    """

    gain: Positive = 5.0
    """K_i [1/s]; a tenth of 1/(a period and the delays of the loop) at most: at one
    over that it does not decay."""
    _: KW_ONLY
    bound: Positive = 50.0
    """Largest magnitude of the integral's share of the command [N]."""
    force: Literal["measured", "estimated"] = "measured"
    """The fed back force [-]: that of sensors in the contacts, or that of the momentum
    observer (for robots with a fixed base)."""
    contacts: Names | None = None
    """Names of the contacts; all with a commanded force by default."""

    def check(self, contacts: Sequence[Contact], observed: bool) -> None:
        """Check that there is something to feed back."""
        names = [contact.name for contact in contacts if contact.force is not None]
        with within("contacts"):
            for name in self.contacts or ():
                if name not in names:
                    raise CompensationError(
                        f"there is no contact {name!r} with a commanded force"
                        f"{did_you_mean(name, names)} (there are "
                        f"{listing(names) or 'none'})"
                    )
        if not names:
            raise CompensationError("no contact has a commanded force; give one")
        if self.force == "estimated" and not observed:
            with within("force"):
                raise CompensationError(
                    "'estimated' needs compensation.momentum_observer, with cancel: "
                    "false"
                )


class RunningForceFeedback(Stage):
    """Force feedback in one run: it keeps the integrals."""

    def __init__(self, declared: ForceFeedback, controller: Controller) -> None:
        self._declared, self._controller = declared, controller
        names = [
            contact.name
            for contact in controller.contacts
            if contact.force is not None
            and (declared.contacts is None or contact.name in declared.contacts)
        ]
        self.integrals = dict.fromkeys(names, 0.0)  # addition to every command [N]
        self.actual = dict.fromkeys(
            names, np.nan
        )  # λ_m by contact, at the last step [N]
        for name in names:
            controller._force_offset(name)[0] = 0.0

    def measure(self, run: Run) -> None:
        """Measure the forces; see `Stage.measure`."""
        if self._declared.force == "measured":
            self._read(run.wrenches, pressed=run.last_period > 0.0)
        elif run.under_way:
            self._estimate(run.measured, run.disturbance, run.output.forces)

    def _read(self, wrenches: Mapping[str, Array], pressed: bool) -> None:
        """Read the sensors' wrenches by frame; none is used before the first effort."""
        for contact in self._fed:
            if contact.frame not in wrenches:
                with within("compensation", "force_feedback", "force"):
                    raise CompensationError(
                        f"no sensor measures the force at {contact.frame!r} of contact "
                        f"{contact.name!r} (measured: {listing(wrenches) or 'none'}); "
                        "'estimated' needs none"
                    )
            wrench = wrenches[contact.frame]
            actual = float(contact.axes[:, 2] @ wrench[:3])
            self.actual[contact.name] = actual if pressed else np.nan

    def _estimate(self, state: RobotState, disturbance: Array, forces: Array) -> None:
        """Estimate forces from r, the effort of unexpected forces."""
        unexpected = np.linalg.solve(state.mass_matrix, disturbance)
        support = self._controller.active_stack.support
        for contact in self._fed:
            points = support.points_of(contact.name)
            if points is None:
                self.actual[contact.name] = 0.0
                continue
            columns = slice(3 * points.start, 3 * points.stop)
            F = support.map[:, columns].reshape(len(disturbance), -1, 3).sum(axis=1)
            F = F / (points.stop - points.start)
            # The force that moves the contact as r does: Λ J M⁻¹ r, with J = Fᵀ.
            mobility = F.T @ np.linalg.solve(state.mass_matrix, F)
            inverse = np.linalg.pinv(mobility, rcond=_SMALLEST, hermitian=True)
            expected = forces[columns].reshape(-1, 3)[:, 2].sum()
            self.actual[contact.name] = float(
                expected + (inverse @ F.T @ unexpected)[2]
            )

    def finish(self, run: Run) -> None:
        """Integrate the errors over one period, for the next effort."""
        t, period, forces = self._controller.state.t, run.period, run.output.forces
        hindered = run.output.status >= Status.LIMITED
        support = self._controller.active_stack.support
        gain, bound = self._declared.gain, self._declared.bound
        for contact in self._fed:
            actual, name = self.actual[contact.name], contact.name
            points = support.points_of(name)
            if (
                points is None
                or not np.isfinite(actual)
                or self._controller.contact_weight(name, t) < 1.0
            ):
                continue
            assert contact.force is not None
            command = contact.force.followed.sample(t).position
            wanted = command[0 if contact.force.dimension == NORMAL else 2]
            planned, commanded = (
                float(each.reshape(-1, 3)[points, 2].sum())
                for each in (forces, support.reference)
            )
            change = gain * period * (float(wanted) - actual)
            integral = self.integrals[name]
            missing = commanded - planned  # the QP gave less
            if change * missing > 0.0 and abs(missing) > _MISSED * (1.0 + commanded):
                continue
            if hindered and change * integral >= 0.0:
                continue
            integral = min(max(integral + change, -bound), bound)
            self.integrals[name] = self._controller._force_offset(name)[0] = integral

    def log_channels(self, run: Run) -> Mapping[str, LogChannel]:
        """Return measured forces and additions; see `Stage.log_channels`."""
        found, how = dict[str, LogChannel](), self._declared.force
        added = "addition of the force feedback to the commanded normal force"
        for name, actual in self.actual.items():
            meaning = f"normal force, {how}"
            found[f"contact.{name}.{how}"] = LogChannel(actual, "N", meaning)
            integral = LogChannel(self.integrals[name], "N", added)
            found[f"contact.{name}.integral"] = integral
        return found

    @property
    def _fed(self) -> list[Contact]:
        """The contacts whose force is fed back, with the commands in force."""
        return [c for c in self._controller.contacts if c.name in self.integrals]
