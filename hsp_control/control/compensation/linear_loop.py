"""Sampled control loops of linear errors: rigid, elastic, or loaded by other bodies."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import exp
from typing import Literal, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.momentum_observer import low_pass
from hsp_control.control.controller import Controller
from hsp_control.law import FieldSample, MetricSample
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.state import as_given


@dataclass(frozen=True)
class ElasticJoint:
    """An elastic joint with a rigid model: a motor moves a link through a spring.

    M. W. Spong, "Modeling and control of elastic joint robots", J. Dyn. Sys. Meas.
    Control 109 (1987), for one joint. With the inertias relative to the model's,

        λ x'' = κ (θ - x) + δ (θ' - x'),     μ θ'' = u - κ (θ - x) - δ (θ' - x').
    """

    link: float  # λ, the link's inertia over that of the model [-]
    # μ, the motor's inertia over that of the model [-]; λ + μ = 1 if only the spring is
    # unmodelled
    motor: float
    stiffness: float  # κ, the spring's stiffness over the model's inertia [1/s²]
    damping: float = 0.0  # δ, its damping over the model's inertia [1/s]
    # where position and velocity are measured
    measured: Literal["motor", "link"] = "motor"

    def transition(self, period: float) -> tuple[Array, Array]:
        """Return Φ, shape (4, 4), and Γ, shape (4,), of (x, x', θ, θ') over a period.

        The acceleration u is held: the state becomes Φ s + Γ u.
        """
        from scipy.linalg import expm  # here: importing SciPy is slow

        spring = np.array(
            [-self.stiffness, -self.damping, self.stiffness, self.damping]
        )
        rates = np.zeros((5, 5))
        rates[0, 1] = rates[2, 3] = 1.0
        rates[1, :4], rates[3, :4] = spring / self.link, -spring / self.motor
        rates[3, 4] = 1.0 / self.motor
        after = expm(rates * period)
        return after[:4, :4], after[:4, 4]


_NOTHING = 1e-12
"""Coupling of two rows, relative to the gains, below which it is rounding."""


@dataclass(frozen=True)
class LinearLoop:
    """The loop x'' = u, held over a period h, with u = -Kp x - Kv x' - Ki ∫x.

    x is the error of a task, or that of the null space, with Kp = K_N A, Kv = K_N + A
    for a field g of slope -A. The loop includes delays and compensators, in the order
    of `CompensatedController`. The robot equals its model, or performs a part of each
    acceleration.
    """

    kp: Array  # Kp, shape (m, m) [1/s²]
    kv: Array  # Kv, shape (m, m) [1/s]
    ki: Array  # Ki, shape (m, m) [1/s³]
    period: float  # h [s]
    effort_delay: int = 0  # delay of efforts, in periods
    sensor_delay: int = 0  # delay of measurements, in periods
    # in the loop: velocity filter, predictor, momentum observer; integral action is ki
    compensation: Compensation = field(
        default_factory=lambda: Compensation(momentum_observer=None)
    )
    # fraction of u that the robot performs: below 1 if it is heavier than its model; a
    # matrix, shape (m, m), if it depends on the direction
    share: float | Array = 1.0
    # elastic joint that performs u; None: a rigid one
    joint: ElasticJoint | None = None
    # time constant of drives of first order, which follow u [s]; 0: they are u
    lag: float = 0.0
    # further acceleration of a rigid robot near x = 0: x'' = share u + slope x, shape
    # (m, m) [1/s²]; weight that the model does not explain
    slope: Array | None = None

    def transition(self) -> Array:
        """Return the transition matrix over one period, of the robot and all memory."""
        m, own = len(self.kp), self.compensation
        ahead = 0 if own.predictor is None else own.predictor.periods
        moving = 2 if self.joint is None else 4
        # x, v, and those of an elastic joint's motor; ∫x, the drive, the observer's two
        # states (the second is r), the last momentum; the filter's memory; the efforts
        # sent, for the observer and the predictor; the efforts and measurements under
        # way.
        counts = [moving, 5, 4, 1 + ahead, self.effort_delay, 2 * self.sensor_delay]
        size = m * sum(counts)
        basis = np.eye(size).reshape(-1, m, size)
        parts = np.split(basis, np.cumsum(counts)[:-1])
        after = self._step(*([*part] for part in parts))
        return np.concatenate(after).reshape(size, size)

    def radius(self) -> float:
        """Return the spectral radius: the loop is stable if it is below 1."""
        gains = np.array([self.kp, self.kv, self.ki])
        between = np.abs(gains - gains * np.eye(len(self.kp))).max()
        alone = between <= _NOTHING * np.abs(gains).max()
        if len(self.kp) > 1 and np.ndim(self.share) == 0 and alone:
            # Decoupled rows are separate small loops.
            rows = gains.diagonal(axis1=1, axis2=2).T
            same = np.round(rows / (_NOTHING + np.abs(gains).max()), 12)
            rows = rows[np.unique(same, axis=0, return_index=True)[1]]
            ones = (row.reshape(3, 1, 1) for row in rows)
            return max(replace(self, kp=p, kv=v, ki=i).radius() for p, v, i in ones)
        return float(np.abs(np.linalg.eigvals(_coupled(self.transition()))).max())

    def _step(
        self,
        plant: list[Array],
        memory: list[Array],
        past: list[Array],
        sent: list[Array],
        drives: list[Array],
        sensors: list[Array],
    ) -> list[Array]:
        """Return all states one period later, in the order of the arguments."""
        (z, drive, first, r, momentum), h, own = memory, self.period, self.compensation
        observer = own.observer
        on_motor = self.joint is not None and self.joint.measured == "motor"
        sensors = [*sensors, *(plant[2:] if on_motor else plant[:2])]
        x_seen, v_seen, sensors = sensors[0], sensors[1], sensors[2:]
        if own.velocity_filter is not None:
            v_seen, kept = own.velocity_filter.step(v_seen, tuple(past), h)
            past = [*kept]
        else:
            past = [0.0 * each for each in past]
        if observer is not None:
            disturbance = (v_seen - momentum) / h - sent[0]
            states: tuple[Array, ...] = (first, r)[-observer.order :]
            states = low_pass(disturbance, states, observer.bandwidth, h)
            first, r = states[0], states[-1]
            momentum = v_seen
        else:
            first, r, momentum = 0.0 * first, 0.0 * r, 0.0 * momentum
        for u in sent[1:]:
            x_seen, v_seen = _moved(x_seen, v_seen, u + r, h)
        u = -self.kp @ x_seen - self.kv @ v_seen - self.ki @ z
        if observer is not None and observer.cancel:
            u = u - r
        integrated = np.any(self.ki != 0.0, axis=0, keepdims=True).T
        z = np.where(integrated, z + h * x_seen, 0.0)
        drives = [*drives, u]
        asked, drives = drives[0], drives[1:]
        plant = self._after(plant, asked, drive)
        drive = asked + self._left * (drive - asked) if self.lag else 0.0 * drive
        rest = [*past, *sent[1:], u, *drives, *sensors]
        memory = [z, drive, first, r, momentum]
        return [each[None] for each in (*plant, *memory, *rest)]

    @property
    def _left(self) -> float:
        """The part of a drive's difference from u that is left after a period."""
        return exp(-self.period / self.lag) if self.lag else 0.0

    def _after(self, plant: list[Array], u: Array, drive: Array) -> list[Array]:
        """Return the plant's state one period later, under the acceleration u."""
        h, lag, late = self.period, self.lag, drive - u
        # The drive is u + late exp(-t/lag); once and twice integrated over the period:
        once, twice = lag * (1.0 - self._left), 0.0
        if lag:
            twice = lag * h - lag * once
        if self.joint is None:
            acceleration = self._performed(u)
            if self.slope is not None:
                acceleration = acceleration + self.slope @ plant[0]
            x, v = _moved(plant[0], plant[1], acceleration, h)
            late = self._performed(late)
            return [x + twice * late, v + once * late]
        transition, effect = self.joint.transition(h)
        moved = np.tensordot(transition, np.array(plant), axes=1)
        u = self._performed(u + once / h * late)
        return [*(moved + effect[:, None, None] * u)]

    def _performed(self, u: Array) -> Array:
        """Return the robot's acceleration under the command u."""
        share = np.asarray(self.share)
        return share @ u if share.ndim else share * u


def _moved(x: Array, v: Array, u: Array, h: float) -> tuple[Array, Array]:
    return x + h * v + 0.5 * h * h * u, v + h * u


def _coupled(A: Array) -> Array:
    """Return the matrix without states that are never written or never read."""
    # Such states only add eigenvalues of 0. A loop without compensators and delays uses
    # a sixth of all states.
    while not (used := A.any(axis=0) & A.any(axis=1)).all():
        A = A[np.ix_(used, used)]
    return A


_STEP = 1e-5
"""Step of the differences [rad or m]."""


def null_space_rates(controller: Controller, state: RobotState) -> tuple[Array, Array]:
    """Return K_N and the field's slope A ≥ 0 in the null space, shapes (k, k)."""
    # Both are in coordinates that are orthonormal in the metric. A is the symmetric
    # part of -∂g/∂q, by central differences, `without_saddles`.
    nothing = np.zeros((0, 0))
    if not controller.field.controls:
        return nothing, nothing
    stack = controller.stack_at(state)
    J, L = stack.rows.jacobian, stack.law.problem.metric.L
    across = np.linalg.solve(L, J.T).T  # J L⁻ᵀ
    _, values, Vt = np.linalg.svd(across)
    rank = int((values > stack.law.threshold).sum())
    Z = Vt[rank:].T
    if not Z.size:
        return nothing, nothing
    into, out_of = L.T, np.linalg.inv(L.T)
    A = -Z.T @ into @ field_slope(controller, state) @ out_of @ Z
    K = Z.T @ into @ controller.null_space_gain @ out_of @ Z
    return K, without_saddles(A)


def without_saddles(A: Array) -> Array:
    """Return the symmetric part of a slope, with 0 for its negative eigenvalues."""
    # There the field drives the robot away from a point (a saddle of its cost), which
    # is intended, and no control rate changes it.
    values, U = np.linalg.eigh(0.5 * (A + A.T))
    stable: Array = (U * np.maximum(values, 0.0)) @ U.T
    return stable


def field_slope(controller: Controller, state: RobotState) -> Array:
    """Return ∂g/∂q at a state, shape (nv, nv), by central differences."""
    nv, metric = state.robot.nv, MetricSample.allocate(state.robot.nv)
    out, slope = FieldSample.allocate(nv), np.zeros((nv, nv))
    for i in range(nv):
        for sign in (1.0, -1.0):
            moved = np.zeros(nv)
            moved[i] = sign * _STEP
            near = state.displaced(0.0, moved)
            own, field = controller.metric, controller.field
            own.evaluate(as_given(own, near), metric)
            field.evaluate(as_given(field, near), metric, own.form, out)
            slope[:, i] += sign * out.g / (2.0 * _STEP)
    return slope


NO_GAINS = (np.zeros((0, 0)),) * 3
"""Kp, Kv and Ki of a loop that represents its chain."""


class LoadedLoop(NamedTuple):
    """The loop of a whole robot, for any part of its difference from the model.

    A robot with the mass matrix M̃ performs M̃⁻¹ M u where the law commands the
    acceleration u. That couples the tasks and the null space, which the law decouples
    for its model. In coordinates y = T δq with T = Vᵀ Lᵀ, orthonormal in the metric
    W = L Lᵀ, and J L⁻ᵀ = U [S 0] Vᵀ, all are one linear loop:

        y'' = T M̃⁻¹ M T⁻¹ u + T M̃⁻¹ (∂(G - G̃)/∂q) T⁻¹ y,
        u₁ = -S⁻¹ Uᵀ (Kp e + Kv e' + Ki ∫e),     e = U S y₁,
        u₂ = -(K_N + A₂₂) y₂' - K_N A₂ y - A₂₁ y₁',

    with the field's slope A = -T (∂g/∂q) T⁻¹, without saddles, and the gravity G of the
    model and G̃ of the robot. It is that about a state at rest; the small one to which
    the difference of the weights has moved the robot is taken for the model's.
    """

    loop: LinearLoop  # loop of a robot that equals its model
    # M̃ - M in the loop's coordinates, relative to M: T M⁻¹ (M̃ - M) T⁻¹
    difference: Array
    # how many times as heavy as its model the robot is at the tasks, in the heaviest
    # direction: 1/β with the smallest eigenvalue β of J M̃⁻¹ M J#
    heavier: float
    # T M⁻¹ (∂(G - G̃)/∂q) T⁻¹: how the unexplained weight changes beside the state
    slope: Array

    def largest_part(self, wanted: float) -> float:
        """Return this fraction, bounded so that a tenth of the mass remains."""
        lightest = float(np.linalg.eigvals(self.difference).real.min())
        return wanted if lightest >= 0.0 else min(wanted, -0.9 / lightest)

    def with_part(self, s: float) -> LinearLoop:
        """Return the loop of a robot with s times the difference."""
        one = np.eye(len(self.difference))
        share: Array = np.asarray(np.linalg.inv(one + s * self.difference), float)
        return replace(self.loop, share=share, slope=share @ (s * self.slope))


class WholeLoop(NamedTuple):
    """The loop of tasks and null space together, for a robot that is its model.

    Its coordinates are y = T δq; see `LoadedLoop`.
    """

    loop: LinearLoop
    into: Array  # T, shape (nv, nv)
    to_error: Array  # U S, shape (m, m): e = U S y₁, of the task's rows
    task_rows: Mapping[str, slice]  # the rows of each task, by name


def whole_loop(
    controller: Controller, state: RobotState, chain: LinearLoop
) -> WholeLoop | None:
    """Return the loop of the whole robot at a state, with the chain of another loop.

    None where the law is damped or leaves motion free, and for a floating base.
    """
    robot = controller.robot
    if robot.unactuated or controller.contacts:
        return None
    stack = controller.stack_at(state)
    J, L = stack.rows.jacobian, stack.law.problem.metric.L
    U, S, Vt = np.linalg.svd(np.linalg.solve(L, J.T).T)
    m, n = J.shape
    if m > n or S.min(initial=np.inf) <= stack.law.threshold:
        return None
    if m < n and not controller.field.controls:
        return None
    T = Vt @ L.T
    back = np.linalg.inv(T)
    into, out_of = (U / S).T, U * S  # S⁻¹ Uᵀ and U S
    rows = stack.task_rows
    Kp, Kv, Ki = (np.zeros((m, m)) for _ in range(3))
    action = chain.compensation.integral_action
    integral = {} if action is None else action.gains(controller.tasks)
    for task in controller.tasks:
        if (at := rows.get(task.name)) is None:
            continue
        own_p, own_v, *_ = controller._linear_feedback(task.name, state)[-np.inf]
        if task.order == 1:  # e' + K e = 0 with K in the place of Kp
            own_p, own_v = np.zeros_like(own_p), own_p
        Kp[at, at], Kv[at, at] = own_p, own_v
        if task.name in integral:
            Ki[at, at] = integral[task.name]
    kp, kv, ki = (np.zeros((n, n)) for _ in range(3))
    for gain, own in ((kp, Kp), (kv, Kv), (ki, Ki)):
        gain[:m, :m] = into @ own @ out_of
    if m < n:
        A = -(T @ field_slope(controller, state) @ back)[m:]
        A[:, m:] = without_saddles(A[:, m:])
        K = (T @ controller.null_space_gain @ back)[m:, m:]
        kp[m:], kv[m:] = K @ A, A
        kv[m:, m:] += K
    return WholeLoop(replace(chain, kp=kp, kv=kv, ki=ki), T, out_of, rows)


def loaded_loop(
    controller: Controller, state: RobotState, plant: Robot, chain: LinearLoop
) -> LoadedLoop | None:
    """Return the loop of a robot with other bodies; see `whole_loop`.

    None also where the bodies are the model's.
    """
    robot, M = controller.robot, state.mass_matrix
    others = plant.state(state.t, state.q, state.v).mass_matrix - M
    weight = weight_slope(robot, state.q) - weight_slope(plant, state.q)
    if np.abs(others).max() < 1e-9 and np.abs(weight).max() < 1e-6:
        return None
    whole = whole_loop(controller, state, chain)
    if whole is None:
        return None
    T, out_of = whole.into, whole.to_error
    back, m, n = np.linalg.inv(T), len(out_of), robot.nv
    difference = T @ np.linalg.solve(M, others) @ back
    performed = np.linalg.inv(np.eye(n) + difference)
    beta = np.linalg.eigvals(out_of @ performed[:m, :m] @ np.linalg.inv(out_of))
    least = float(beta.real.min()) if m else 1.0  # without tasks the field alone
    slope = T @ np.linalg.solve(M, weight) @ back
    return LoadedLoop(whole.loop, difference, 1.0 / least, slope)


def weight_slope(robot: Robot, q: Array) -> Array:
    """Return ∂G/∂q of a robot, shape (nv, nv) [N·m/rad]."""
    slope, rest = np.zeros((robot.nv, robot.nv)), np.zeros(robot.nv)
    for i in range(robot.nv):
        for sign in (1.0, -1.0):
            moved = np.zeros(robot.nv)
            moved[i] = sign * _STEP
            weight = robot.inverse_dynamics(robot.integrate(q, moved), rest, rest)
            slope[:, i] += sign * weight / (2.0 * _STEP)
    return slope
