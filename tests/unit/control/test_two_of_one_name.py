"""While a task fades into another one of the same name, their rows are distinct."""

from dataclasses import replace

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    IntegralAction,
    MomentumObserver,
)
from hsp_control.control.interface import StartWarning
from hsp_control.tasks.impedance import parts_of

H = 1e-3
ROBOT = hsp.Robot.load("panda")
REST = np.zeros(7)


def point(offset: Array) -> hsp.FramePosition:
    """Return a task named "hand" whose target is offset from the hand's home."""
    here = ROBOT.state(0.0, ROBOT.home(), REST).position("panda_tcp")
    target = hsp.Hold(here + offset)
    return hsp.FramePosition("panda_tcp", target, axes="xyz", name="hand")


OLD, NEW = np.array([0.02, 0.0, 0.0]), np.array([0.0, 0.03, 0.01])


def changed() -> hsp.Controller:
    """Return a controller that exchanges this task, from 0.1 to 0.3 s."""
    joints = [f"panda_joint{k}" for k in (1, 2, 3)]
    old = hsp.JointPosture(ROBOT.home(), joints=joints, name="hand")
    made = hsp.Controller(ROBOT, [old], limits=None)
    made.at(0.1).ramp(0.2).remove("hand").add(point(NEW))
    return made


def test_each_has_its_rows_and_errors() -> None:
    made = changed()
    q = ROBOT.home() + 0.01 * np.arange(7.0)
    made.compute(0.0, q, REST)
    output = made.compute(0.2, q, REST)
    assert made.task_rows == {"hand": slice(0, 3)}
    assert [each.task_rows for each in made.stacks] == 2 * [made.task_rows]
    assert "e of hand (old)" in repr(output)
    np.testing.assert_allclose(output.error("hand (old)"), [0.0, -0.01, -0.02])
    state = ROBOT.state(0.2, q, REST)
    expected = point(NEW).evaluate(state).error
    np.testing.assert_allclose(output.error("hand"), expected, rtol=0, atol=1e-15)
    output = made.compute(0.4, q, REST)
    assert list(made.task_rows) == ["hand"]
    np.testing.assert_allclose(output.error("hand"), expected, rtol=0, atol=1e-15)
    with pytest.raises(ControllerError, match=r"no task 'hand \(old\)' is active now"):
        output.error("hand (old)")


def test_each_has_its_columns_in_the_log() -> None:
    """Also for tasks of the same type: their errors are separate columns."""
    made = hsp.Controller(ROBOT, [point(OLD)], limits=None)
    made.at(0.1).ramp(0.2).remove("hand").add(point(NEW))
    log = hsp.simulate(
        made, ROBOT.home(), duration=0.5, control_period=H, check_rate=False
    )
    old, new = log["task.hand.error"], log["task.hand_2.error"]
    fading = (log.t > 0.1) & (log.t < 0.3)
    np.testing.assert_allclose((new - old)[fading] - (NEW - OLD), 0.0, atol=1e-12)
    assert np.isnan(new[log.t < 0.1]).all()
    assert np.isnan(old[log.t > 0.301]).all()
    assert np.isfinite(new[log.t > 0.301]).all()


def test_one_that_comes_later_goes_on_with_the_columns() -> None:
    made = hsp.Controller(ROBOT, [point(OLD)], limits=None)
    made.at(0.1).ramp(0.05).remove("hand")
    made.at(0.2).ramp(0.05).add(point(NEW))
    log = hsp.simulate(
        made, ROBOT.home(), duration=0.3, control_period=H, check_rate=False
    )
    assert "task.hand_2.error" not in log.columns
    gone = np.isnan(log["task.hand.error"]).all(axis=1)
    np.testing.assert_array_equal(gone, (log.t > 0.149) & (log.t <= 0.2))


def test_impedances_of_one_name_wait_by_themselves() -> None:
    """A stiffness that changes belongs to a task, not to a name."""
    soft, hard = (hsp.Impedance(k, damping_ratio=0.7) for k in (200.0, 800.0))
    at_home = point(np.zeros(3)).trajectory
    first = hsp.FramePosition("panda_tcp", at_home, impedance=soft, name="hand")
    second = hsp.FramePosition("panda_link4", impedance=soft, name="hand")
    made = hsp.Controller(ROBOT, [first], limits=None)
    made.at(0.05).ramp(0.2).impedance("hand", hard)
    made.at(0.1).ramp(0.4).remove("hand").add(second)
    for k in range(300):
        made.applied(made.compute(k * H, ROBOT.home(), REST).tau, H)
    placed = [each for stack in made.stacks for each in stack.stacked]
    found = [parts_of(each.in_force.numbers).K[0, 0] for each in placed]
    assert found == [800.0, 200.0]


def log_of_exchange(compensation: Compensation, new: hsp.Task) -> hsp.Rollout:
    """Return the log of a position that becomes another task of its name."""
    made = hsp.Controller(ROBOT, [point(OLD)], limits=None)
    made.at(0.05).ramp(0.1).remove("hand").add(new)
    return hsp.simulate(
        made,
        ROBOT.home(),
        duration=0.3,
        control_period=H,
        log_period=H,
        check_rate=False,
        compensation=compensation,
    )


@pytest.mark.parametrize("rows", [3, 6])
def test_each_has_its_force_in_the_log(rows: int) -> None:
    """Of as many rows or of others: an observer estimates both."""
    new = point(NEW) if rows == 3 else hsp.FramePose("panda_tcp", name="hand")
    log = log_of_exchange(Compensation(momentum_observer=MomentumObserver()), new)
    old, after = log["observer.wrench.hand"], log["observer.wrench.hand_2"]
    assert (old.shape[1], after.shape[1]) == (3, rows)
    for column, begin, end in ((old, 0.0, 0.15), (after, 0.05, 0.3)):
        there = np.isfinite(column).all(axis=1)
        assert there[(log.t > begin + H) & (log.t < end - H)].all()


def test_each_has_its_integral() -> None:
    """A task that is removed takes its integral along; the new one begins with its own.

    With integral action for all tasks, and for one by its name.
    """
    for tasks in (None, ["hand"]):
        action = IntegralAction(2.0, tasks=tasks)
        own = Compensation(momentum_observer=None, integral_action=action)
        log = log_of_exchange(own, point(NEW))
        old, new = log["task.hand.integral"], log["task.hand_2.integral"]
        full = log.t >= 0.15 + H
        error = log["task.hand_2.error"][full]
        np.testing.assert_allclose(new[log.t < 0.15][-1], 0.0)
        np.testing.assert_allclose(
            new[full][-1], H * error.sum(axis=0), rtol=0.05, atol=1e-6
        )
        assert np.isnan(old[-1]).all()


def efforts(compensated: CompensatedController) -> None:
    """Compute a hundred efforts, but for the first one."""
    for k in range(1, 100):
        compensated.effort(k * H, ROBOT.home(), REST, H)


def test_an_added_task_without_integral_action_is_named() -> None:
    """Integral action would make its error grow."""
    made = hsp.Controller(ROBOT, [point(OLD)], limits=None)
    own = Compensation(momentum_observer=None, integral_action=IntegralAction(2.0))
    compensated = CompensatedController(made, own)
    compensated.effort(0.0, ROBOT.home(), REST, H)
    turn = hsp.FrameOrientation("panda_tcp", gains=hsp.Gains(kp=2.0, kv=0.1), name="t")
    made.at(0.0).add(turn)
    with pytest.warns(StartWarning, match="task 't' begins without integral") as found:
        efforts(compensated)
    assert len(found) == 1
    assert "Ki must be below" in str(found[0].message)
    assert found[0].filename == __file__


def test_a_task_is_integrated_where_another_one_is_removed() -> None:
    made = hsp.Controller(
        ROBOT,
        [point(OLD), hsp.FrameOrientation("panda_tcp", name="turn")],
        limits=None,
    )
    action = IntegralAction(2.0, tasks=["hand"])
    own = Compensation(momentum_observer=None, integral_action=action)
    compensated = CompensatedController(made, own)
    compensated.effort(0.0, ROBOT.home(), REST, H)
    made.at(0.0).ramp(0.05).remove("turn")
    efforts(compensated)
    e = compensated.output.error("hand")
    channel = compensated.log_channels()["task.hand.integral"]
    np.testing.assert_allclose(channel.value, 100 * H * e, rtol=1e-9)


def now_and_later() -> hsp.Controller:
    """Return a controller whose hand becomes another one, of other gains, at 10 s."""
    later = replace(point(NEW), gains=hsp.Gains(natural_frequency=30.0))
    made = hsp.Controller(ROBOT, [point(OLD)])
    made.at(10.0).remove("hand").add(later)
    made.compute(0.0, ROBOT.home(), REST)
    return made


def test_commands_go_to_the_task_that_is_there() -> None:
    """Not to the one that takes its place later; nor are its numbers shown."""
    made = now_and_later()
    assert made.feedback("hand").Kp[0, 0] == 100.0
    assert made.weight_of("hand", 0.0) == 1.0
    made.set_target("hand", ROBOT.state(0.0, ROBOT.home(), REST).position("panda_tcp"))
    for k in range(1, 1001):
        output = made.compute(k * H, ROBOT.home(), REST)
    np.testing.assert_allclose(output.error("hand"), 0.0, atol=1e-9)
    made.compute(20.0, ROBOT.home(), REST)
    assert made.feedback("hand").Kp[0, 0] == 900.0


def test_a_weight_is_that_of_the_task_that_comes() -> None:
    """While it fades in; the older one is "hand (old)"."""
    made = changed()
    made.compute(0.0, ROBOT.home(), REST)
    weights = [made.weight_of("hand", t) for t in (0.05, 0.15, 0.2, 0.4)]
    np.testing.assert_allclose(weights, [1.0, 0.103515625, 0.5, 1.0])


def test_a_task_that_will_be_removed_can_be_commanded() -> None:
    made = hsp.Controller(ROBOT, [point(OLD)])
    made.at(10.0).remove("hand")
    made.compute(0.0, ROBOT.home(), REST)
    made.set_velocity("hand", [0.0, 0.0, 0.1])
    assert made.feedback("hand").Kp[0, 0] == 100.0
