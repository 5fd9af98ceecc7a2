"""Close the loop: controller, plant and integrator, from a start to a rollout."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.controller import Controller
from hsp_control.exceptions import HspControlError, SimulationError
from hsp_control.plants import Plant, RigidBodyPlant
from hsp_control.robot import RobotState
from hsp_control.scene import Scene
from hsp_control.simulation.integrators import Dop853, Integrator
from hsp_control.simulation.recorder import Recorder
from hsp_control.simulation.rollout import Rollout

RUNAWAY_SPEED = 1e4
"""Joint speed [rad/s or m/s] beyond which a simulation is said to have diverged."""


def simulate(
    controller: Controller,
    q0: Any,
    v0: Any = None,
    *,
    duration: float,
    control_period: float | None = None,
    log_period: float = 0.01,
    integrator: Integrator | None = None,
    plant: Plant | None = None,
    scene: Scene | None = None,
    start_time: float = 0.0,
    on_progress: Callable[[float], None] | None = None,
    on_row: Callable[[Recorder], None] | None = None,
    meta: dict[str, Any] | None = None,
) -> Rollout:
    """Run the closed loop and return what happened.

    Args:
        controller: The controller.
        q0: Start configuration, shape (nq,).
        v0: Start velocity, shape (nv,); None: at rest.
        duration: Length of the run [s].
        control_period: How long an effort is held [s], as on a real robot; None: the
            law is evaluated in the integrator's stages, as in the proofs.
        log_period: Time between two rows [s]; with a control period, a multiple of it.
        integrator: How the plant moves on; None: `Dop853`.
        plant: What the effort moves; None: the controller's own model.
        scene: Obstacles to log.
        start_time: Time of the first row [s].
        on_progress: Called with the fraction done at every row.
        on_row: Called with the recorder at every row, once that is recorded.
        meta: JSON data to add to the rollout's.

    Returns:
        The rollout. Ctrl-C ends it early, with the status ``interrupted`` and all rows
        computed until then.

    Raises:
        SimulationError: If durations and periods do not fit, or the motion diverged;
            its ``rollout`` then holds what was computed.
        HspControlError: If the start is not a state of the robot.
    """
    robot = controller.robot
    plant = RigidBodyPlant(robot) if plant is None else plant
    integrator = Dop853() if integrator is None else integrator
    rows = _whole(duration, log_period, "duration", "log_period") + 1
    holds = (
        0
        if control_period is None
        else _whole(log_period, control_period, "log_period", "control_period")
    )
    q = robot.check_configuration(q0).copy()
    v = robot.check_tangent(np.zeros(robot.nv) if v0 is None else v0, "velocity v0")
    recorder = Recorder(controller, scene or Scene(), rows)
    state = RobotState(robot)

    def feedback(t: float, q: Array, v: Array) -> Array:
        tau = controller.compute(state.update(t, q, v)).tau
        return plant.acceleration(t, q, v, tau)

    def intervals(t: float, end: float) -> Iterator[tuple[float, float]]:
        for k in range(holds):
            yield t + k * (end - t) / holds, t + (k + 1) * (end - t) / holds

    status, message = "completed", ""
    try:
        for row in range(rows):
            t = start_time + row * log_period
            recorder.record(state.update(t, q, v), controller.compute(state))
            if on_progress is not None:
                on_progress(row / (rows - 1) if rows > 1 else 1.0)
            if on_row is not None:
                on_row(recorder)
            if row == rows - 1:
                break
            end = start_time + (row + 1) * log_period
            if not holds:
                q, v = integrator.advance(robot, feedback, t, end, q, v)
            for begin, stop in intervals(t, end):
                held = controller.compute(state.update(begin, q, v)).tau.copy()
                free = partial(_under, plant, held)
                q, v = integrator.advance(robot, free, begin, stop, q, v)
            _stop_runaway(end, q, v)
    except KeyboardInterrupt:
        status, message = "interrupted", "stopped by the user"
    except HspControlError as error:
        failure = SimulationError(f"the simulation stopped: {error}")
        failure.rollout = recorder.rollout("diverged", str(error), **(meta or {}))
        raise failure from error
    return recorder.rollout(status, message, **(meta or {}))


def _under(plant: Plant, tau: Array, t: float, q: Array, v: Array) -> Array:
    return plant.acceleration(t, q, v, tau)


def _stop_runaway(t: float, q: Array, v: Array) -> None:
    speed = float(np.abs(v).max())
    if not (np.isfinite(q).all() and speed < RUNAWAY_SPEED):
        raise SimulationError(
            f"the motion diverged before t = {t:.6g} s: a joint moves at {speed:.3g} "
            "rad/s (or m/s). A singularity, gains too high for the control period, or "
            "a field without a minimum do that"
        )


def _whole(total: float, part: float, total_name: str, part_name: str) -> int:
    """Return total/part if it is a whole number.

    Raises:
        SimulationError: If it is not, or a period is not positive.
    """
    for value, name in ((total, total_name), (part, part_name)):
        if not 0.0 < value < np.inf:
            raise SimulationError(f"{name} is {value} s; must be positive")
    ratio = total / part
    if abs(ratio - round(ratio)) > 1e-6 * max(1.0, ratio) or round(ratio) < 1:
        raise SimulationError(
            f"{total_name} = {total:g} s is not a whole multiple of "
            f"{part_name} = {part:g} s"
        )
    return round(ratio)
