"""Contact forces of the active contacts: their map, cones, bounds and points."""

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.native import bind
from hsp_control.common.step_plan import in_order
from hsp_control.constraints.contacts import Contact
from hsp_control.control.actuation.commanded_forces import (
    COMMANDED_INVERSE_COST,
    CommandedForces,
)
from hsp_control.control.actuation.contact_forces import (
    force_map,
    minimum_norm_forces,
    within_cones,
)
from hsp_control.control.planned_contact import PlannedContact
from hsp_control.law import Resolution
from hsp_control.robot import Robot, RobotState

_MAX_FORCE = 3.0
"""Maximum normal force at a point of a scheduled contact when fully active, in robot
weights."""


class Support:
    """Forces f at the points of contacts, in the axes (tangents, normal) of each."""

    def __init__(
        self, contacts: Sequence[PlannedContact], robot: Robot, weight: float
    ) -> None:
        """Allocate for contacts of a robot."""
        nv = robot.nv
        self.contacts = tuple(each.contact for each in contacts)
        counts = [len(contact.points) for contact in self.contacts]
        points = sum(counts)
        self.size = 3 * points  # length of f: three per point
        # generalised force of f is ``map @ f``, shape (nv, size)
        self.map: Array = np.zeros((nv, self.size))
        self.positions: Array = np.zeros((points, 3))
        # rows with cone f ≥ 0, four per point, shape (4 size/3, size)
        self.cone: Array = np.zeros((4 * points, self.size))
        self.lower = np.full(self.size, -np.inf)
        # upper bounds of the forces, shape (size,) [N]
        self.upper = np.full(self.size, np.inf)
        self.lower[2::3] = 0.0
        # e, shape (size,): the closed form minimises Σ (f - f_ref)²/e
        self.inverse_cost = np.ones(self.size)
        self._weight = weight
        self.supporting_dofs = _supporting_dofs(robot, self.contacts)
        ends = np.cumsum([0, *counts])
        self.points = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        for contact, where in zip(self.contacts, self.points, strict=True):
            for k in range(where.start, where.stop):
                for row, (axis, sign) in enumerate(
                    ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))
                ):
                    self.cone[4 * k + row, 3 * k + axis] = sign
                    self.cone[4 * k + row, 3 * k + 2] = contact.side

        # f_ref, shape (size,): the commanded forces, zero where none is
        self.reference = np.zeros(self.size)
        self._scheduled: list[tuple[PlannedContact, slice, Array]] = []
        self._commanded: list[tuple[PlannedContact, CommandedForces, Array]] = []
        for planned, where in zip(contacts, self.points, strict=True):
            columns = slice(3 * where.start, 3 * where.stop)
            friction = planned.contact.friction
            full = np.tile([friction**2, friction**2, 1.0], where.stop - where.start)
            if planned.contact.force is not None:
                command = CommandedForces(planned)
                full[command.mask] *= COMMANDED_INVERSE_COST
                self._commanded.append((planned, command, self.reference[columns]))
            self.inverse_cost[columns] = full
            if not planned.always:
                self._scheduled.append((planned, columns, full))
        self._wanted, self._tau = np.zeros(nv), np.zeros(nv)
        # what `minimum_norm_forces` wrote last, shape (size,) [N]
        self.forces, self._asked = np.zeros(self.size), np.zeros(self.size)
        self._maps = IdentityCache(self._bind_maps)
        self._solve = IdentityCache(self._bind_solve)

    def update(self, state: RobotState, resolution: Resolution) -> None:
        """Compute the map, the positions, the bounds of schedules, and the commands."""
        for write in self._maps.get(state):
            write(state.t)
        for planned, columns, full in self._scheduled:
            on = max(planned.weight(state.t), 1e-6)
            self.upper[columns][2::3] = on * _MAX_FORCE * self._weight
            self.inverse_cost[columns] = on * full
        for planned, command, own in self._commanded:
            command.write(state, planned.weight(state.t), resolution, own)

    def _bind_maps(self, state: RobotState) -> list[Callable[[float], Any]]:
        """Return the calls that write the map and the positions at this state."""
        calls: list[Callable[[], object]] = []
        for contact, where in zip(self.contacts, self.points, strict=True):
            frame = state.frame(contact.frame)
            points, shift = np.array(contact.points), np.array(contact.shift)
            own = points, shift, np.array(contact.axes), where.start
            write = bind(force_map, frame.motion, *own, self.positions, self.map)
            calls += [frame.compute, write]
        return in_order(calls)

    def minimum_norm_forces(self, base: Indices, wanted: Array) -> tuple[Array, Array]:
        """Return the forces of minimum Σ (f - f_ref)²/e, and the remaining effort."""
        self._wanted[:] = wanted
        self._solve.get(base)()
        return self.forces, self._tau

    def _bind_solve(self, base: Indices) -> Callable[[], object]:
        n, zeros = len(base), np.zeros
        return bind(
            minimum_norm_forces,
            *(self.map, base, self.inverse_cost, self.reference, self._wanted),
            *(zeros((n, self.size)), zeros((n, n)), zeros((n, n)), zeros((2, n))),
            *(self.forces, self._tau),
        )

    def permits(self, forces: Array) -> bool:
        """Return whether forces, shape (size,), are within cones and bounds."""
        self._asked[:] = forces
        return bool(self._permits())

    @cached_property
    def _permits(self) -> Callable[[], float]:
        return bind(within_cones, self.cone, self._asked, self.lower, self.upper)

    def in_world(self, forces: Array) -> Array:
        """Return the forces in world axes, shape (size/3, 3) [N]."""
        out = np.zeros((self.size // 3, 3))
        for contact, where in zip(self.contacts, self.points, strict=True):
            local = forces.reshape(-1, 3)[where]
            out[where] = local @ contact.axes.T
        return out


def _supporting_dofs(robot: Robot, contacts: Sequence[Contact]) -> Indices:
    """Return the degrees of freedom between the root and a contact."""
    found: set[int] = set()
    model = robot.model
    for contact in contacts:
        joint = model.frames[robot.frame_id(contact.frame)].parentJoint
        for k in model.supports[joint]:
            start = model.joints[k].idx_v
            found.update(range(start, start + model.joints[k].nv))
    return np.array(sorted(i for i in found if i >= 0), dtype=np.int64)
