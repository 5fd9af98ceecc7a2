"""Rigid contacts: the plant whose feet are held by the contacts' own constraints."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.control.measurement import LogChannel
from hsp_control.declaration import Part, within
from hsp_control.declaration.nested import BY_FRAME, stored_by_frame
from hsp_control.declaration.quantities import ArrayField, NonNegative
from hsp_control.engine import Dynamics
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.plant import (
    ContinuousPlant,
    FloatingRoots,
    contact_channels,
    to_json_data,
)
from hsp_control.simulation.plants.plant_part import PlantPart
from hsp_control.simulation.plants.push import Push, Pushes
from hsp_control.trajectories.schedule import Intervals, Schedule

ContactKind = Literal["point", "surface"]


class RigidContact(Part, error=SimulationError):
    """A rigid contact that pushes and pulls on a frame, without slip."""

    yaml_key: ClassVar[str | None] = "frame"

    frame: str
    """Name of the frame [-]; forces are logged under it. In YAML, its key."""
    kind: ContactKind = "surface"
    """Whether only the frame's origin is held, or also its orientation [-]."""
    on: Intervals | None = None
    """Intervals in which the contact is active: [start, end] [s], None for no start or
    no end; always by default."""

    def __post_init__(self) -> None:
        with within("on"):
            _ = self._schedule

    @property
    def rows(self) -> int:
        """How many velocities it keeps at zero."""
        return 3 if self.kind == "point" else 6

    def holds(self, t: float) -> bool:
        """Return whether it holds at time t [s]."""
        return self._schedule.active(t)

    @cached_property
    def _schedule(self) -> Schedule:
        if self.on is None:
            return Schedule.always()
        return Schedule(self.on, ramp=0.0)


RigidContactsByFrame = Annotated[
    Sequence[RigidContact],
    ArrayField(
        Annotated[dict[str, RigidContact], Field(min_length=1)], stored_by_frame
    ),
    BY_FRAME,
]
"""Contacts: a sequence in Python, a mapping by frame in YAML; at least one."""


REDUNDANT = 1e-12
"""Eigenvalues of J M⁻¹ Jᵀ below this share of the largest are redundant rows."""


class ContactPlant(ContinuousPlant):
    """M v' + N = tau + Jᵀλ with J v' + J'v = -k J v, solved for v' and λ.

    Contacts can pull as well as push, and never slip: a plant for proofs. Their forces
    are logged as ``plant.contact.<frame>.force`` and ``.moment``, so that you can check
    whether a real contact could exert them. A velocity at the start of a contact decays
    as exp(-k t).
    """

    def __init__(
        self,
        robot: Robot,
        contacts: Sequence[RigidContact],
        *,
        damping: float = 100.0,
        pushes: Sequence[Push] = (),
    ) -> None:
        """Set the robot and its contacts."""
        super().__init__(robot)
        names = [contact.frame for contact in contacts]
        for name in names:
            with within("contacts", name):
                robot.frame_id(name)
            if names.count(name) > 1:
                raise SimulationError(f"two contacts have the same frame {name!r}")
        if not 0.0 <= damping < np.inf:
            raise SimulationError(
                f"contacts: damping is {damping}; must not be negative"
            )
        self.contacts, self.damping = tuple(contacts), damping
        self.pushes = Pushes(robot, pushes)
        self._roots = FloatingRoots(robot)
        self._state = RobotState(robot)

    @property
    def dynamics(self) -> Dynamics:
        """Of the rigid bodies; see `Plant.dynamics`."""
        return self._state.dynamics

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v'; see `ContinuousPlant.acceleration`."""
        return self._solve(t, q, v, tau)[0]

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the force and moment of every contact, zero while it is off."""
        return contact_channels(self._solve(t, q, v, tau)[1])

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return the wrenches of all contacts; see `Plant.contact_wrenches`."""
        return self._solve(t, q, v, tau)[1]

    def describe(self) -> dict[str, Any]:
        """Return its contacts and pushes."""
        return {
            "type": "ContactPlant",
            "contacts": to_json_data(self.contacts),
            "damping": self.damping,
            "pushes": to_json_data(self.pushes.pushes),
        }

    def _solve(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> tuple[Array, dict[str, Array]]:
        """Return v' and the wrench of every contact, shape (6,), in world axes."""
        state = self._state.update(t, q, v)
        effort = self._roots.remove_effort(t, tau)
        if self.pushes.any_active(t, t):
            effort = effort + self.pushes.effort(t, q)
        M = np.triu(state.mass_matrix)
        M += np.triu(M, 1).T
        net_effort = effort - state.nonlinear_effects
        holding = [contact for contact in self.contacts if contact.holds(t)]
        wrenches = {contact.frame: np.zeros(6) for contact in self.contacts}
        if not holding:
            return np.asarray(np.linalg.solve(M, net_effort)), wrenches
        frames = [(state.frame(c.frame), c.rows) for c in holding]
        J = np.vstack([frame.jacobian[:rows] for frame, rows in frames])
        drift = np.concatenate([frame.drift[:rows] for frame, rows in frames])
        solutions = np.linalg.solve(M, np.column_stack([net_effort, J.T]))
        free, response = solutions[:, 0], solutions[:, 1:]
        missing = -drift - self.damping * (J @ v) - J @ free
        multipliers = _minimum_norm_solution(J @ response, missing)
        start = 0
        for contact in holding:
            own = multipliers[start : start + contact.rows]
            wrenches[contact.frame][: contact.rows] = own
            start += contact.rows
        return free + response @ multipliers, wrenches


def _minimum_norm_solution(A: Array, b: Array) -> Array:
    """Return the x of minimum norm with A x = b, A positive semidefinite."""
    values, vectors = np.linalg.eigh(A)
    kept = values > REDUNDANT * values[-1]
    share = vectors[:, kept].T @ b / values[kept]
    return np.asarray(vectors[:, kept] @ share)


class RigidContacts(PlantPart, type="rigid_contacts"):
    """Pinocchio's rigid-body dynamics with rigid contacts."""

    contacts: RigidContactsByFrame
    """The contacts, by frame name [-]."""
    _: KW_ONLY
    damping: NonNegative = 100.0
    """Rate at which the velocity of a contact decays [1/s]."""

    def engine(self, robot: Robot, integrator: Integrator) -> ContactPlant:
        """Return the plant."""
        return ContactPlant(
            robot, self.contacts, damping=self.damping, pushes=self.pushes
        )
