"""Whether a loop is stable at its rate, said before anything moves.

The law makes each task's error, and the null space, a linear system: sampled, delayed
and filtered it has a spectral radius, which is exact where the model is, and which the
nonlinear robot follows closely (theory.md §8; ``docs/robustness.md``).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError, UnstableRateError
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.linear_loop import LinearLoop
from hsp_control.control.compensation.momentum_observer import MomentumObserver
from hsp_control.control.compensation.velocity_filter import VelocityFilter
from hsp_control.control.controller import Controller
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import AngularMomentum

RULE = 0.2
"""Greatest K_N h, and ω0 h without a delay, of a loop that is to be like the law."""
RULE_DELAYED = 0.1
"""Greatest ω0 h with a delay that nothing predicts."""
RULE_HEAVY = 5.0
"""How many times as heavy at its task as its model a robot may be before integral
action makes the error grow; without other compensation that is a rate of Kv/5."""
_ROUNDING = 1e-7
"""Of the eigenvalues: self-motion without a field keeps its place, which is a 1."""
_STEP = 1e-5
"""Of the differences of the field [rad or m]."""


class RateFinding(NamedTuple):
    """What is to be said about one of the loop's parts.

    Attributes:
        path: Where a configuration has the gain.
        message: What is wrong, and the numbers that would do.
        radius: The spectral radius.
        unstable: Whether it grows; else it only misses the rule of design.
    """

    path: tuple[str, ...]
    message: str
    radius: float
    unstable: bool


def check_rate(
    controller: Controller,
    q: Array,
    period: float,
    compensation: Compensation | None = None,
    *,
    effort_delay: int | None = None,
    sensor_delay: int | None = None,
) -> list[RateFinding]:
    """Refuse a loop that is unstable at its rate; return what misses the rule.

    The arguments are those of `rate_findings`.

    Raises:
        UnstableRateError: With the number that is too large, and those that would do.
    """
    found = rate_findings(
        controller,
        q,
        period,
        compensation,
        effort_delay=effort_delay,
        sensor_delay=sensor_delay,
    )
    for finding in found:
        if finding.unstable:
            raise UnstableRateError(finding.message)
    return found


def rate_findings(
    controller: Controller,
    q: Array,
    period: float,
    compensation: Compensation | None = None,
    *,
    effort_delay: int | None = None,
    sensor_delay: int | None = None,
) -> list[RateFinding]:
    """Return what is to be said of each task and of the null space.

    Args:
        controller: The controller.
        q: Where the field's slope is taken, shape (nq,): the start.
        period: The control period h [s].
        compensation: What is around the law.
        effort_delay: Periods that efforts come late; None: what the predictor says.
        sensor_delay: Periods that measurements are old; None: the same.
    """
    compensation = Compensation() if compensation is None else compensation
    known = compensation.predictor
    if effort_delay is None:
        effort_delay = 0 if known is None else known.effort_delay
    if sensor_delay is None:
        sensor_delay = 0 if known is None else known.sensor_delay
    delays = effort_delay, sensor_delay, compensation
    state = controller.robot.state(0.0, q, np.zeros(controller.robot.nv))
    found = [
        *_task_findings(controller, period, delays),
        *_null_space_findings(controller, state, period, delays),
    ]
    return [finding for finding in found if finding is not None]


_Delays = tuple[int, int, Compensation]


def _task_findings(
    controller: Controller, period: float, delays: _Delays
) -> list["RateFinding | None"]:
    action = delays[2].integral_action
    integral = {} if action is None else action.gains(controller.tasks)
    found = []
    for task in controller.tasks:
        zero = np.zeros_like(task.Kp)
        Ki = integral.get(task.name, zero)
        if isinstance(task, AngularMomentum):  # of first order: only a rate
            loop = LinearLoop(
                zero, task.rate * np.eye(task.rows), zero, period, *delays
            )
            words = f"K of task {task.name!r}", task.rate
            path: tuple[str, ...] = ("tasks", task.name)
        else:
            loop = LinearLoop(task.Kp, task.Kv, Ki, period, *delays)
            frequency = float(np.sqrt(np.abs(np.linalg.eigvals(task.Kp)).max()))
            words = f"ω0 of task {task.name!r}", frequency
            path = ("tasks", task.name, "gains")
        delayed = delays[0] + delays[1] > 0 and delays[2].predictor is None
        rule = RULE_DELAYED if delayed else RULE
        found.append(_finding(path, loop, words, rule, ""))
        if task.name in integral:
            found.append(_integral_finding(task.name, loop))
    return found


def _integral_finding(name: str, loop: LinearLoop) -> RateFinding | None:
    """Return what is to be said of integral action on a robot unlike its model."""
    heavy = replace(loop, share=1.0 / RULE_HEAVY)
    if heavy.radius() <= 1.0 + _ROUNDING:
        return None
    times = _largest(
        lambda s: replace(loop, share=1.0 / (s * RULE_HEAVY)), 1.0 / RULE_HEAVY
    )
    if times is None:  # with its model, too: that has been said
        return None
    scale = _largest(lambda s: replace(heavy, ki=s * heavy.ki))
    less = "" if scale is None else f" Ki of at most {_rounded(scale)} times this, or"
    faster = "" if loop.compensation.momentum_observer is None else " faster"
    return RateFinding(
        ("compensation", "integral_action"),
        f"where the robot is {times * RULE_HEAVY:.3g} times as heavy at task {name!r} "
        f"as its model, as with a payload, the error grows; design for {RULE_HEAVY:g}:"
        f"{less} a{faster} momentum observer",
        loop.radius(),
        False,
    )


def _null_space_findings(
    controller: Controller, state: RobotState, period: float, delays: _Delays
) -> list["RateFinding | None"]:
    K, A = null_space_rates(controller, state)
    if not K.size:
        return []
    stiffness = float(np.linalg.eigvalsh(A).max())
    gain = float(np.abs(np.linalg.eigvals(K)).max())
    loop = LinearLoop(K @ A, K + A, np.zeros_like(K), period, *delays)
    beside = "" if stiffness < 1e-3 * gain else (
        f", with a field of stiffness {stiffness:.4g} 1/s"
    )  # fmt: skip
    words = "K_N", gain
    found = [_finding(("null_space", "gain"), loop, words, RULE, beside, (K, A))]
    if found[0] is None and stiffness * period > RULE:
        found = [
            RateFinding(
                ("null_space", "fields"),
                f"the field's stiffness times the period is {stiffness * period:.3g} "
                f"at the start; design at no more than {RULE:g}: weights of at most "
                f"{RULE / stiffness / period:.3g} times these, or a control_period of "
                f"at most {RULE / stiffness:.3g} s",
                loop.radius(),
                False,
            )
        ]
    return found


def null_space_rates(controller: Controller, state: RobotState) -> tuple[Array, Array]:
    """Return K_N and the field's slope A ≥ 0 in the null space, shape (k, k) each.

    In coordinates orthonormal in the metric. A is the symmetric part of -∂g/∂q, by
    central differences; where the field drives away from something (a saddle of its
    cost) it is taken for flat: no rate makes that stable, and none needs to.
    """
    nothing = np.zeros((0, 0))
    if not controller.field.controls:
        return nothing, nothing
    J = controller.stack(state).jacobian
    L = controller.mode.resolution.problem.metric.L
    across = np.linalg.solve(L, J.T).T  # J L⁻ᵀ
    _, values, Vt = np.linalg.svd(across)
    rank = int((values > controller.mode.resolution.threshold).sum())
    Z = Vt[rank:].T
    if not Z.size:
        return nothing, nothing
    into, out_of = L.T, np.linalg.inv(L.T)
    A = -Z.T @ into @ field_slope(controller, state) @ out_of @ Z
    values, U = np.linalg.eigh(0.5 * (A + A.T))
    A = (U * np.maximum(values, 0.0)) @ U.T
    return Z.T @ into @ controller.null_space_gain @ out_of @ Z, A


def field_slope(controller: Controller, state: RobotState) -> Array:
    """Return ∂g/∂q at a state, shape (nv, nv), by central differences."""
    robot: Robot = state.robot
    nv, metric = robot.nv, MetricSample.allocate(robot.nv)
    out, slope = FieldSample.allocate(nv), np.zeros((nv, nv))
    for i in range(nv):
        for sign in (1.0, -1.0):
            moved = np.zeros(nv)
            moved[i] = sign * _STEP
            near = state.displaced(0.0, moved)
            controller.metric.evaluate(near, metric)
            controller.field.evaluate(near, metric, controller.metric.form, out)
            slope[:, i] += sign * out.g / (2.0 * _STEP)
    return slope


def _finding(
    path: tuple[str, ...],
    loop: LinearLoop,
    words: tuple[str, float],
    rule: float,
    beside: str,
    null_space: tuple[Array, Array] | None = None,
) -> RateFinding | None:
    radius, (what, gain), h = loop.radius(), words, loop.period
    known = f"{what} times the period is {gain * h:.3g}{beside}"
    if radius > 1.0 + _ROUNDING:
        choices = _what_would_do(loop, what, gain, null_space)
        would = (
            f"{' or '.join(choices)} would do"
            if choices
            else "no rate would do: lower the integral gain or the filter's lag"
        )
        late = loop.effort_delay + loop.sensor_delay
        delay = f", {late} period{'s' * (late > 1)} late" if late else ""
        return RateFinding(
            path,
            f"unstable at this rate: {known}{delay} (a period multiplies the motion by "
            f"up to {radius:.4g}): {would}",
            radius,
            True,
        )
    if gain * h > rule * (1.0 + 1e-9):
        return RateFinding(
            path,
            f"{known}; design at no more than {rule:g}: {what} of at most "
            f"{rule / h:.3g} 1/s, or a control_period of at most {rule / gain:.3g} s",
            radius,
            False,
        )
    return None


def _what_would_do(
    loop: LinearLoop,
    what: str,
    gain: float,
    null_space: tuple[Array, Array] | None,
) -> list[str]:
    """Return the settings that would each make the loop stable, all else as it is."""

    def gains(s: float) -> LinearLoop:
        if null_space is None:
            return replace(loop, kp=s**2 * loop.kp, kv=s * loop.kv, ki=s**3 * loop.ki)
        K, A = null_space
        return replace(loop, kp=s * K @ A, kv=s * K + A)

    own, choices = loop.compensation, []
    if (s := _largest(gains)) is not None:
        choices.append(f"{what} of at most {_rounded(s * gain)} 1/s")
    if null_space is not None and null_space[1].max() > 1e-3 * gain:
        K, A = null_space

        def weights(s: float) -> LinearLoop:
            return replace(loop, kp=s * K @ A, kv=K + s * A)

        if (s := _largest(weights)) is not None:
            choices.append(f"fields of at most {_rounded(s)} times these weights")
    if (s := _largest(lambda s: replace(loop, period=s * loop.period))) is not None:
        choices.append(f"a control_period of at most {_rounded(s * loop.period)} s")
    if own.momentum_observer is not None:
        rate = own.momentum_observer.bandwidth

        def observer(s: float) -> LinearLoop:
            slower = MomentumObserver(s * rate)
            return replace(loop, compensation=replace(own, momentum_observer=slower))

        if (s := _largest(observer)) is not None:
            choices.append(
                f"momentum_observer.bandwidth of at most {_rounded(s * rate)} 1/s"
            )
    if own.velocity_filter is not None:
        filter_ = own.velocity_filter

        def wider(s: float) -> LinearLoop:
            other = VelocityFilter(filter_.cutoff / s, filter_.order)
            return replace(loop, compensation=replace(own, velocity_filter=other))

        # Up to 0.45 of the rate: there a filter does next to nothing.
        if (s := _largest(wider, filter_.cutoff * loop.period / 0.45)) is not None:
            choices.append(
                f"velocity_filter.cutoff of at least {filter_.cutoff / s * 1.01:.3g} Hz"
            )
    return choices


def _largest(
    of_scale: Callable[[float], LinearLoop], least: float = 1e-3
) -> float | None:
    """Return the largest scale below 1 at which a loop is stable, if there is one.

    Stable at ``least``, too, and in between: a gap would be no advice.
    """

    def stable(s: float) -> bool:
        try:
            return of_scale(s).radius() <= 1.0 + _ROUNDING
        except CompensationError:  # a filter beyond half of the rate
            return False

    tried = np.geomspace(1.0, min(least, 1.0), 31)
    good = [stable(float(s)) for s in tried]
    if not good[-1]:
        return None
    first = max(k for k, fine in enumerate(good) if not fine) + 1
    low, high = float(tried[first]), float(tried[first - 1])
    for _ in range(14):  # to 1e-5 of it
        middle = np.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _rounded(value: float) -> str:
    """Return three digits, rounded down: what is advised must do."""
    exponent = int(np.floor(np.log10(value))) - 2
    unit = 10.0**exponent
    return f"{np.floor(value / unit + 1e-6) * unit:.10g}"
