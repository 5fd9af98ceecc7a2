"""Simulates the closed loop of a controller and a plant."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.errors import (
    FallError,
    HspControlError,
    LogError,
    SimulationError,
    StreamError,
)
from hsp_control.common.keywords import suggesting
from hsp_control.common.numbers import check_positive
from hsp_control.common.warned import warn
from hsp_control.control.change_model import ChangeGravity, ChangePayload
from hsp_control.control.compensation import CompensatedController, Compensation
from hsp_control.control.compensation import check_rate as check_loop
from hsp_control.control.controller import Controller
from hsp_control.control.estimation import Estimator
from hsp_control.control.first_state import (
    StartWarning,
    warn_of_jump,
    warn_of_slow_efforts,
)
from hsp_control.control.plans import MotionPlan, RunningPlan
from hsp_control.declaration import Part, within
from hsp_control.declaration.language import check_kind
from hsp_control.declaration.located import place_of
from hsp_control.declaration.quantities import Flag, Number, Positive
from hsp_control.geometry.scene import Scene
from hsp_control.robot.integrators import Dop853, Integrator, Rk4
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.declared_run import declared_run
from hsp_control.simulation.heavy_plant import heavy_plant
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.loops import continuous_loop, sampled_loop
from hsp_control.simulation.plants import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    PlantPart,
    RigidBody,
    RigidBodyPlant,
    SampledPlant,
    check_plant,
    differing_bodies,
    is_exact,
)
from hsp_control.simulation.rollout import Rollout
from hsp_control.simulation.run_summary import damped_words

LOG_PERIOD = 0.01
"""Time between two rows by default [s]."""
MAX_ROWS = 10_000_000
"""Most rows of a log; see also `log_columns.MAX_SIZE`."""
_LONG = 0.5
"""Control period from which on it is taken for milliseconds [s]."""
MAX_STEPS = 1e9
"""Most control periods, or integrator steps, of a run: at 50 µs each, 14 hours."""


@suggesting
def simulate(
    controller: Controller,
    q0: Any,
    v0: Any = None,
    *,
    duration: float,
    control_period: float | None = None,
    log_period: float = LOG_PERIOD,
    integrator: Integrator | None = None,
    plant: Plant | PlantPart | None = None,
    compensation: Compensation | None = None,
    plan: MotionPlan | None = None,
    estimators: Sequence[Estimator] = (),
    scene: Scene | None = None,
    check_rate: bool = True,
    start_time: float = 0.0,
    on_progress: Callable[[float], None] | None = None,
    on_row: Callable[[LogWriter], None] | None = None,
    log: str | Path | None = None,
    meta: dict[str, Any] | None = None,
) -> Rollout:
    """Run the closed loop and return its rollout.

    A robot that begins at rest with a jump of its effort is warned about; see
    `hsp_control.control.first_state`.

    Args:
        controller: The controller.
        q0: Start configuration, shape (nq,).
        v0: Start velocity, shape (nv,); None: at rest.
        duration: Length of the run [s].
        control_period: How long an effort is held [s], as on a real robot; None: the
            law is evaluated in the integrator's stages, as in the proofs.
        log_period: Time between two rows [s]; with a control period, a multiple of it.
        integrator: Integrates a continuous plant; None: see `default_integrator`.
        plant: The plant: a value such as `Mujoco`, from which it is built for the
            controller's robot, or one that was built; None: rigid bodies, the
            controller's own model. A sampled plant has its own integrator, and needs a
            control period.
        compensation: Compensators for model errors; they need a control period. None: a
            momentum observer, where the plant is not the controller's own model
            (`Compensation.momentum_observer`).
        plan: The plan that writes references and switches contacts; the controller is
            made of its `MotionPlan.parts`. It needs a control period.
        estimators: Estimators that complete each measurement, for the plan and the
            controller; they need a control period.
        scene: Obstacles to log; None: those of the controller.
        check_rate: Whether gains, impedances and fields with which the loop would be
            unstable at its control period are refused, and high ones warned about.
        start_time: Time of the first row [s].
        on_progress: Called at every row with the fraction of the run that is done.
        on_row: Called with the writer of the log after every row.
        log: A journal to write while the run lasts; `Rollout.load` reads it also if the
            process is killed. The rollout that is returned does not need it.
        meta: JSON data to add to the meta data of the rollout.

    Returns:
        The rollout. Ctrl-C ends it early, with the status ``interrupted`` and all rows
        computed so far; a fall ends it with the status ``stopped``, as silence of a
        stream does.

    Raises:
        UnstableRateError: If the loop would be unstable at its control period, with
            the plant's delays; with values that would not.
        SimulationError: If durations, periods and plant do not fit, or the motion
            diverged; its ``rollout`` then has the computed rows.
        HspControlError: If q0 or v0 is not a valid state of the robot, or the plant
            does not fit it.
    """
    check_kind("controller is", controller, Controller, SimulationError)
    robot = controller.robot
    own_integrator, given = integrator, plant
    integrator = integrator or default_integrator(plant, control_period)
    check_kind("integrator is", integrator, Integrator, SimulationError)
    if compensation is not None:
        check_kind("compensation is", compensation, Compensation, SimulationError)
    if isinstance(plant, str | type):
        check_kind("plant is", plant, PlantPart, SimulationError)
    if plant is None:
        plant = RigidBodyPlant(robot)
    elif isinstance(plant, PlantPart):
        for message in heavy_plant(plant, robot, robot.check_configuration(q0)):
            warn(message, StartWarning)
        with within("plant"):
            plant = plant.build(robot, integrator)
    # Rows, periods, and where it begins
    rows, periods = _count_rows(duration, log_period, control_period)
    check_plant(plant, robot)
    q = robot.check_configuration(q0).copy()
    v = robot.check_tangent(np.zeros(robot.nv) if v0 is None else v0, "velocity v0")
    times = [start_time + row * log_period for row in range(rows)]
    if isinstance(plant, ContinuousPlant) and periods:
        plant = IntegratedPlant(plant, integrator)
    compensation = own_compensation = compensation or Compensation()
    if compensation.names and not periods:
        names = ", ".join(compensation.names)
        raise _no_period(f"compensation ({names}) is computed once a period: it needs")
    if plan is not None and not periods:
        raise _no_period("a plan decides once a period: it needs")
    if estimators and not periods:
        raise _no_period("estimators estimate once a period: they need")
    controller.followed_by(plant.dynamics)
    for k, change in enumerate(controller.changes if plant.dynamics is None else ()):
        if isinstance(change, ChangePayload | ChangeGravity):
            message = (
                f"changes[{k}]: {type(plant).__name__} does not follow changes of "
                "payload and gravity; change them in the plant itself"
            )
            warn(message, StartWarning)
    # The loop
    exact = is_exact(plant, robot)
    period = log_period / periods if periods else None
    decided = compensation.decided(controller, period, exact)
    observed = compensation.on_observer(controller, period, exact)
    compensation = compensation.suited(controller, period, exact)
    running: RunningPlan | None = None
    if isinstance(plant, ContinuousPlant):
        loop = continuous_loop(controller, plant, integrator, times, q, v)
    elif isinstance(plant, SampledPlant) and periods:
        if check_rate:
            high = check_loop(
                controller,
                q,
                log_period / periods,
                decided,
                effort_delay=plant.effort_delay,
                effort_lag=plant.effort_lag,
                sensor_delay=plant.sensor_delay,
                plant=plant.robot,
            )
            for each in high:
                warning = f"{place_of(each.path)}: {each.message}"
                warn(warning, StartWarning)
        chain = ControlChain(
            CompensatedController(controller, compensation), plan, estimators
        )
        chain.begin(plant.inertial())
        running = chain.plan
        loop = sampled_loop(chain, plant, periods, times, q, v)
    else:
        name = type(plant).__name__
        raise _no_period(f"{name} holds the effort during a period: it needs")
    # The log, and the run
    description = {**plant.describe(), **differing_bodies(plant, robot)}
    meta = dict(meta or {})
    if isinstance(given, Plant) and not exact:
        name = type(given).__name__
        lost = f"its plant is a {name} that was built in Python; give a PlantPart"
        meta = {"config": None, "config_lost": lost} | meta
    if "config" not in meta:
        meta |= declared_run(
            controller,
            q,
            v,
            plan=plan,
            estimators=estimators,
            simulation={
                "duration": duration,
                "start_time": start_time,
                "log_period": log_period,
                "control_period": control_period,
                "check_rate": check_rate,
                "integrator": own_integrator,
            },
            plant=given if isinstance(given, PlantPart) else RigidBody(),
            compensation=own_compensation,
        )
    writer = LogWriter(
        controller,
        scene or controller.scene,
        rows,
        running,
        path=None if log is None else Path(log),
        meta={
            "plant": description,
            "momentum_observer": observed,
            **meta,
        },
    )

    status, message = "stopped", "an error that is not ours"
    try:
        for row, (state, output, tau, own_channels) in enumerate(loop):
            if row == 0 and periods:  # else efforts are continuous, and have no rate
                warn_of_slow_efforts(robot, q, controller.limits)
            elif row == 0:  # else `applied` has reported it
                warn_of_jump(robot, q, v, tau, controller.state.dynamics)
            plant_channels = plant.log_channels(state.t, state.q, state.v, tau)
            writer.record(state, output, tau, {**own_channels, **plant_channels})
            if on_progress is not None:
                on_progress(row / (rows - 1) if rows > 1 else 1.0)
            if on_row is not None:
                on_row(writer)
        status, message = "completed", ""
    except KeyboardInterrupt:
        status, message = "interrupted", "stopped by the user"
    except FallError as error:
        status, message = "stopped", str(error)
    except HspControlError as error:
        failure = SimulationError(f"the simulation stopped: {error}")
        outside = isinstance(error, StreamError | LogError)
        status, message = "stopped" if outside else "diverged", str(error)
        failure.rollout = writer.rollout(status, str(error))
        raise failure from error
    finally:
        with suppress(LogError):  # all rows are in memory, too
            writer.end(status, message)
    rollout = writer.rollout(status, message)
    if damped := damped_words(rollout):
        warn(damped, RunWarning)
    return rollout


class RunWarning(RuntimeWarning):
    """A run was not exact most of the time."""


def _no_period(who_needs: str) -> SimulationError:
    return SimulationError(f"{who_needs} a control_period [s], for example 0.001")


def default_integrator(
    plant: Plant | PlantPart | None, control_period: float | None
) -> Integrator:
    """Return the integrator where none is given.

    Rigid bodies under efforts that are held move so smoothly that `Rk4`, in steps of at
    most 1 ms, differs from `Dop853` by 1e-11 rad, in a tenth of the time. Everything
    else, and runs without a control period, are integrated by `Dop853`.
    """
    rigid = plant is None or type(plant) in (RigidBody, RigidBodyPlant)
    return Rk4() if rigid and control_period is not None else Dop853()


def _count_rows(
    duration: float, log_period: float, control_period: float | None
) -> tuple[int, int]:
    """Return the numbers of rows and of control periods per row (0: no periods)."""
    rows = _whole(duration, log_period, "duration", "log_period") + 1
    if rows > MAX_ROWS:
        raise SimulationError(
            f"duration = {duration:g} s with log_period = {log_period:g} s is "
            f"{rows:.3g} rows; at most {MAX_ROWS:.0e}"
        )
    if control_period is None:
        return rows, 0
    periods = _whole(log_period, control_period, "log_period", "control_period")
    check_steps(duration, control_period, "control_period")
    return rows, periods


def check_steps(duration: float, step: float, name: str) -> None:
    """Check that a run has at most `MAX_STEPS` steps."""
    if duration / step > MAX_STEPS:
        raise SimulationError(
            f"duration = {duration:g} s with {name} = {step:g} s is "
            f"{duration / step:.3g} steps; at most {MAX_STEPS:.0e}"
        )


def _whole(total: float, part: float, total_name: str, part_name: str) -> int:
    """Return total/part if it is a whole number."""
    for value, name in ((total, total_name), (part, part_name)):
        check_positive(name, value, "s", SimulationError)
    ratio = total / part
    if not ratio < 2**53:  # every larger float is a whole number
        raise SimulationError(
            f"{total_name} = {total:g} s is {ratio:.3g} times "
            f"{part_name} = {part:g} s; at most {MAX_STEPS:.0e} times"
        )
    if abs(ratio - round(ratio)) > 1e-6 * max(1.0, ratio) or round(ratio) < 1:
        if (total, total_name) == (LOG_PERIOD, "log_period"):  # the default
            with within(part_name):
                if part >= _LONG:
                    raise SimulationError(
                        f"{part:g} s between two efforts; if these are milliseconds, "
                        f"write {1e-3 * part:g}, else give log_period, too, for "
                        f"example {part:g}"
                    )
                raise SimulationError(
                    f"a row is logged every {total:g} s by default, which is not a "
                    f"whole multiple of {part:g} s; give log_period, too, for "
                    f"example {max(round(ratio), 1) * part:g}"
                )
        raise SimulationError(
            f"{total_name} = {total:g} s is not a whole multiple of "
            f"{part_name} = {part:g} s"
        )
    return round(ratio)


class SimulationSettings(Part, error=SimulationError):
    """Duration, periods and integrator of a simulation."""

    duration: Positive = 10.0
    """Length of the run [s]."""
    log_period: Positive = LOG_PERIOD
    """Time between two rows of the log [s]."""
    control_period: Positive | None = None
    """Time for which an effort is held [s]; without it, the law is evaluated in every
    stage of the integrator."""
    check_rate: Flag = True
    """Whether the loop is checked for stability at its control period: an unstable loop
    is an error, a doubtful one a warning. Without a control period nothing is
    checked."""
    integrator: Integrator | None = None
    """The integrator of the robot's motion; by default ``rk4`` in steps of at most 1 ms
    for the plant ``rigid_body`` under efforts that are held, and otherwise
    ``dop853``."""
    start_time: Number = 0.0
    """Time of the first row [s], by the clock of references, schedules and changes;
    `hsp live` and `hsp play` begin at 0."""

    @property
    def end_time(self) -> float:
        """Time of the last row [s]."""
        return self.start_time + self.duration

    def __post_init__(self) -> None:
        _count_rows(self.duration, self.log_period, self.control_period)
        if self.integrator is None or (step := self.integrator.longest_step) is None:
            return
        period = "control_period" if self.control_period else "log_period"
        whole = self.control_period or self.log_period
        ratio = whole / step
        with within("integrator", "step"):
            check_steps(self.duration, step, "step")
            if ratio < 1.0 - 1e-9 or abs(ratio - round(ratio)) > 1e-6 * ratio:
                raise SimulationError(
                    f"{step:g} s is not an integer fraction of {period} = {whole:g} s"
                )
