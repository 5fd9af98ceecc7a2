"""A task's stream handle from its controller: messages reach the current run."""

import pickle
from collections.abc import Callable
from copy import copy, deepcopy
from threading import Thread
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.errors import StreamError
from hsp_control.control.stream_handle import StreamHandle

ROBOT = hsp.Robot.load("panda")
REST = np.zeros(7)
TARGET = [0.4, 0.1, 0.5]


def controller(trajectory: hsp.trajectories.Trajectory) -> hsp.Controller:
    hand = hsp.FramePosition(name="hand", trajectory=trajectory)
    return hsp.Controller(ROBOT, [hand])


def run(made: hsp.Controller, seconds: float) -> np.ndarray:
    """Make steps; return the reference after them."""
    for k in range(round(seconds / 0.01)):
        made.compute(0.01 * k, ROBOT.home(), REST)
    reference, _ = made.tasks[0].measure(made.state.read_only)
    return reference


def test_messages_before_the_first_step_are_read_in_it() -> None:
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
    """Also where a change introduces the stream, and after another reference replaced
    it."""
    made = controller(hsp.Hold())
    with pytest.raises(hsp.HspControlError, match="'hand' follows no stream, but Hold"):
        made.stream("hand")
    with pytest.raises(hsp.HspControlError, match="no task 'hnad'; did you mean"):
        made.stream("hnad")
    stream = made.set_target("hand", TARGET)
    assert isinstance(stream, StreamHandle)
    assert run(made, 5.0) == pytest.approx(TARGET, abs=1e-6)
    made.stream("hand").send([0.4, 0.0, 0.5])
    assert stream.counts()["taken"] == 1.0  # read in the next step
    made.compute(5.1, ROBOT.home(), REST)
    assert stream.counts()["taken"] == 2.0
    made.at(5.1).reference("hand", hsp.Hold())
    with pytest.raises(StreamError, match="any more: task 'hand' follows no stream"):
        stream.send(TARGET)
    made.at(5.1).remove("hand")
    made.compute(5.2, ROBOT.home(), REST)
    with pytest.raises(StreamError, match="any more: there is no task 'hand'"):
        stream.send_chunk([TARGET], [1.0])
    assert stream.counts()["taken"] == 2.0
    assert len(stream.record) == 2
    assert "StreamRun of Stream" in repr(stream)


def test_the_next_step_has_room_for_a_chunk() -> None:
    """Memory for it is made when it is sent, not in the step."""
    made = controller(hsp.trajectories.Stream())
    stream = made.stream("hand")
    run(made, 0.1)
    room = made.streams[0]._planned._room
    stream.send_chunk(np.tile(TARGET, (100, 1)), np.arange(1, 101) * 0.01)
    extended = made.streams[0]._planned._room
    assert extended.waypoints > room.waypoints
    made.compute(0.11, ROBOT.home(), REST)
    assert made.streams[0]._planned._room == extended


def test_only_the_thread_of_the_steps_rehearses_the_next_one() -> None:
    """The other would hold the lock meanwhile, for the time of many steps."""
    made = controller(hsp.trajectories.Stream())
    stream, rehearsed = made.stream("hand"), list[int]()
    made._rehearse = rehearsed.append  # type: ignore[method-assign]
    stream.send(TARGET)
    assert rehearsed == []  # nothing has begun
    run(made, 0.1)
    sender = Thread(target=stream.send, args=(TARGET,))
    sender.start()
    sender.join()
    assert rehearsed == []
    stream.send(TARGET)
    assert rehearsed == [1]


def test_a_target_that_is_refused_changes_nothing() -> None:
    made = controller(hsp.Hold())
    for wrong in ([0.4, np.nan, 0.5], [0.4, 0.1, 1e9]):
        with pytest.raises(hsp.HspControlError):
            made.set_target("hand", wrong)
    with pytest.raises(hsp.errors.StreamError, match="velocity has 2 numbers"):
        made.set_velocity("hand", [0.1, 0.0])
    assert made.changes == ()
    assert made.streams == ()


def test_a_stream_within_a_reference_is_commanded_by_its_declaration() -> None:
    point, turn = hsp.Stream(), hsp.StreamOrientation()
    pose = hsp.trajectories.ComposedPose(point, turn)
    made = hsp.Controller(ROBOT, [hsp.FramePose(trajectory=pose, name="hand")])
    made.stream(point).send(TARGET)
    made.stream(turn).send([1.0, 0.0, 0.0, 0.0])
    found = run(made, 5.0)
    assert [*found[:3], abs(found[3])] == pytest.approx([*TARGET, 1.0], abs=1e-6)
    with pytest.raises(
        hsp.HspControlError, match="follows no stream, but ComposedPose"
    ):
        made.stream("hand")
    with pytest.raises(hsp.HspControlError, match="nothing of this controller follows"):
        made.stream(hsp.Stream())  # equal, and another one


def test_one_declaration_that_two_tasks_follow_is_one_stream() -> None:
    both = hsp.Stream()
    arm = hsp.load_experiment("dual_panda").robot
    sides = [name for name in arm.frame_names if name.endswith("panda_tcp")]
    tasks = [hsp.FramePosition(side, both, axes="z") for side in sides]
    assert len(tasks) == 2
    made, rest = hsp.Controller(arm, tasks), np.zeros(arm.nv)
    made.stream(both).send([0.5])
    for k in range(500):
        made.compute(0.01 * k, arm.home(), rest)
    for task in made.tasks:
        assert task.measure(made.state.read_only)[0] == pytest.approx([0.5], abs=1e-6)


LED: dict[str, Callable[[], tuple[Any, Callable[[hsp.Controller], Any]]]] = {
    "a field": lambda: (
        (stream := hsp.Stream(np.zeros(7), delay=0.05)),
        lambda made: made.at(0.1).exchange(
            "target_posture", hsp.TargetPosture(ROBOT.home(), displacement=stream)
        ),
    ),
    "an obstacle": lambda: (
        (stream := hsp.Stream(delay=0.05)),
        lambda made: made.at(0.1).obstacle("ball", stream),
    ),
}


@pytest.mark.parametrize("call", LED)
def test_looking_ahead_moves_no_stream_of(call: str) -> None:
    """Nor a copy or a pickle, which continue independently, bit for bit."""

    def begun() -> hsp.Controller:
        ball = hsp.Obstacle("ball", hsp.Sphere(0.1), hsp.Hold([0.5, 0.2, 0.6]))
        away = hsp.fields.ObstacleClearance(obstacles=["ball"])
        field = hsp.fields.FieldSum([hsp.TargetPosture(ROBOT.home()), away])
        hand = hsp.FramePosition(name="hand")
        made = hsp.Controller(ROBOT, [hand], field, scene=[ball])
        made.compute(0.0, ROBOT.home(), REST)
        stream, lead = LED[call]()
        lead(made)
        size = 7 if call == "a field" else 3
        made.compute(0.12, ROBOT.home(), REST)
        made.stream(stream).send(0.3 * np.ones(size))
        return made

    def efforts(made: hsp.Controller, looking: bool = False) -> list[bytes]:
        found = []
        for k in range(20, 80):
            found.append(made.compute(0.01 * k, ROBOT.home(), REST).tau.tobytes())
            if looking:
                made.flow(5.0, ROBOT.home())
                made.stack(ROBOT.state(4.0, ROBOT.home(), REST))
        return found

    expected = efforts(begun())
    assert len(set(expected)) > 30  # it was moving
    assert efforts(begun(), looking=True) == expected
    assert efforts(deepcopy(begun())) == expected
    assert efforts(pickle.loads(pickle.dumps(begun()))) == expected


@pytest.mark.parametrize(
    "copied", [copy, deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
)
def test_a_message_to_a_copy_moves_the_copy_alone(copied: Callable[[Any], Any]) -> None:
    """Messages that wait when the copy is made move both."""
    made, rest = hsp.Controller(ROBOT, [hsp.FramePosition(name="hand")]), np.zeros(7)
    made.compute(0.0, ROBOT.home(), rest)
    made.set_target("hand", [0.4, 0.1, 0.5])
    again = copied(made)
    before = [each.compute(0.1, ROBOT.home(), rest).tau for each in (made, again)]
    np.testing.assert_array_equal(*before)
    again.set_target("hand", [0.4, -0.1, 0.5])
    for t in (0.3, 0.6):
        after = [each.compute(t, ROBOT.home(), rest).tau for each in (made, again)]
    assert np.abs(after[1] - after[0]).max() > 0.1
