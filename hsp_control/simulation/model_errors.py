"""Which errors of its model a loop tolerates, linearised about a posture.

The loop of the whole robot (`linear_loop.py: LoadedLoop`) with other masses, rotors,
delays and lags: its growing modes, and the effect of an unknown effort on the tasks.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.control.compensation import Compensation
from hsp_control.control.compensation.linear_loop import (
    NO_GAINS,
    LinearLoop,
    WholeLoop,
    loaded_loop,
    whole_loop,
)
from hsp_control.control.compensation.rate_check import SLOWEST_GROWTH
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation.plants.model_changes import (
    Inertias,
    ModelChange,
    MotorInertia,
    changed,
)

ERROR = 0.2
"""Relative error of masses and inertias that the loop shall tolerate [-]."""
_BODIES: Sequence[tuple[Inertias, int]] = [
    (Inertias(mass_factor=1.0 + ERROR), 0),
    (Inertias(mass_factor=1.0 - ERROR), 0),
    *(
        (Inertias(random_mass=ERROR, random_inertia=ERROR, random_com=0.01), seed)
        for seed in range(6)
    ),
]
_LONGEST = 0.05
"""Longest delay and lag that are tried [s]."""
_LARGEST_ROTOR = 10.0
"""Largest inertia of a rotor that is tried [kg·m²]."""
USUAL_ROTOR = 0.05
"""Inertia of a light wrist's motor at its joint: a rotor of 5e-6 kg·m² behind a
gear of 100 [kg·m²]."""
_STEP_RESPONSE = 0.5
"""Duration of the response to an effort that is computed [s]."""


class _HiddenRotors(ModelChange):
    """Drives whose torque control hides the rotors that the model has."""

    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Take the rotors away."""
        model.armature[:] = 0.0


class Moved(NamedTuple):
    """Displacement of one part of a task by an unmodelled effort of 1 N·m, or N."""

    task: str
    part: str  # such as ``position``
    unit: str  # m or rad
    resting: Array  # in the end, without an observer, for every joint, shape (nv,)
    peak: Array  # at most, with the compensators that there are, shape (nv,)


class ModelErrors(NamedTuple):
    """The model errors that the loop tolerates at a posture, from the linear loop."""

    moved: tuple[Moved, ...]  # of the tasks
    joints: tuple[str, ...]  # the degrees of freedom
    delay: float  # longest delay without a growing mode, besides known delays [s]
    lag: float  # longest lag of the drives without one, besides known lags [s]
    growing: int  # number of robots of other masses with a growing mode, of `tried`
    tried: int
    growth: float  # the fastest rate at which one grows; 0: none grows [1/s]
    # largest inertia that each rotor may have beyond the model [kg·m²]; inf: any that
    # was tried
    rotor: float
    # longest delay without a growing mode if the drives hide the rotors that the model
    # has, 0 if it is shorter than a period [s]; None: it has none
    hidden: float | None


def model_errors(
    controller: Controller,
    q: Array,
    period: float,
    compensation: Compensation,
    *,
    effort_delay: int = 0,
    sensor_delay: int = 0,
    effort_lag: float = 0.0,
) -> ModelErrors | None:
    """Return the model errors that the loop tolerates at a posture.

    None for a floating base and contacts, where the law is damped, and where nothing
    controls the null space.

    Args:
        controller: The controller.
        q: The posture, shape (nq,).
        period: The control period [s].
        compensation: The compensators; ``auto`` as on a real robot.
        effort_delay: Delay of the efforts that is known [control periods].
        sensor_delay: Delay of the measurements that is known [control periods].
        effort_lag: Time constant of the drives that is known [s].
    """
    robot = controller.robot
    state = robot.state(0.0, q, np.zeros(robot.nv))
    parts = compensation.decided(controller, period, exact=False)
    known = effort_delay, sensor_delay, parts
    chain = LinearLoop(*NO_GAINS, period, *known, lag=effort_lag)
    whole = whole_loop(controller, state, chain)
    if whole is None:
        return None
    robots = [changed(robot, [change], seed) for change, seed in _BODIES]
    loops = [_of(controller, state, other, chain) for other in robots]
    rates = [_growth(loop) for loop in loops]
    growing = [rate for rate in rates if rate > SLOWEST_GROWTH]

    def late(seconds: float) -> LinearLoop:
        periods = effort_delay + round(seconds / period)
        return replace(whole.loop, effort_delay=periods)

    def lagging(seconds: float) -> LinearLoop:
        return replace(whole.loop, lag=effort_lag + seconds)

    def with_rotors(inertia: float) -> LinearLoop:
        change: ModelChange = MotorInertia(inertia)
        return _of(controller, state, changed(robot, [change]), chain)

    bare = changed(robot, [_HiddenRotors()])
    unlike = _of(controller, state, bare, chain)

    def late_and_bare(seconds: float) -> LinearLoop:
        return replace(unlike, effort_delay=effort_delay + round(seconds / period))

    has_rotors = bool(robot.model.armature.any())
    most = round(_LONGEST / period)
    delays = [period * periods for periods in range(1, most + 1)]
    return ModelErrors(
        _moved(controller, state, whole),
        tuple(robot.dof_names),
        _last_stable(late, delays),
        _last_stable(lagging, [*np.geomspace(1e-4, _LONGEST, 61)]),
        len(growing),
        len(rates),
        max(growing, default=0.0),
        _last_stable(with_rotors, [*np.geomspace(1e-5, _LARGEST_ROTOR, 61)], np.inf),
        _last_stable(late_and_bare, delays) if has_rotors else None,
    )


def lines(found: ModelErrors) -> dict[str, str]:
    """Return the tolerated model errors in words, by their kind."""
    texts: dict[str, str] = {}
    for each in found.moved:
        scale, unit = (1e3, "mm") if each.unit == "m" else (180.0 / np.pi, "°")
        if each.unit not in ("m", "rad"):
            scale, unit = 1.0, each.unit
        numbers = ", ".join(f"{scale * value:.2g}" for value in each.resting)
        peak, joint = float(each.peak.max()), found.joints[int(each.peak.argmax())]
        texts[f"1 N·m unknown, {each.task} {each.part}"] = (
            f"{numbers} {unit} by joint without an observer, at most "
            f"{scale * peak:.2g} {unit} ({joint}) as it is"
        )
    grows = f"{found.growing} of {found.tried} grow, as exp({found.growth:.2g} t)"
    texts["masses ±20 %"] = grows if found.growing else "no growing mode"
    texts["tolerates"] = (
        f"a delay of {1e3 * found.delay:.3g} ms, or a lag of {1e3 * found.lag:.3g} ms"
    )
    if found.rotor < np.inf:
        texts["tolerates"] += (
            f"; rotors of up to {found.rotor:.2g} kg m² that the model lacks, see "
            "robot: motor_inertia"
        )
        if found.rotor < USUAL_ROTOR:
            texts["rotors"] = (
                f"a light wrist's has some {USUAL_ROTOR:g} kg m²: then a mode grows; "
                "give them, even as a guess: robot: "
                f"{{motor_inertia: {USUAL_ROTOR:g}}}"
            )
    if found.hidden is not None:
        most = f"at most {1e3 * found.hidden:.3g} ms" if found.hidden else "hardly any"
        texts["rotors hidden"] = (
            "where the drives' torque control makes the arm behave as its bare links, "
            f"{most} of delay is tolerated: then motor_inertia: 0"
        )
    return texts


def _of(
    controller: Controller, state: RobotState, robot: Robot, chain: LinearLoop
) -> LinearLoop:
    loaded = loaded_loop(controller, state, robot, chain)
    if loaded is None:  # its bodies are the model's: it has none
        whole = whole_loop(controller, state, chain)
        assert whole is not None
        return whole.loop
    return loaded.with_part(1.0)


def _growth(loop: LinearLoop) -> float:
    """Return the rate of the fastest mode, negative if all decay [1/s]."""
    return float(np.log(loop.radius())) / loop.period


def _last_stable(
    loop: Callable[[float], LinearLoop],
    values: Sequence[float],
    beyond: float | None = None,
) -> float:
    """Return the last value before the first with a growing mode.

    0 if the first grows, and ``beyond``, or the last one, if the last does not. Large
    values are tried last: a long delay makes a large loop.
    """

    def grows(k: int) -> bool:
        return _growth(loop(float(values[k]))) > SLOWEST_GROWTH

    low, high, end = -1, 0, len(values) - 1
    while not grows(high):
        if high == end:
            return float(values[-1]) if beyond is None else beyond
        low, high = high, min(2 * high + 1, end)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return 0.0 if low < 0 else float(values[low])


def _moved(
    controller: Controller, state: RobotState, whole: WholeLoop
) -> tuple[Moved, ...]:
    """Return the tasks' displacements per unit of effort on the joints."""
    loop, T, to_error, rows = whole
    m, nv = len(to_error), len(T)
    # Each column is the acceleration of one unit of effort, in the loop's coordinates.
    pushes = T @ np.linalg.inv(state.mass_matrix)
    held = loop.kp[:m, :m]
    resting = to_error @ np.linalg.lstsq(held, pushes[:m], rcond=None)[0]
    peak = np.zeros((m, nv))
    transition, h = loop.transition(), loop.period
    moving = np.zeros((len(transition), nv))
    reached = [np.zeros((m, nv))]
    for _ in range(round(_STEP_RESPONSE / h)):
        moving = transition @ moving
        moving[:nv] += 0.5 * h * h * pushes
        moving[nv : 2 * nv] += h * pushes
        reached.append(to_error @ moving[:m])
    path = np.array(reached)
    found = list[Moved]()
    for task in controller.tasks:
        if (at := rows.get(task.name)) is None:
            continue
        first = at.start
        for part in task.error_parts:
            own = slice(first, first + part.size)
            first += part.size
            away = np.linalg.norm(resting[own], axis=0)
            peak = np.linalg.norm(path[:, own], axis=1).max(axis=0)
            found.append(Moved(task.name, part.name, part.unit, away, peak))
    return tuple(found)


def describe(found: ModelErrors) -> dict[str, Any]:
    """Return it as plain data, for a log or JSON."""
    data: dict[str, Any] = found._asdict()
    data["moved"] = [
        {**each._asdict(), "resting": each.resting.tolist(), "peak": each.peak.tolist()}
        for each in found.moved
    ]
    data["joints"] = list(found.joints)
    data["rotor"] = found.rotor if found.rotor < np.inf else None
    return data
