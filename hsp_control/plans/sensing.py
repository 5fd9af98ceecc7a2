"""Contacts that begin and end when that is felt: one run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import PlanError
from hsp_control.control.controller import Controller
from hsp_control.control.log_channel import LogChannel
from hsp_control.control.measurement import Measurement
from hsp_control.plans.plan import RunningPlan
from hsp_control.plans.switched import Switched
from hsp_control.robot import RobotState
from hsp_control.trajectories.switch import Switch

if TYPE_CHECKING:
    from hsp_control.plans.sensed import Sensed, SensedContact


class FeltContact(Switched):
    """A contact in one run: whether it bears, and what is felt.

    Attributes:
        name: Its name.
        frame: Its frame.
        force: The normal force that is felt [N]; NaN without one.
        height: The height of its frame along the normal [m].
        estimated: Whether the force is estimated.
        events: How often it has begun or ended.
    """

    def __init__(
        self, name: str, rule: "SensedContact", controller: Controller
    ) -> None:
        """Find its switches in a controller.

        Raises:
            PlanError: If the controller is not made of the plan's parts.
        """
        self.name, self._rule = name, rule
        contact = {each.name: each for each in controller.contacts}.get(name)
        task = {each.name: each for each in controller.tasks}.get(rule.task or "")
        if (
            contact is None
            or not isinstance(contact.schedule, Switch)
            or (task is None) != (rule.task is None)
            or not (task is None or isinstance(task.schedule, Switch))
        ):
            raise PlanError(
                f"the contact {name!r} does not follow the plan: make the controller "
                "of the plan's parts"
            )
        self.frame: str = contact.frame
        self._normal: Array = contact.axes[:, 2]
        self.contact = contact.schedule
        switch = None if task is None else task.schedule
        self.task = switch if isinstance(switch, Switch) else None
        self._wanted = rule.schedule()
        self.force, self.height, self.estimated = np.nan, np.nan, False
        self.events = 0

    def start(self) -> None:
        """Return to the start, before anything is felt."""
        self.reset()
        self._pressed = -np.inf  # nothing was felt yet
        self._leaving = False
        self.events = 0

    @property
    def bears(self) -> bool:
        """Whether it is switched on."""
        return self.contact.is_on

    def update(self, t: float, state: RobotState, measured: Measurement) -> None:
        """Feel, and switch.

        Raises:
            PlanError: If a force is needed, and there is none.
        """
        rule = self._rule
        force = measured.normal_force(self.frame, self._normal)
        if force is None and rule.force is not None:
            raise PlanError(
                f"plan.contacts.{self.name}.force: nothing measures or estimates the "
                f"force at {self.frame!r}; give height instead, or a contact_observer"
            )
        self.force = np.nan if force is None else force
        self.estimated = self.frame in measured.estimated
        self.height = float(self._normal @ state.position(self.frame))
        wanted = self._wanted.active(t)
        if not self.bears:
            if not self.contact.active(t) and self._leaving:
                self._leaving = False  # its force has faded
                self.events += 1
            if wanted and self._is_felt():
                self._bear(t)
        elif not wanted:
            self._leave(t, rule.ramp)
        elif self._is_lost(t):
            self._leave(t, rule.patience)

    def _is_felt(self) -> bool:
        rule = self._rule
        pressed = rule.force is None or self.force >= rule.force
        return pressed and (rule.height is None or self.height <= rule.height)

    def _is_lost(self, t: float) -> bool:
        limit = self._rule.lets_go
        if limit is None or self.force >= limit or self._pressed == -np.inf:
            self._pressed = t
        return t - self._pressed > self._rule.patience

    def _bear(self, t: float) -> None:
        self._pressed, self._leaving = t, False
        self.bear(t, self._rule.ramp)
        self.events += 1

    def _leave(self, t: float, ramp: float) -> None:
        self._leaving = True
        self.unload(t, ramp)


class RunningSensed(RunningPlan):
    """What a `Sensed` became for one run."""

    def __init__(self, sensed: "Sensed", controller: Controller) -> None:
        """Find the switches.

        Raises:
            PlanError: If the controller is made of other parts.
        """
        super().__init__(sensed)
        self._controller = controller
        self._state = RobotState(controller.robot)
        self._felt = [
            FeltContact(name, rule, controller)
            for name, rule in sensed.contacts.items()
        ]
        self._begun = False

    def start(self, state: RobotState) -> None:
        """Begin before anything is felt; see `RunningPlan.start`."""
        for each in self._felt:
            each.start()
        self._begun = True

    def update(self, measured: Measurement) -> None:
        """Switch contacts; see `RunningPlan.update`."""
        state = self._state.update(measured.t, measured.q, measured.v)
        if not self._begun:
            self.start(state)
        for each in self._felt:
            each.update(measured.t, state, measured)

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return what is felt of each contact, and whether it bears."""
        channels: dict[str, LogChannel] = {}
        for each in self._felt:
            prefix = f"plan.{each.name}"
            channels |= {
                f"{prefix}.bears": LogChannel(
                    float(each.bears), "-", "whether it is switched on"
                ),
                f"{prefix}.events": LogChannel(
                    float(each.events), "-", "how often it has begun or ended"
                ),
                f"{prefix}.felt": LogChannel(
                    each.force, "N", "normal force as measured or estimated"
                ),
                f"{prefix}.estimated": LogChannel(
                    float(each.estimated), "-", "1 if the force is estimated"
                ),
                f"{prefix}.height": LogChannel(
                    each.height, "m", "of its frame, along the normal"
                ),
            }
        return channels
