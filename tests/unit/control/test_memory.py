"""A controller's memory is one record: every copy continues identically."""

import pickle
import warnings
from collections.abc import Callable
from copy import deepcopy

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.control.clock_check import ClockWarning
from hsp_control.control.first_state import StartWarning
from hsp_control.control.memory import RunMemory

ROBOT = hsp.Robot.load("panda")
H = 1e-3
COPIES: dict[str, Callable[[hsp.Controller], hsp.Controller]] = {
    "copy": deepcopy,
    "pickle": lambda made: pickle.loads(pickle.dumps(made)),
}


def controller() -> hsp.Controller:
    """Return a controller with every kind of memory, also a stiffness that waits."""
    hand = hsp.FramePose(
        name="hand",
        impedance=hsp.Impedance([200.0] * 3 + [10.0] * 3),
        trajectory=hsp.Hold(),
    )
    made = hsp.Controller(ROBOT, [hand], hsp.TargetPosture("home"), start=ROBOT.home())
    stiff = hsp.Impedance([900.0] * 3 + [40.0] * 3)
    made.at(0.02).ramp(0.02).impedance("hand", stiff)
    return made


def sent(made: hsp.Controller, k: int) -> bytes:
    """Let a period pass, in which the arm deviates from its command."""
    made.applied(np.sin(0.1 * k + np.arange(7)), H)
    return b"".join(each.tobytes() for each in made._memory.sent.held)


def computed(made: hsp.Controller, k: int) -> bytes:
    away = 0.1 * np.sin(0.05 * k + np.arange(7))
    rate = 0.05 * np.cos(0.05 * k + np.arange(7))
    return made.compute(k * H, ROBOT.integrate(ROBOT.home(), away), rate).tau.tobytes()


@pytest.mark.parametrize("kind", COPIES)
@pytest.mark.parametrize("between", [True, False], ids=["computed", "sent"])
def test_a_copy_goes_on_to_the_last_bit(kind: str, between: bool) -> None:
    """A copy at any step, before or after its effort is sent."""
    made, twins = controller(), list[hsp.Controller]()
    made.feedback("hand").offset[:] = 0.1  # as a compensator writes it
    for k in range(60):
        efforts = {computed(each, k) for each in (made, *twins)}
        if between and k % 7 == 0:
            twins.append(COPIES[kind](made))
        held = {sent(each, k) for each in (made, *twins)}
        if not between and k % 7 == 0:
            twins.append(COPIES[kind](made))
        assert len(efforts) == len(held) == 1
    assert made._memory.waiting  # the stiffness lags: a larger one would add energy
    assert all(each.stiffness("hand")[0, 0] > 200.0 for each in (made, *twins))
    assert all(each.feedback("hand").offset[0] == 0.1 for each in twins)


@pytest.mark.parametrize("kind", COPIES)
@pytest.mark.parametrize("fading", [False, True])
def test_a_copy_is_diagnosed_at_the_step_before_it(kind: str, fading: bool) -> None:
    made = controller()
    if fading:
        wrist = hsp.JointPosture(joints=["panda_joint7"], name="wrist")
        made.at(0.0).ramp(1.0).add(wrist)
    for k in range(3):
        computed(made, k)
    twin = COPIES[kind](made)
    for own, other in zip(made.diagnose(), twin.diagnose(), strict=True):
        np.testing.assert_array_equal(own, other)
    rows = made.active_stack.rows
    np.testing.assert_array_equal(rows.jacobian, twin.active_stack.rows.jacobian)
    assert rows.jacobian.any()


@pytest.mark.parametrize("kind", COPIES)
def test_a_copy_does_not_repeat_reports(kind: str) -> None:
    """No memory of the first effort, nor of a stopped clock, remains."""
    made = controller()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(150):
            made.compute(0.0, ROBOT.home(), np.zeros(7))
            made.applied(np.zeros(7), H)
    assert [each.category for each in said] == [StartWarning, ClockWarning]
    twin = COPIES[kind](made)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(300):
            twin.compute(0.0, ROBOT.home(), np.zeros(7))
            twin.applied(np.zeros(7), H)


def test_a_restart_remembers_nothing() -> None:
    """The remaining memory is that of a new controller, but for the run counter."""
    made, new = controller(), controller()
    for k in range(60):
        computed(made, k)
        sent(made, k)
    made.restart()
    assert made._memory.runs == new._memory.runs + 1
    made._memory.runs = 0
    before, after = _plain(new._memory), _plain(made._memory)
    assert before == after
    assert [*_plain(RunMemory.of(7))] == [*before]


def _plain(memory: RunMemory) -> dict[str, object]:
    """Return the contents of a memory in a form that can be compared."""
    fields = vars(memory) | {"sent": vars(memory.sent), "clock": vars(memory.clock)}
    return {name: pickle.dumps(each) for name, each in fields.items()}


def test_a_new_run_has_neither_changes_nor_forces_of_the_last_one() -> None:
    """A change that no step has seen belongs to the run in which it was made."""
    made = controller()
    computed(made, 0)
    made.at(0.1).impedance("hand", hsp.Impedance([400.0] * 3 + [20.0] * 3))
    made._memory.force_offset("sole")[:] = 5.0
    assert made._memory.not_seen(0.0)
    made.restart()
    assert made._memory.not_seen(0.0) == ()
    assert made._memory.force_offset("sole") == 0.0


def test_a_rehearsal_teaches_nothing_about_the_clock() -> None:
    memory = RunMemory.of(7)
    memory.motion.latest = 1.0
    with memory.kept():
        memory.motion.latest = 2.0
    assert memory.motion.latest == 1.0
