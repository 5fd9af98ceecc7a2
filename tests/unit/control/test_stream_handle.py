"""The stream of a task, as a controller gives it: heard in whichever run it is."""

from threading import Thread

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.control.stream_handle import StreamHandle

ROBOT = hsp.Robot.load("panda")
REST = np.zeros(7)
TARGET = [0.4, 0.1, 0.5]


def controller(trajectory: hsp.trajectories.Trajectory) -> hsp.Controller:
    hand = hsp.FramePosition(name="hand", trajectory=trajectory)
    return hsp.Controller(ROBOT, [hand])


def run(made: hsp.Controller, seconds: float) -> np.ndarray:
    """Make steps; return where the reference is then."""
    for k in range(round(seconds / 0.01)):
        made.compute(0.01 * k, ROBOT.home(), REST)
    reference, _ = made.tasks[0].measure(made.state.read_only)
    return reference


def test_what_is_sent_before_the_first_step_is_heard_in_it() -> None:
    made = controller(hsp.trajectories.Stream())
    stream = made.stream("hand")
    stream.send(TARGET)
    assert run(made, 5.0) == pytest.approx(TARGET, abs=1e-6)
    assert stream.counts()["taken"] == 1.0
    assert len(stream.record) == 1
    assert stream.record[0]["value"] == TARGET


def test_it_goes_on_in_the_next_run() -> None:
    made = controller(hsp.trajectories.Stream())
    stream = made.stream("hand")
    stream.send(TARGET)
    run(made, 5.0)
    made.restart()
    start = ROBOT.state(0.0, ROBOT.home(), REST).position("panda_tcp")
    assert run(made, 1.0) == pytest.approx(start, abs=1e-12)
    assert stream.counts()["taken"] == 0.0
    sender = Thread(target=stream.send_chunk, args=([start, TARGET], [0.0, 1.0]))
    sender.start()
    sender.join()
    made.restart()
    assert run(made, 5.0) == pytest.approx(TARGET, abs=1e-6)
    assert stream.counts()["taken"] == 1.0


def test_a_target_gives_the_same_stream() -> None:
    """Also where a change brings it, and after another reference took over."""
    made = controller(hsp.Hold())
    with pytest.raises(hsp.HspControlError, match="'hand' follows no stream, but Hold"):
        made.stream("hand")
    with pytest.raises(hsp.HspControlError, match="no task 'hnad'; did you mean"):
        made.stream("hnad")
    stream = made.set_target("hand", TARGET)
    assert isinstance(stream, StreamHandle)
    assert run(made, 5.0) == pytest.approx(TARGET, abs=1e-6)
    made.stream("hand").send([0.4, 0.0, 0.5])
    assert stream.counts()["taken"] == 1.0  # it is taken in a step
    made.compute(5.1, ROBOT.home(), REST)
    assert stream.counts()["taken"] == 2.0
    made.at(5.1).reference("hand", hsp.Hold())
    with pytest.raises(hsp.HspControlError, match="follows no stream"):
        stream.send(TARGET)
