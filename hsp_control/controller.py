"""The controller: tasks, a null-space field and a metric make one effort."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import ControllerError, GainError, NonFiniteError
from hsp_control.fields import FieldSample, NullSpaceField, Rest
from hsp_control.metrics import IdentityMetric, Metric, MetricSample
from hsp_control.metrics.metric import CONSTANT, VARYING
from hsp_control.resolution import Resolution
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task, TaskSample
from hsp_control.tasks.gains import as_gain, as_matrix


class ControlOutput(NamedTuple):
    """The effort at one state, and everything that explains it.

    The arrays are the controller's own and are overwritten by its next `compute`: copy
    what must outlive it.

    Attributes:
        tau: Effort M a + N, shape (nv,) [N·m or N].
        acceleration: a, shape (nv,).
        task: All tasks stacked: J, J', e, e', a_x.
        field: g and g', shape (nv,) each.
        null_space_error: e_N = (I - J#J)(g - v), shape (nv,).
        damped: Whether a task is so near a singularity that the law was bounded
            rather than exact.
    """

    tau: Array
    acceleration: Array
    task: TaskSample
    field: FieldSample
    null_space_error: Array
    damped: bool


class Diagnostics(NamedTuple):
    """What one would plot beside the effort.

    Attributes:
        field_value: The field's cost f, or its norm.
        null_space_norm: ‖e_N‖_W, which decays like exp(-K_N t) for a scalar gain.
        singular_values: Of the stacked Jacobian in the metric, J L⁻ᵀ, largest first.
        manipulability: det(J W⁻¹ Jᵀ), the product of their squares.
    """

    field_value: float
    null_space_norm: float
    singular_values: Array
    manipulability: float


class Controller:
    """Computes tau = M a + N with the law of Hsu, Hauser and Sastry over a metric.

    Wherever the stacked Jacobian keeps its rank: every task's error obeys
    e'' + Kv e' + Kp e = 0, and V = ½ e_NᵀW e_N obeys V' = -e_NᵀW K_N e_N. It has no
    memory: the same state gives the same effort.

    Attributes:
        robot: The robot.
        levels: The tasks of each level, the highest priority first.
        tasks: All of them, in the same order.
        field: The null-space field.
        metric: The joint-space metric.
        null_space_gain: K_N, shape (nv, nv) [1/s].
        task_rows: Where each task's rows stand in the stack, by name.
        field_sample: g and g' of the last `compute`.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task | Sequence[Task]],
        field: NullSpaceField | None = None,
        *,
        null_space_gain: Any = 10.0,
        metric: Metric | None = None,
        singularity_threshold: float = 0.03,
    ) -> None:
        """Compose a controller.

        Args:
            robot: The robot.
            tasks: One task or more, with distinct names, stacked at one level; or a
                list of such lists, the highest priority first.
            field: Where self-motion shall go; None: to rest.
            null_space_gain: K_N > 0 [1/s]: scalar, shape (nv,) or (nv, nv).
            metric: Joint-space metric; None: identity.
            singularity_threshold: Singular value of the stacked Jacobian (in the
                metric) below which its inverse is bounded instead of exact. For
                positions about 3 % of the arm's reach [m]; efforts on the way into a
                singularity grow with its inverse cube.

        Raises:
            ControllerError: If tasks, field and robot do not belong together, or the
                tasks of one level have more rows than the robot has freedoms.
            GainError: If K_N does not make the null-space error decay.
            MetricError: If the metric does not fit the robot.
        """
        field = Rest(robot) if field is None else field
        metric = IdentityMetric() if metric is None else metric
        levels = _levels(tasks)
        _check_parts(robot, levels, field)
        metric.check(robot.nv)
        if not 0.0 < singularity_threshold < np.inf:
            raise ControllerError(
                f"singularity_threshold is {singularity_threshold}; must be positive"
            )
        self.robot = robot
        self.levels = levels
        self.tasks = tuple(task for level in levels for task in level)
        self.field = field
        self.metric = metric
        self.null_space_gain = _null_space_gain(null_space_gain, robot, metric)
        self._resolution = Resolution(
            [sum(task.rows for task in level) for level in levels],
            robot.nv,
            metric.form,
            self.null_space_gain,
            singularity_threshold,
        )
        problem = self._resolution.problem
        self._stack, self._metric = problem.task, problem.metric
        self.field_sample = problem.field
        ends = np.cumsum([task.rows for task in self.tasks])
        self.task_rows = {
            task.name: slice(int(end) - task.rows, int(end))
            for task, end in zip(self.tasks, ends, strict=True)
        }
        self._samples = tuple(
            (task, self._stack.rows(where.start, where.stop))
            for task, where in zip(self.tasks, self.task_rows.values(), strict=True)
        )

    def compute(self, state: RobotState) -> ControlOutput:
        """Return the effort at a state.

        Raises:
            NonFiniteError: If a task or the field gave something that is not finite;
                an effort that is not finite is never returned.
            ControllerError: If the state is another robot's.
        """
        if state.robot is not self.robot:
            raise ControllerError(
                f"the state is of another robot object ({state.robot.name}); "
                f"this controller is for {self.robot.name}"
            )
        for task, sample in self._samples:
            task.evaluate(state, sample)
        metric = self.metric.evaluate(state, self._metric)
        field = self.field.evaluate(state, metric, self.metric.form, self.field_sample)
        a, e_N, damped, finite = self._resolution.resolve(
            state.v, controls_null_space=self.field.controls
        )
        if not finite:
            self._explain_non_finite(state)
        tau = state.inverse_dynamics(a)  # M a + N, the paper's equation (7)
        return ControlOutput(tau, a, self._stack, field, e_N, damped)

    def diagnose(self, state: RobotState) -> Diagnostics:
        """Return what one would plot, after `compute` at the same state."""
        e_N = self._resolution.null_space_error
        singular_values = self._resolution.singular_values()
        return Diagnostics(
            field_value=self.field.value(state),
            null_space_norm=float(np.sqrt(e_N @ self._metric.W @ e_N)),
            singular_values=singular_values,
            manipulability=float(np.prod(singular_values**2)),
        )

    def flow(self, t: float, q: Array) -> Array:
        """Return v = J# x_d' + P g, shape (nv,): the robot once both errors have died.

        The law makes the robot this first-order flow (law.md §2, Liégeois 1977), so it
        previews a field, and a start with this velocity has no transient.
        """
        state = self.robot.state(t, q, np.zeros(self.robot.nv))
        self.compute(state)
        # At rest, without drift and with unit gain the law's acceleration is the flow.
        rates = [task.reference_rate(state) for task in self.tasks]
        flow = Resolution(
            np.diff(self._resolution.ends, prepend=0).tolist(),
            self.robot.nv,
            min(self.metric.form, CONSTANT),
            np.eye(self.robot.nv),
            self._resolution.threshold,
        )
        flow.problem.task.jacobian[:] = self._stack.jacobian
        flow.problem.task.acceleration[:] = np.concatenate(rates)
        flow.problem.field.g[:] = self.field_sample.g
        flow.problem.metric.W[:], flow.problem.metric.L[:] = self._metric[:2]
        return flow.resolve(state.v).acceleration

    def _explain_non_finite(self, state: RobotState) -> None:
        for task, sample in self._samples:
            if not all(np.isfinite(array).all() for array in sample):
                raise NonFiniteError(
                    f"task {task.name!r} is not finite at t = {state.t:.6g} s; "
                    "does its trajectory return NaN or infinity there?"
                )
        if not all(np.isfinite(array).all() for array in self.field_sample):
            raise NonFiniteError(
                f"field {self.field.name!r} is not finite at t = {state.t:.6g} s"
            )
        raise NonFiniteError(
            f"the effort is not finite at t = {state.t:.6g} s, "
            f"q = {state.q.tolist()}, v = {state.v.tolist()}"
        )


def _levels(tasks: Sequence[Task | Sequence[Task]]) -> tuple[tuple[Task, ...], ...]:
    """Return the tasks level by level; a plain list of tasks is one level."""
    nested = [entry for entry in tasks if not isinstance(entry, Task)]
    if nested and len(nested) != len(tasks):
        raise ControllerError(
            "tasks mixes tasks and lists of tasks; needs a list of tasks (one level) "
            "or a list of lists (one a level)"
        )
    levels = nested or [tasks]
    return tuple(tuple(level) for level in levels)  # type: ignore[arg-type]


def _check_parts(
    robot: Robot, levels: Sequence[Sequence[Task]], field: NullSpaceField
) -> None:
    tasks = [task for level in levels for task in level]
    if not tasks or not all(levels):
        raise ControllerError("a controller needs at least one task, at every level")
    names = [task.name for task in tasks]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ControllerError(f"two tasks are called {twice[0]!r}; give them names")
    parts: list[Task | NullSpaceField] = [*tasks, field]
    for part in parts:
        if part.robot is not robot:
            kind = "task" if isinstance(part, Task) else "field"
            raise ControllerError(
                f"{kind} {part.name!r} was built for another robot object "
                f"({part.robot.name}); build it with the controller's"
            )
    for number, level in enumerate(levels, start=1):
        rows = sum(task.rows for task in level)
        if rows > robot.nv:
            each = ", ".join(f"{task.name}: {task.rows}" for task in level)
            where = f" of level {number}" if len(levels) > 1 else ""
            raise ControllerError(
                f"the tasks{where} have {rows} rows ({each}); "
                f"{robot.name} has only {robot.nv} freedoms"
            )


def _null_space_gain(gain: Any, robot: Robot, metric: Metric) -> Array:
    """Return K_N as a matrix for which V' = -e_NᵀW K_N e_N < 0.

    For the mass matrix W changes with q; there K_N alone is asked to be positive
    definite, and only a multiple of the identity is proved for every q.
    """
    K_N = as_matrix(as_gain(gain, "null_space_gain"), robot.nv, "null_space_gain")
    sample = MetricSample.allocate(robot.nv)
    if metric.form != VARYING:
        state = robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
        metric.evaluate(state, sample)
    decay = sample.W @ K_N
    least = float(np.linalg.eigvalsh(0.5 * (decay + decay.T))[0])
    if least <= 0.0:
        raise GainError(
            "null_space_gain does not make the null-space error decay: the least "
            f"eigenvalue of W K_N is {least:.3g}; must be greater than 0"
        )
    return K_N
