"""Many periods in one native call equal the same periods one by one."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from closed_loops import load, panda_controller
from places import further

from hsp_control import (
    FramePosition,
    Limits,
    Rollout,
    TargetPosture,
    engine,
    load_experiment,
    simulate,
)
from hsp_control.common.errors import SimulationError
from hsp_control.config import Experiment
from hsp_control.constraints.limits import RobotLimits
from hsp_control.control.actuation.limit_checks import LimitsOutcome
from hsp_control.control.bound_step import BoundStep, FreeStep
from hsp_control.control.changes import Changes
from hsp_control.control.controller import Controller
from hsp_control.engine import Move, Plan, PythonCall
from hsp_control.law.outcome import LawOutcome
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation import loops
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.simulation.native_loop import MOST
from hsp_control.trajectories import Hold

EULER = "simulation.integrator={type: semi_implicit_euler}"
RK4 = "simulation.integrator={type: rk4}"


def short(name: str, *overrides: str, duration: float = 0.3) -> Experiment:
    return load_experiment(name, f"simulation.duration={duration}", *overrides)


class Counted:
    """Counts the periods in native calls.

    Attributes:
        many: Number of periods per call.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.many: list[int] = []
        self._patch = monkeypatch
        while_free = Controller._while_free

        def counted(controller: Controller, advance: Any) -> int:
            made = while_free(controller, advance)
            self.many.append(made)
            return made

        monkeypatch.setattr(Controller, "_while_free", counted)

    def alone(self, run: Callable[[], Rollout]) -> Rollout:
        """Run with a call per period."""
        before = sum(self.many)
        with self._patch.context() as patch:
            patch.setattr(loops, "_native_loop", lambda *_: None)
            found = run()
        assert sum(self.many) == before
        return found


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    return Counted(monkeypatch)


def assert_same(ours: Rollout, theirs: Rollout) -> None:
    """Compare every number of two logs bit for bit."""
    assert ours.columns.keys() == theirs.columns.keys()
    for name, column in ours.columns.items():
        assert column.tobytes() == theirs.columns[name].tobytes(), name
    assert ours.meta == theirs.meta


CASES = {
    "a ball sweeps past, RK4": ("panda_obstacle",),
    "a ball sweeps past, Euler": ("panda_obstacle", EULER),
    "manipulability": ("panda_manipulability",),
    "no limits": ("panda_obstacle", "limits=null"),
    "efforts limited in rate": (
        "panda_obstacle", "limits.effort_rate=2000",
    ),
    "a singular arm": ("iiwa_singular",),
    "a position task": ("ur5_position",),
    "two arms, steps of 2 ms": ("dual_panda",),
    "steps shorter than a period": (
        "panda_limits", "simulation.integrator={type: rk4, step: 0.0005}",
    ),
    "more periods than a call makes": (
        "panda_limits", "simulation.log_period=0.3", EULER,
    ),
    "periods that are no binary fractions": (
        "panda_limits", "simulation.log_period=0.03",
        "simulation.control_period=0.0006",
        "simulation.integrator={type: rk4, step: 0.0003}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_the_same_to_the_last_bit(case: tuple[str, ...], counted: Counted) -> None:
    theirs = counted.alone(short(*case).run)
    ours = short(*case).run()
    assert_same(ours, theirs)
    periods = 0.9 * 0.3 / 0.001
    assert sum(counted.many) > 0.5 * periods
    assert max(counted.many) <= MOST


@pytest.mark.parametrize(
    ("outcome", "q", "free"),
    [
        ({}, 0.0, True),
        ({"damped_level": 1}, 0.0, True),
        ({"finite": 0}, 0.0, False),
        ({"violated": 1}, 0.0, False),
        ({"beyond": 1}, 0.0, False),
        ({}, np.nan, False),
    ],
)
def test_a_step_is_free_whose_law_is_finite_within_limits(
    outcome: dict[str, int], q: float, free: bool
) -> None:
    """Also with a bounded inverse; except for a refused state."""
    law, limits = LawOutcome.allocate(), LimitsOutcome.allocate()
    reported = law._asdict() | limits._asdict()
    for name, value in ({"finite": 1} | outcome).items():
        reported[name][0] = value
    move = Move(
        calls=Plan(),
        origin=np.zeros(1),
        time=np.zeros(1),
        q=np.zeros(2),
        v=np.zeros(2),
        unit_blocks=np.zeros((0, 2), dtype=np.int64),
        stamp=np.zeros(1, dtype=np.int64),
    )
    periods, first, last = np.array([[10], [3], [7]])
    loop = engine.Periods(
        moving=Plan(),
        step=move,
        sending=Plan(),
        q=np.full(2, q),
        v=np.zeros(2),
        held=np.zeros(2),
        effort=np.ones(2),
        interval=np.zeros(2),
        law=law,
        limits=limits,
        timing={
            "start": np.zeros(1),
            "span": np.ones(1),
            "periods": periods,
            "first": first,
            "last": last,
        },
    )
    assert loop() == (7.0 if free else 4.0)


@pytest.mark.parametrize("part", ["move", "sending"])
def test_calls_in_python_are_not_left_out(
    part: str, counted: Counted, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A call per period if a user's call is within a step, or efforts are recorded."""
    ours = short("panda_obstacle").run()
    before, made = sum(counted.many), BoundStep.free.func
    nothing = PythonCall(float)

    def with_python(bound: BoundStep) -> FreeStep:
        step = made(bound)
        assert step is not None
        if part == "move":
            values = step.move.values
            plan = Plan([values.pop("calls"), nothing])
            return step._replace(move=Move(calls=plan, **values))
        return step._replace(sending=[*step.sending, nothing])

    monkeypatch.setattr(BoundStep, "free", property(with_python))
    assert_same(short("panda_obstacle").run(), ours)
    assert sum(counted.many) == before > 0


def test_periods_in_which_a_limit_binds_are_made_alone(counted: Counted) -> None:
    """Other periods are native: after an active limit the loop continues."""
    slow = "limits.acceleration=1.0", "simulation.log_period=0.008"
    theirs = counted.alone(short("panda_obstacle", *slow, duration=2.0).run)
    ours = short("panda_obstacle", *slow, duration=2.0).run()
    assert_same(ours, theirs)
    changes = np.count_nonzero(np.diff(ours["status"] == 2))
    assert changes >= 3  # a limit is active, inactive, and active again
    made = np.array(counted.many)
    assert made.sum() > 500
    assert ((made > 0) & (made < 8)).sum() >= 2


def test_prediction_errors_of_held_efforts_are_the_same(counted: Counted) -> None:
    """Past prediction errors widen the margin of a later active speed limit."""
    slow = "panda_obstacle", "limits.velocity={scale: 0.3}"
    theirs = counted.alone(short(*slow, duration=2.0).run)
    ours = short(*slow, duration=2.0).run()
    assert_same(ours, theirs)
    assert (ours["status"] == 2).sum() > 10
    assert sum(counted.many) > 1000


def test_after_it_the_controller_is_at_its_last_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its time, too: q, v and t of the state belong to one instant."""
    times: list[tuple[float, float, int]] = []
    while_free = Controller._while_free

    def timed(controller: Controller, advance: Any) -> int:
        before = controller.state.t
        made = while_free(controller, advance)
        times.append((before, controller.state.t, made))
        return made

    monkeypatch.setattr(Controller, "_while_free", timed)
    short("panda_obstacle").run()
    before, after, made = map(np.array, zip(*times, strict=True))
    assert made.max() > 5
    # The effort of the last period was computed where that period began.
    expected = before + 1e-3 * np.maximum(made - 1, 0)
    np.testing.assert_allclose(after, expected, rtol=0, atol=1e-12)


def test_no_state_between_two_rows_is_missed(
    counted: Counted, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Excesses over limits, here 0.05 rad/s, are detected in every period."""

    def strict(limits: RobotLimits | None) -> RobotLimits:
        assert limits is not None
        return replace(limits, velocity=np.full(7, 0.05))

    arguments = LimitExcess._arguments
    monkeypatch.setattr(
        LimitExcess,
        "_arguments",
        lambda self, limits, q, v: arguments(self, strict(limits), q, v),
    )
    rows = "simulation.log_period=0.1"
    theirs = counted.alone(short("panda_obstacle", rows, duration=3.0).run)
    ours = short("panda_obstacle", rows, duration=3.0).run()
    assert_same(ours, theirs)
    at_rows = np.maximum(np.abs(ours.v) - 0.05, 0.0)
    assert (ours["velocity_excess"] > at_rows + 1e-4).any()  # a peak between two rows
    assert sum(counted.many) > 2000


ELBOW = FramePosition("panda_link4", Hold(), axes="z", name="elbow")
CHANGES: dict[str, Callable[[Changes], object]] = {
    "gain": lambda at: at.null_space_gain(20.0),
    "field": lambda at: at.field(TargetPosture("home", weight=3.0)),
    "task": lambda at: at.add(ELBOW),
    "limits": lambda at: at.limits(Limits(velocity=2.0)),
}


@pytest.mark.parametrize("change", ["task", "limits", *further("gain", "field")])
def test_a_change_is_made_where_it_begins(change: str, counted: Counted) -> None:
    """Changes run in Python; a second after their end the native loop continues.

    It continues with the parameters in force at that time.
    """

    def run() -> Rollout:
        experiment = short("panda_obstacle", EULER)
        controller = experiment.controller

        def on_row(recorder: Any) -> None:
            if recorder.count == 11:  # at 0.1 s
                CHANGES[change](controller.at(0.1234).ramp(0.05))

        return simulate(
            controller,
            experiment.q0,
            duration=1.4,
            control_period=0.001,
            integrator=SemiImplicitEuler(),
            on_row=on_row,
        )

    theirs = counted.alone(run)
    ours = run()
    assert_same(ours, theirs)
    made = np.array(counted.many)
    (native,) = np.nonzero(made)
    assert len(native) > 20
    assert (np.diff(native) > 100).any()  # calls that were refused during the change
    assert made[native[-10:]].sum() > 80  # and the loop continued


@pytest.mark.parametrize("log_period", [0.05, 1.0])
def test_a_motion_that_diverges_stops_the_same_way(
    log_period: float, counted: Counted
) -> None:
    """K_N times the period is 20: joints diverge in the native loop; their speed is
    reported.

    Within a row of 1 s the effort becomes NaN.
    """
    task, q0 = panda_controller().tasks[0], load("panda").home()
    controller = Controller(
        load("panda"), [task], TargetPosture(q0), null_space_gain=2000.0, limits=None
    )
    reported: list[str] = []

    def run() -> Rollout:
        refused = pytest.raises(SimulationError, match=r"^the simulation stopped: ")
        with np.errstate(over="ignore"), refused as caught:
            simulate(
                controller,
                q0,
                np.ones(7),
                duration=1.0,
                control_period=0.01,
                log_period=log_period,
                integrator=SemiImplicitEuler(0.01),
                check_rate=False,
            )
        reported.append(str(caught.value))
        rollout = caught.value.rollout
        assert isinstance(rollout, Rollout)
        return rollout

    theirs = counted.alone(run)
    assert_same(run(), theirs)
    assert reported[0] == reported[1]
    assert ("diverged" if log_period == 0.05 else "not finite") in reported[0]
    assert max(counted.many) > 1
