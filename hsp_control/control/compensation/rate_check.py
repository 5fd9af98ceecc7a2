"""Checks before a run whether the control loop is stable at its rate.

The law makes each task's error, and the null space, a linear system. Sampled, delayed
and filtered, this system has a spectral radius. The radius is exact for an exact model,
and the nonlinear robot agrees closely with it (``docs/robustness.md``).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError, UnstableRateError
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.linear_loop import (
    NO_GAINS,
    LinearLoop,
    LoadedLoop,
    loaded_loop,
    null_space_rates,
)
from hsp_control.control.controller import Controller
from hsp_control.control.gains_in_force import rounded_down
from hsp_control.declaration import within
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of

RULE = 0.2
"""Recommended maximum of K_N h, and of ω0 h without delay: up to it the loop is close
to the law."""
RULE_DELAYED = 0.1
"""Recommended maximum of ω0 h with a delay and no predictor."""
RULE_LOADED = 1.5
"""A known plant must be stable with its difference from the model scaled by this
factor: it may be that large at other states."""
RULE_HEAVY = 5.0
"""Integral action must be stable for a robot up to this many times as heavy at a task
as its model. Without other compensators this is a rate of Kv/5."""
SLOWEST_GROWTH = 0.02
"""Rate of growth that is reported [1/s]: slower ones need a minute to be seen."""
_LONG = 50
"""Longer delays [periods] are first compared with the longest tolerated one: the matrix
of a loop grows with its delay."""
_ROUNDING = 1e-7
"""Tolerance of the radius: self-motion without a field has eigenvalues of 1."""


class RateFinding(NamedTuple):
    """A problem of one task, or of the null space, at the control rate.

    Attributes:
        path: Key path of the gain in a configuration.
        message: The problem, and values that solve it.
        radius: The spectral radius.
        unstable: Whether the loop is unstable; otherwise it only violates a design
            rule.
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
    effort_lag: float = 0.0,
    plant: Robot | None = None,
    strict: bool = True,
) -> list[RateFinding]:
    """Return the problems of the tasks and of the null space at a control rate.

    Args:
        controller: The controller.
        q: The configuration at which the loop is looked at, shape (nq,).
        period: The control period [s].
        compensation: The compensators; None: there are none. An observer that is
            ``auto`` is that of a real robot.
        effort_delay: Delay of efforts, in periods; None: that of the predictor.
        sensor_delay: Delay of measurements, in periods; None: that of the predictor.
        effort_lag: Time constant of drives of first order [s]; 0: they do not lag.
        plant: The robot that moves, where it is known to differ from the model.
        strict: Whether it is an error if the loop is unstable.

    Raises:
        UnstableRateError: If the loop is unstable, unless `strict` is false.
    """
    if compensation is None:
        compensation = Compensation(momentum_observer=None)
    compensation = compensation.decided(controller, period, exact=False)
    if compensation.velocity_filter is not None:
        with within("compensation", "velocity_filter"):
            compensation.velocity_filter.coefficients(period)
    known = compensation.predictor
    if effort_delay is None:
        effort_delay = 0 if known is None else known.effort_delay
    if sensor_delay is None:
        sensor_delay = 0 if known is None else known.sensor_delay
    delays = _Chain(effort_delay, sensor_delay, compensation, effort_lag)
    state = controller.robot.state(0.0, q, np.zeros(controller.robot.nv))
    found = [
        *_task_findings(controller, controller.tasks, state, period, delays),
        *_null_space_findings(controller, state, period, delays),
    ]
    if plant is not None and not any(each and each.unstable for each in found):
        loaded = loaded_loop(controller, state, plant, delays.loop(*NO_GAINS, period))
        found.append(None if loaded is None else _loaded_finding(loaded))
    problems = [finding for finding in found if finding is not None]
    for finding in problems:
        if strict and finding.unstable:
            with within(*finding.path):
                raise UnstableRateError(finding.message)
    return problems


class _Chain(NamedTuple):
    """The delays and compensators between the law and the robot."""

    effort_delay: int
    sensor_delay: int
    compensation: Compensation
    lag: float

    def loop(self, kp: Array, kv: Array, ki: Array, period: float) -> LinearLoop:
        """Return the loop of these gains."""
        delays = self.effort_delay, self.sensor_delay
        return LinearLoop(kp, kv, ki, period, *delays, self.compensation, lag=self.lag)


def _task_findings(
    controller: Controller,
    tasks: Sequence[Task],
    state: RobotState,
    period: float,
    delays: _Chain,
) -> list["RateFinding | None"]:
    action = delays.compensation.integral_action
    integral = {} if action is None else action.gains(controller.tasks)
    found: list[RateFinding | None] = []
    for task in tasks:
        feedbacks = controller._linear_feedback(task.name, state)
        for since, (Kp, Kv, *_) in feedbacks.items():
            Ki = integral.get(task.name, np.zeros_like(Kp))
            found += _findings_of(task, Kp, Kv, Ki, since, period, delays)
    return found


def _findings_of(
    task: Task,
    Kp: Array,
    Kv: Array,
    Ki: Array,
    since: float,
    period: float,
    delays: _Chain,
) -> list["RateFinding | None"]:
    """Return the problems of a task with these gains, in force from a time on [s]."""
    name, zero = task.name, np.zeros_like(Kp)
    of = f"of task {name!r}" + (f" from t = {since:g} s on" if since > -np.inf else "")
    if task.order == 1:  # e' + K e = 0 with K in the place of Kp
        loop = delays.loop(zero, Kp.copy(), zero, period)
        speed = _of_gain(f"K {of}", float(np.diag(Kp).max()))
        path: tuple[str, ...] = ("tasks", name)
    else:
        loop = delays.loop(Kp.copy(), Kv.copy(), Ki, period)
        frequency = float(np.sqrt(np.abs(np.linalg.eigvals(Kp)).max()))
        path = ("tasks", name, "gains")
        speed = _of_gain(f"ω0 {of}", frequency)
        if impedance_of(task) is not None:
            path = ("tasks", name, "impedance")
            damped = 0.5 * float(np.abs(np.linalg.eigvals(Kv)).max())
            of += "" if since > -np.inf else " at the start"
            speed = _of_impedance(of, frequency, damped)
    late = delays.effort_delay + delays.sensor_delay > 0
    delayed = late and delays.compensation.predictor is None
    if since > -np.inf:  # of a change; the message names it and its time
        path = ("changes",)
    found = [_finding(path, loop, speed, RULE_DELAYED if delayed else RULE, "")]
    if Ki.any():
        found.append(_integral_finding(name, loop))
    return found


class _Speed(NamedTuple):
    """The bandwidth of a loop, and the way to reduce it."""

    what: str  # the decisive setting
    rate: float  # its rate [1/s]
    # settings for another rate, as a function of it [1/s]
    at_most: Callable[[float], str]


def _of_gain(what: str, rate: float) -> _Speed:
    return _Speed(what, rate, lambda x: f"{what} of at most {rounded_down(x)} 1/s")


def _of_impedance(of: str, frequency: float, damped: float) -> _Speed:
    """Return the speed of an impedance: √(K/Λ), or D/(2Λ) if that is larger."""
    rate = max(frequency, damped)
    what = f"√(stiffness/inertia) {of}"
    if damped > frequency * (1.0 + 1e-9):
        what = f"damping/(2 inertia) {of}"

    def at_most(x: float) -> str:
        s = x / rate
        return (
            f"at most {rounded_down(s * s)} times this stiffness and "
            f"{rounded_down(s)} times this damping"
        )

    return _Speed(what, rate, at_most)


def _integral_finding(name: str, loop: LinearLoop) -> RateFinding | None:
    """Return the problem of integral action on a robot heavier than its model."""
    heavy = replace(loop, share=1.0 / RULE_HEAVY)
    if heavy.radius() <= 1.0 + _ROUNDING:
        return None
    times = _largest(
        lambda s: replace(loop, share=1.0 / (s * RULE_HEAVY)), 1.0 / RULE_HEAVY
    )
    if times is None:  # unstable with the exact model, too: already reported
        return None
    scale = _largest(lambda s: replace(heavy, ki=s * heavy.ki))
    less = (
        "" if scale is None else f" Ki of at most {rounded_down(scale)} times this, or"
    )
    faster = "" if loop.compensation.observer is None else " faster"
    return RateFinding(
        ("compensation", "integral_action"),
        f"if the robot is {times * RULE_HEAVY:.3g} times as heavy at task {name!r} as "
        "its model, for example with a payload, the error grows; design for a factor "
        f"of {RULE_HEAVY:g}: use{less} a{faster} momentum observer",
        loop.radius(),
        False,
    )


def _loaded_finding(loaded: LoadedLoop) -> RateFinding | None:
    """Return the problem of a robot whose bodies differ from the model's."""
    part = loaded.largest_part(RULE_LOADED)
    wanted = loaded.with_part(part)
    if wanted.radius() <= 1.0 + _ROUNDING:
        return None
    if replace(wanted, slope=None).radius() <= 1.0 + _ROUNDING:
        return _weight_finding(loaded)
    times = _largest(lambda s: loaded.with_part(s * part))
    if times is None:  # unstable with the exact model, too
        return _weight_finding(loaded)
    radius = loaded.with_part(1.0).radius()
    grows = (
        f"grows by a factor of up to {radius:.6g} per period"
        if radius > 1.0 + _ROUNDING
        else f"grows if they differ {times * part:.3g} times as much"
    )
    choices, path = [], ("simulation", "control_period")
    if loaded.loop.ki.any():
        path = ("compensation", "integral_action")
        if (s := _largest(lambda s: replace(wanted, ki=s * wanted.ki))) is not None:
            choices.append(f"Ki of at most {rounded_down(s)} times this")
        running = loaded.loop.compensation.observer is not None
        choices.append(f"a {'faster ' if running else ''}momentum observer")
    if not choices:
        choices.append("smaller gains or a shorter control_period")
    return RateFinding(
        path,
        f"the plant's bodies differ from the model's: it is {loaded.heavier:.3g} times "
        f"as heavy at the tasks, and motion {grows}; design for {part:.3g} times "
        f"the difference: use {' or '.join(choices)}",
        radius,
        False,
    )


def _weight_finding(loaded: LoadedLoop) -> RateFinding | None:
    """Return the problem of weight that the model does not explain."""
    whole = loaded.with_part(1.0)
    rate = float(np.log(whole.radius())) / whole.period
    if rate <= SLOWEST_GROWTH:
        return None
    cancels = whole.compensation.observer
    way = "a faster" if cancels is not None and cancels.cancel else "a"
    return RateFinding(
        ("compensation", "momentum_observer"),
        "the plant's bodies differ from the model's, and nothing holds the robot "
        f"against their weight: the posture leaves the start as exp({rate:.3g} t); use "
        f"{way} momentum observer, a field that holds the posture, or the right masses",
        whole.radius(),
        False,
    )


def _null_space_findings(
    controller: Controller, state: RobotState, period: float, delays: _Chain
) -> list["RateFinding | None"]:
    K, A = null_space_rates(controller, state)
    if not K.size:
        return []
    stiffness = float(np.linalg.eigvalsh(A).max())
    gain = float(np.abs(np.linalg.eigvals(K)).max())
    loop = delays.loop(K @ A, K + A, np.zeros_like(K), period)
    extra = "" if stiffness < 1e-3 * gain else (
        f", with a field of stiffness {stiffness:.4g} 1/s"
    )  # fmt: skip
    speed = _of_gain("K_N", gain)
    found = [_finding(("null_space", "gain"), loop, speed, RULE, extra, (K, A))]
    if found[0] is None and stiffness * period > RULE:
        found = [
            RateFinding(
                ("null_space", "fields"),
                f"the field's stiffness times the period is {stiffness * period:.3g} "
                f"at the start; at most {RULE:g} is recommended: use weights of at "
                f"most {RULE / stiffness / period:.3g} times these, or a "
                f"control_period of at most {RULE / stiffness:.3g} s",
                loop.radius(),
                False,
            )
        ]
    return found


def _finding(
    path: tuple[str, ...],
    loop: LinearLoop,
    speed: _Speed,
    rule: float,
    extra: str,
    null_space: tuple[Array, Array] | None = None,
) -> RateFinding | None:
    gain, h, late = speed.rate, loop.period, loop.effort_delay + loop.sensor_delay
    if late > _LONG and (borne := _borne(loop)) is not None:
        # The tolerance of a loop is a product of rate and delay.
        share = borne / late
        slower = f" or {speed.at_most(share * gain)}" if share else ""
        return RateFinding(
            path,
            f"unstable with a delay of {late} periods ({late * h:.4g} s): the loop "
            f"tolerates at most {borne} ({borne * h:.4g} s); use a shorter "
            f"delay{slower}",
            np.inf,
            True,
        )
    radius = loop.radius()
    product = f"{speed.what} times the period is {gain * h:.3g}{extra}"
    if radius > 1.0 + _ROUNDING:
        good, stable = _stabilising_changes(loop, speed, rule, null_space)
        solution = (
            f"use {' or '.join(good)}; the loop is stable with {' or '.join(stable)}"
            if good
            else f"use {' or '.join(stable)}"
            if stable
            else "no control rate is stable: reduce the integral gain or the filter's "
            "delay"
        )
        delay = f", {late} period{'s' * (late > 1)} of delay" if late else ""
        return RateFinding(
            path,
            f"unstable at this rate: {product}{delay} (motion grows by a factor "
            f"of up to {radius:.4g} per period); {solution}",
            radius,
            True,
        )
    if gain * h > rule * (1.0 + 1e-9):
        return RateFinding(
            path,
            f"{product}; at most {rule:g} is recommended: use "
            f"{speed.at_most(rule / h)}, or a control_period of at most "
            f"{rule / gain:.3g} s",
            radius,
            False,
        )
    return None


def _stabilising_changes(
    loop: LinearLoop, speed: _Speed, rule: float, null_space: tuple[Array, Array] | None
) -> tuple[list[str], list[str]]:
    """Return changes of single settings, any of which makes the loop stable."""

    def gains(s: float) -> LinearLoop:
        if null_space is None:
            return replace(loop, kp=s**2 * loop.kp, kv=s * loop.kv, ki=s**3 * loop.ki)
        K, A = null_space
        return replace(loop, kp=s * K @ A, kv=s * K + A)

    own, h = loop.compensation, loop.period
    good, choices = [], []
    least = 1e-3 / max(speed.rate * h, 1.0)
    if (s := _largest(gains, least)) is not None:
        choices.append(speed.at_most(s * speed.rate))
        good.append(speed.at_most(min(s * speed.rate, rule / h)))
    if null_space is not None and null_space[1].max() > 1e-3 * speed.rate:
        K, A = null_space

        def weights(s: float) -> LinearLoop:
            return replace(loop, kp=s * K @ A, kv=K + s * A)

        if (s := _largest(weights)) is not None:
            choices.append(f"fields of at most {rounded_down(s)} times these weights")
    if (periods := _borne(loop)) is not None:
        text = f"a delay of at most {periods} period{'s' * (periods != 1)}"
        choices.append(f"{text} ({rounded_down(periods * h)} s)" if periods else text)
    if (s := _largest(lambda s: replace(loop, period=s * h), least)) is not None:
        choices.append(f"a control_period of at most {rounded_down(s * h)} s")
        shorter = rounded_down(min(s * h, rule / speed.rate))
        good.append(f"a control_period of at most {shorter} s")
    for fewer in range(loop.effort_delay - 1, -1, -1):
        if replace(loop, effort_delay=fewer).radius() <= 1.0 + _ROUNDING:
            less = f"at most {fewer} period{'s' * (fewer != 1)}" if fewer else "none"
            choices.append(f"a delay of the efforts of {less}")
            break
    if own.observer is not None and own.observer.cancel:
        running = own.observer
        rate = running.bandwidth

        def observer(s: float) -> LinearLoop:
            slower = replace(running, bandwidth=s * rate)
            return replace(loop, compensation=replace(own, momentum_observer=slower))

        if (s := _largest(observer)) is not None:
            choices.append(
                f"momentum_observer.bandwidth of at most {rounded_down(s * rate)} 1/s"
            )
    if own.velocity_filter is not None:
        filter_ = own.velocity_filter

        def wider(s: float) -> LinearLoop:
            other = replace(filter_, cutoff=filter_.cutoff / s)
            return replace(loop, compensation=replace(own, velocity_filter=other))

        # Up to 0.45 of the rate, where the filter has almost no effect.
        if (s := _largest(wider, filter_.cutoff * loop.period / 0.45)) is not None:
            choices.append(
                f"velocity_filter.cutoff of at least {filter_.cutoff / s * 1.01:.3g} Hz"
            )
    return good, choices


def _borne(loop: LinearLoop) -> int | None:
    """Return the largest delay in periods with which a loop is stable.

    None if it is stable with the delay that it has, or unstable without any.
    """
    late = loop.effort_delay + loop.sensor_delay

    def stable(periods: int) -> bool:
        efforts = periods * loop.effort_delay // late
        measured = periods - efforts
        some = replace(loop, effort_delay=efforts, sensor_delay=measured)
        return some.radius() <= 1.0 + _ROUNDING

    if not late or not stable(0):
        return None
    low, high = 0, 1
    while stable(high):
        if high == late:
            return None
        low, high = high, min(2 * high, late)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _largest(
    of_scale: Callable[[float], LinearLoop], smallest: float = 1e-3
) -> float | None:
    """Return the largest scale below 1 at which a loop is stable, or None."""
    # The loop is also stable at all scales tried between ``smallest`` and the result.

    def stable(s: float) -> bool:
        try:
            return of_scale(s).radius() <= 1.0 + _ROUNDING
        except CompensationError:  # a filter beyond half of the rate
            return False

    tried = np.geomspace(1.0, min(smallest, 1.0), 31)
    results = [stable(float(s)) for s in tried]
    if not results[-1]:
        return None
    first = max(k for k, is_stable in enumerate(results) if not is_stable) + 1
    low, high = float(tried[first]), float(tried[first - 1])
    for _ in range(14):  # to a relative precision of 1e-5
        middle = np.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
