"""What the contacts that bear now can do: their forces, cones and where they act."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.contacts import Contact
from hsp_control.control.actuation.contact_forces import bears, least_forces, push_map
from hsp_control.robot import RobotState

_HEAVIEST = 3.0
"""What one contact may bear at most, in robot weights, when fully on."""


class Support:
    """Forces f at the points of some contacts, in the axes (tangents, normal) of each.

    Attributes:
        contacts: The contacts that bear.
        size: Numbers in f, three a point.
        map: What f pushes: the generalised force is ``map @ f``, shape (nv, size).
        arms: Where the points are in the world, shape (size/3, 3) [m].
        cone: Rows with cone f ≥ 0, four a point, shape (4 size/3, size).
        least: Least force, shape (size,) [N].
        greatest: Greatest force, shape (size,) [N].
        carrying: Freedoms between the root and a contact, whose efforts depend on
            forces.
        ease: How readily each force is used, shape (size,): the norm that the closed
            form makes least is Σ f²/ease.
    """

    def __init__(self, contacts: Sequence[Contact], nv: int, weight: float) -> None:
        """Allocate for contacts of a robot of nv freedoms and a weight [N]."""
        self.contacts = tuple(contacts)
        counts = [len(contact.points) for contact in contacts]
        points = sum(counts)
        self.size = 3 * points
        self.map: Array = np.zeros((nv, self.size))
        self.places: Array = np.zeros((points, 3))
        self.cone: Array = np.zeros((4 * points, self.size))
        self.least = np.full(self.size, -np.inf)
        self.greatest = np.full(self.size, np.inf)
        self.least[2::3] = 0.0
        self.ease = np.ones(self.size)
        self._weight = weight
        self.carrying = _carrying(contacts)
        ends = np.cumsum([0, *counts])
        self.points = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        for contact, where in zip(self.contacts, self.points, strict=True):
            side = contact.friction / np.sqrt(2.0)  # the square inscribed in the cone
            for k in range(where.start, where.stop):
                for row, (axis, sign) in enumerate(
                    ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))
                ):
                    self.cone[4 * k + row, 3 * k + axis] = sign
                    self.cone[4 * k + row, 3 * k + 2] = side

        self._pushing: list[tuple[Contact, Array, Array, slice, Array]] = []
        for contact, where in zip(self.contacts, self.points, strict=True):
            columns = slice(3 * where.start, 3 * where.stop)
            friction = contact.friction
            easy = np.tile([friction**2, friction**2, 1.0], where.stop - where.start)
            self.ease[columns] = easy
            places, pushes = self.places[where], self.map[:, columns]
            self._pushing.append((contact, places, pushes, columns, easy))
        self._tau, self._forces = np.zeros(nv), np.zeros(self.size)
        self._solver: tuple[Indices, tuple[Array, Array, Array, Array]] | None = None

    def update(self, state: RobotState) -> None:
        """Compute the map, the places, and what the schedules let each contact bear."""
        for contact, places, pushes, columns, easy in self._pushing:
            frame = state.frame(contact.frame)
            arms = contact.arms(frame)
            push_map(frame.jacobian, frame.position, arms, contact.axes, places, pushes)
            if not contact.schedule.constant or contact.schedule.ramp:
                on = max(contact.schedule.weight(state.t), 1e-6)
                self.greatest[columns][2::3] = on * _HEAVIEST * self._weight
                self.ease[columns] = on * easy

    def least_forces(self, base: Indices, wanted: Array) -> tuple[Array, Array]:
        """Return the forces of least Σ f²/ease that hold the base, and what they leave.

        Args:
            base: The freedoms that no motor moves.
            wanted: The effort without contacts, shape (nv,).

        Returns:
            The forces, shape (size,), and the effort that is left to the motors, shape
            (nv,): overwritten by the next call.
        """
        if self._solver is None or self._solver[0] is not base:
            n = len(base)
            scratch = (
                np.zeros((n, self.size)),
                np.zeros((n, n)),
                np.zeros((n, n)),
                np.zeros((2, n)),
            )
            self._solver = base, scratch
        least_forces(
            self.map,
            base,
            self.ease,
            wanted,
            *self._solver[1],
            self._forces,
            self._tau,
        )
        return self._forces, self._tau

    def bears(self, forces: Array) -> bool:
        """Return whether forces are within cones and bounds."""
        return bears(self.cone, forces, self.least, self.greatest)

    def in_world(self, forces: Array) -> Array:
        """Return the forces in world axes, shape (points, 3) [N]."""
        out = np.zeros((self.size // 3, 3))
        for contact, where in zip(self.contacts, self.points, strict=True):
            local = forces.reshape(-1, 3)[where]
            out[where] = local @ contact.axes.T
        return out


def _carrying(contacts: Sequence[Contact]) -> Indices:
    """Return the freedoms that move a contact."""
    found: set[int] = set()
    for contact in contacts:
        model = contact.robot.model
        joint = model.frames[contact.robot.frame_id(contact.frame)].parentJoint
        for k in model.supports[joint]:
            start = model.joints[k].idx_v
            found.update(range(start, start + model.joints[k].nv))
    return np.array(sorted(i for i in found if i >= 0), dtype=np.int64)
