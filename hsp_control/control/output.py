"""The output of a controller: an effort, and its diagnosis."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.control.active_stack import ActiveStack, Layout, tasks_of
from hsp_control.control.actuation import Delivered, Status
from hsp_control.law import FieldSample, TaskSample, singular_values
from hsp_control.law.problem import StepRecord


class ReplacedTask(NamedTuple):
    """The errors of a task that another one replaces, while it fades out."""

    error: Array  # shape (m,) [m or rad]
    error_rate: Array  # shape (m,) [m/s or rad/s]
    bounded: float  # length of the part of the error that is not fed back [m or rad]


class ControlOutput:
    """The effort at one state, and everything that explains it.

    It belongs to the caller: the controller does not write into it again. The diagnosis
    may be read-only.

    Attributes:
        tau: Effort M a + N minus that of the contact forces, shape (nv,)
            [N·m or N].
        damped: The tasks of the highest level that is so near a singularity that its
            inverse is bounded, and the law not exact: their names, or ``contacts``.
            Empty, and so false, where the law is exact.
        forces: Forces at the points of the active contacts, in the axes of each
            contact (two tangents, normal), shape (3 points,) [N]; see
            `ActiveStack.support`.
        status: How the limits changed the law's acceleration.
        relaxation: The largest violation of a limit, where limits contradict each
            other [rad/s² or m/s²].
    """

    __slots__ = (
        "_acceleration",
        "_distances",
        "_layout",
        "_memory",
        "_replaced",
        "_views",
        "damped",
        "forces",
        "relaxation",
        "status",
        "tau",
    )

    tau: Array
    damped: str
    forces: Array
    status: Status
    relaxation: float
    # Bytes are made faster than arrays, and most are never read.
    _acceleration: bytes | None  # None: the law's own
    _distances: Sequence[tuple[str, bytes]]  # of each barrier, of all its pairs
    _layout: Layout  # of the memory
    _memory: bytes  # see `ActiveStack.memory`
    _replaced: Mapping[str, ReplacedTask]  # by name
    _views: StepRecord | None  # of the memory, once they were read

    def __init__(
        self,
        delivered: Delivered,
        resolved: Sequence[ActiveStack],
        damped: str,
        measured: Sequence[tuple[str, Callable[[], Array]]],
    ) -> None:
        """Copy the results of a step: its effort, its memory, measured distances."""
        stack = resolved[-1]
        tau, a, forces, self.status, self.relaxation = delivered
        self.tau, self._memory, self._views = tau.copy(), stack.memory.tobytes(), None
        self._acceleration = None if a is stack.acceleration else a.tobytes()
        self._layout, self.damped = stack.layout, damped
        self.forces = forces.copy() if stack.has_forces else forces
        self._distances = ()
        if measured:
            self._distances = [(name, found().tobytes()) for name, found in measured]
        self._replaced = _NONE if len(resolved) == 1 else _replaced(resolved)

    @property
    def distances(self) -> dict[str, float]:
        """The smallest distance that each barrier measured [m], by its name.

        Of a user-defined barrier: its smallest value, in its unit. The names are those
        of the log's columns ``distance.NAME`` and ``barrier.NAME``: the types, such as
        ``obstacle_distance``; of one type they are numbered. The distance of shapes
        that overlap is negative.
        """
        return {n: float(np.frombuffer(d).min()) for n, d in self._distances}

    @property
    def acceleration(self) -> Array:
        """The acceleration that the effort produces, shape (nv,)."""
        own = self._acceleration
        return self._record.acceleration if own is None else np.frombuffer(own)

    @property
    def bounded(self) -> dict[str, float]:
        """The lengths of the errors that are fed back in part only.

        By the name of each task whose error is longer than its `largest_error`, or
        whose spring pulls with its largest force: the length of that part of the error
        [m or rad]. Empty, and so false, if none is.
        """
        error, found = self._record.task.error, {}
        for task, rows, away_of in self._layout.bounds:
            away = away_of(error[rows])
            if away > 0.0:
                found[task] = away
        gone = {name: each.bounded for name, each in self._replaced.items()}
        return found | {name: away for name, away in gone.items() if away > 0.0}

    def error(self, task: str) -> Array:
        """Return the error e of a task, as its class defines it, shape (m,) [m or rad].

        While a task replaces another one of its name, the older one is ``NAME (old)``.

        Raises:
            ControllerError: If no such task is active at this time.
        """
        if task in self._replaced:
            return self._replaced[task].error.copy()
        return self._record.task.error[self._rows_of(task)].copy()

    def error_rate(self, task: str) -> Array:
        """Return e' of a task, shape (m,) [m/s or rad/s]; see `error`."""
        if task in self._replaced:
            return self._replaced[task].error_rate.copy()
        return self._record.task.error_rate[self._rows_of(task)].copy()

    def _rows_of(self, task: str) -> slice:
        places = self._layout.places
        if task not in places:
            there = [*places, *self._replaced]
            near = did_you_mean(task, there)
            raise ControllerError(
                f"no task {task!r} is active now{near} (there are {listing(there)})"
            )
        return places[task]

    @property
    def task(self) -> TaskSample:
        """All tasks stacked: J, J', e, e', a_x; without those that others replace."""
        return self._record.task

    @property
    def field(self) -> FieldSample:
        """G and g', shapes (nv,)."""
        return self._record.field

    @property
    def null_space_error(self) -> Array:
        """e_N = (I - J#J)(g - v), shape (nv,)."""
        return self._record.null_space_error

    def __repr__(self) -> str:
        names = *self._layout.places, *self._replaced
        sizes = {f"e of {name}": self.error(name) for name in names}
        sizes["e_N"] = self.null_space_error
        notes = [
            f"|{name}| = {np.linalg.norm(each):.3g}" for name, each in sizes.items()
        ]
        for name, distance in self.distances.items():
            notes.append(f"{name} = {distance:.3g}")
        if self.damped:
            notes.append(f"damped: {self.damped}")
        tau = np.round(self.tau, 3).tolist()
        return f"ControlOutput(tau={tau}, {self.status.name}; {', '.join(notes)})"

    def explanation(self, own: StepRecord | None) -> StepRecord:
        """Return a copy of tasks, field, null-space error and `acceleration`.

        Args:
            own: A record to overwrite, if it is of the same size; None: a new one.
        """
        rows = self._layout.rows
        if own is None or len(own.task.error) != rows:
            own = StepRecord.allocate(rows, len(self.tau))
        own.memory[:] = np.frombuffer(self._memory)
        if self._acceleration is not None:
            own.acceleration[:] = np.frombuffer(self._acceleration)
        return own

    @property
    def _record(self) -> StepRecord:
        if self._views is None:
            memory = np.frombuffer(self._memory)
            self._views = StepRecord.over(memory, self._layout.rows, len(self.tau))
        return self._views


_NONE: Mapping[str, ReplacedTask] = {}


def _replaced(resolved: Sequence[ActiveStack]) -> dict[str, ReplacedTask]:
    """Return the tasks that the last one of the stacks does not have, by name."""
    found = dict[str, ReplacedTask]()
    for name, stack, each in tasks_of(resolved):
        if stack is resolved[-1]:
            continue
        error, rate = stack.rows.error[each.rows], stack.rows.error_rate[each.rows]
        bounds = stack.layout.bounds
        away = next((of(error) for _, rows, of in bounds if rows == each.rows), 0.0)
        found[name] = ReplacedTask(error.copy(), rate.copy(), max(away, 0.0))
    return found


class Diagnostics(NamedTuple):
    """Quantities to plot beside the effort.

    Attributes:
        field_value: The field's cost f, or its norm.
        null_space_norm: ‖e_N‖_W, which decays like exp(-K_N t) for a scalar gain.
        manipulability: det(J W⁻¹ Jᵀ) of the tasks' stacked Jacobian.
        triangle: The input of `singular_values`.
    """

    field_value: float
    null_space_norm: float
    manipulability: float
    triangle: bytes

    @property
    def singular_values(self) -> Array:
        """Those of J L⁻ᵀ, W = L Lᵀ, the largest first; computed when first read."""
        return singular_values(self.triangle)
