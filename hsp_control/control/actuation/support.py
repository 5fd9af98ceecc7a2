"""Contact forces of the active contacts: their map, cones, bounds and points."""

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.contacts import Contact, SlidingContact
from hsp_control.constraints.contacts.contact import NORMAL, WRENCH, shares
from hsp_control.control.planned import PlannedContact
from hsp_control.edge import BoundLaw
from hsp_control.engine.plans import TIME, AnyCall, PartCall, PartCalls
from hsp_control.robot import Robot, RobotState
from hsp_control.trajectories import TrajectorySample

_MAX_FORCE = 3.0
"""Maximum normal force at a point of a scheduled contact when fully active, in robot
weights."""


class Support:
    """Forces f at the points of contacts, in the axes (tangents, normal) of each."""

    def __init__(
        self,
        contacts: Sequence[PlannedContact],
        state: RobotState,
        base: Sequence[int] = (),
        force_offset: Callable[[str], Array] = lambda _: np.zeros(1),
    ) -> None:
        """Bind contacts, which read their ``force_offset``, by name, in every step."""
        robot, nv = state.robot, state.robot.nv
        self._state = state
        # degrees of freedom without a motor
        self.base: Indices = np.array(base, dtype=np.int64)
        # robot's weight [N]
        self.weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
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
        self._commanded: list[tuple[PlannedContact, CommandedForces]] = []
        for planned, where in zip(contacts, self.points, strict=True):
            columns = slice(3 * where.start, 3 * where.stop)
            friction = planned.contact.friction
            full = np.tile([friction**2, friction**2, 1.0], where.stop - where.start)
            if planned.contact.force is not None:
                offset = force_offset(planned.contact.name)
                own = self.reference[columns]
                command = CommandedForces(planned.contact, state, offset, own)
                full[command.mask] *= COMMANDED_INVERSE_COST
                self._commanded.append((planned, command))
            self.inverse_cost[columns] = full
            if not planned.always:
                self._scheduled.append((planned, columns, full))
        self._update: engine.Plan | None = None
        # input and last result of `minimum_norm_forces`: the remaining effort, shape
        # (nv,), and forces, shape (size,) [N]
        self._wanted, self.tau = np.zeros(nv), np.zeros(nv)
        self.forces = np.zeros(self.size)

    def points_of(self, contact: str) -> slice | None:
        """Return the rows of the points of a contact; None: it is not active.

        By its name: the controller's own, whose changes are over, may be another value.
        """
        for each, points in zip(self.contacts, self.points, strict=True):
            if each.name == contact:
                return points
        return None

    def update(self, law: BoundLaw) -> None:
        """Compute the map, the positions, the bounds of schedules, and the commands."""
        if self._update is None:
            self._update = engine.Plan(self._state.plan(self._updating(law)).steps())
        self._update(self._state.t)

    def bind(self, law: BoundLaw) -> None:
        """Bind all calls now, instead of in a step, and run them once."""
        self.update(law)
        self.minimum_norm_forces(self._wanted)
        self.permits()

    def _updating(self, law: BoundLaw) -> PartCalls:
        """Return the calls that are equivalent to `update`."""
        calls = list[AnyCall]()
        commands = {id(planned): each.weight for planned, each in self._commanded}
        for planned, columns, full in self._scheduled:
            on = np.zeros(1)
            if planned.unscheduled:
                calls.append(planned.presence.call(on))
            else:
                calls.append(PartCall(_write_weight, t=TIME, contact=planned, out=on))
            fading = PartCall(
                engine.FadingForces,
                weight=on,
                full=full,
                most=_MAX_FORCE,
                robot=self.weight,
                upper=self.upper[columns],
                inverse_cost=self.inverse_cost[columns],
                command=commands.get(id(planned), np.zeros(1)),
            )
            calls.append(fading)
        calls += self.maps()
        for _, each in self._commanded:
            calls += each.calls(law)
        return calls

    def maps(self) -> list[AnyCall]:
        """Return the calls that write the map and the positions."""
        calls: list[AnyCall] = []
        for contact, where in zip(self.contacts, self.points, strict=True):
            frame = self._state.frame(contact.frame)
            call = PartCall(
                engine.ForceMap,
                frame=frame,
                points=np.array(contact.points),
                shift=np.array(contact.shift),
                axes=np.array(contact.axes),
                first=where.start,
                positions=self.positions,
                out=self.map,
            )
            calls.append(call)
        return calls

    def calls(self, wanted: Array, law: BoundLaw) -> PartCalls:
        """Return the calls equivalent to `update` and `minimum_norm_forces`.

        Args:
            wanted: The effort without contact forces, shape (nv,) [N·m or N].
            law: The law whose effort it is.
        """
        copy = PartCall(engine.Copy, x=wanted, out=self._wanted)
        return [*self._updating(law), copy, self._solution()]

    def minimum_norm_forces(self, wanted: Array) -> Array:
        """Return the forces of minimum Σ (f - f_ref)²/e, and write `tau`."""
        self._wanted[:] = wanted
        self._solve()
        return self.forces

    @cached_property
    def _solve(self) -> Callable[[], object]:
        return self._state.plan([self._solution()]).call()

    def _solution(self) -> PartCall:
        return PartCall(
            engine.MinimumNormForces,
            F=self.map,
            base=self.base,
            inverse_cost=self.inverse_cost,
            reference=self.reference,
            wanted=self._wanted,
            forces=self.forces,
            tau=self.tau,
        )

    @cached_property
    def permits(self) -> Callable[[], float]:
        """The call that checks whether `forces` are within cones and bounds."""
        call = PartCall(
            engine.WithinCones,
            cone=self.cone,
            forces=self.forces,
            lower=self.lower,
            upper=self.upper,
        )
        return self._state.plan([call]).call()

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


COMMANDED_INVERSE_COST = 1e-6
"""ε: cost of squared deviations of free forces relative to those of commanded ones.
With 1 kN on the feet a commanded force then deviates by 1 mN. In a limited step of a
floating base an error of the command costs more than null-space motion, and less than
task errors."""


def _write_weight(t: float, contact: PlannedContact, out: Array) -> None:
    out[:] = contact.weight(t)


class CommandedForces:
    """Writes f_ref for the points of one contact, and the cost of deviations.

    Attributes:
        mask: Commanded entries of the contact's forces, shape (3 k,).
        weight: How active the contact is, in [0, 1], shape (1,).
    """

    def __init__(
        self, contact: Contact, state: RobotState, offset: Array, out: Array
    ) -> None:
        """Follow the command of a contact.

        Args:
            contact: The contact, with k points.
            state: Where the robot is.
            offset: An addition to its normal force, shape (1,) [N].
            out: f_ref of its points, shape (3 k,) [N], which is written.
        """
        assert contact.force is not None
        self._contact, self._state, self._out = contact, state, out
        n = contact.force.dimension
        self._command = TrajectorySample.allocate(n)
        self._followed = contact.force.followed.calls(self._command)
        k = len(contact.points)
        self._varies = n == WRENCH  # with the arms
        self._shares = np.zeros((3 * k, n))
        if not self._varies:
            self._shares[:] = shares(n, np.zeros((k, 3)))
        only_normal = n == NORMAL and not contact.slides
        self.mask = np.tile([not only_normal, not only_normal, True], k)
        self.weight = np.ones(1)
        self._command_call = PartCall(
            engine.CommandedForce,
            command=self._command.position,
            offset=offset,
            weight=self.weight,
            shares=self._shares,
            normal=0 if n == NORMAL else 2,
            reference=out,
        )

    def calls(self, law: BoundLaw) -> PartCalls:
        """Return the calls that write f_ref, after those of the law."""
        calls: list[AnyCall] = [*self._followed]
        if self._varies:
            calls.append(self._sharing())
        calls.append(self._command_call)
        if isinstance(self._contact, SlidingContact) and self._contact.slides:
            calls.append(self._friction(self._contact, law))
        return calls

    def _sharing(self) -> PartCall:
        contact = self._contact
        return PartCall(
            engine.WrenchShares,
            frame=self._state.frame(contact.frame),
            points=np.array(contact.points),
            shift=np.array(contact.shift),
            axes=np.array(contact.axes),
            out=self._shares,
        )

    def _friction(self, contact: SlidingContact, law: BoundLaw) -> PartCall:
        problem = law.problem
        return PartCall(
            engine.SlidingFriction,
            frame=self._state.frame(contact.frame),
            point=np.array(contact.points[0]),
            shift=np.array(contact.shift),
            axes=np.array(contact.axes),
            v=self._state.v,
            null_space_error=law.null_space_error,
            L=problem.metric.L,
            jacobian=problem.task.jacobian,
            error_rate=problem.task.error_rate,
            friction=contact.friction,
            smoothing=contact.smoothing,
            reference=self._out,
        )
