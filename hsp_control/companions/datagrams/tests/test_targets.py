"""Targets by datagrams: ports, senders, and streams that share a port."""

import json
import re
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import ROOT
from ports import free_port
from wording import wording

import hsp_control as hsp
from hsp_control import Stream
from hsp_control.cli.live_experiment import of_a_robot
from hsp_control.common.errors import StreamError
from hsp_control.companions.datagrams.targets import opened
from hsp_control.config.document import read_document
from hsp_control.trajectories.streams.followed import FollowedPoint, FollowedPose
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def wait_until(done: Callable[[], bool]) -> None:
    """Wait until something has happened in another thread."""
    for _ in range(6000):
        if done():
            return
        time.sleep(0.01)
    raise AssertionError("it did not happen")


def listening(port: int, part: str = "") -> FollowedPoint:
    stream = Stream([0.0], source=f"udp://127.0.0.1:{port}{part}").anchored(None)
    stream.sample(0.0)  # listens from now on
    return stream


def test_datagrams_arrive_and_bad_ones_are_counted_and_reported_once(
    port: int, sender: socket.socket, caplog: pytest.LogCaptureFixture
) -> None:
    stream = listening(port)
    inbox = stream.run.inbox
    bad = ("{", '{"value": [NaN]}', '{"value": [0.1, 0.2]}', "[]", "1" * 9000, "")
    backwards = '{"values": [[0.1], [0.2]], "times": [0.2, 0.1]}'
    for text in (*bad, backwards, backwards.replace("0.2", "0.3")):
        sender.sendto(text.encode(), ("127.0.0.1", port))
    sender.sendto(b'{"value": [0.1], "t": 3.5}', ("127.0.0.1", port))
    wait_until(lambda: inbox.count == 1)
    assert [caplog.text.count(each) for each in ("NaN is no", "times must")] == [1, 1]
    last = [stream.sample(t).position[0] for t in np.arange(0.0, 1.0, 0.01)][-1]
    assert last == pytest.approx(0.1, abs=1e-9)
    assert stream.run.counts()["rejected"] == 8
    assert "times[1] = 0.1 is not later" in stream.run.last_rejection


def test_a_second_sender_is_refused_until_the_first_is_silent(
    caplog: pytest.LogCaptureFixture,
) -> None:
    inbox = Inbox(Space(1, False), "udp://127.0.0.1:5005")

    def taken(sender: str, now: float) -> bool:
        before = inbox.count
        inbox.note_silence(now)
        try:
            inbox.receive(sender, now, {"value": [0.1], "t": now})
        except StreamError as error:
            inbox.reject(str(error))
        return inbox.count > before

    assert taken("a:1", 0.0)
    assert taken("b:2", 0.1)  # one message per sender is no stream yet
    for k in range(9):
        assert taken("a:1", 0.2 + 0.05 * k)
        assert not taken("b:2", 0.22 + 0.05 * k)
    assert not taken("b:2", 2.59)
    assert all(taken("b:2", 2.6 + 0.05 * k) for k in range(40))
    refused, silent = (each.partition("5005: ")[2] for each in caplog.messages)
    assert re.search(wording("a message is dropped: b:2 ... a:1 ... 2 s"), refused)
    assert silent.startswith("a:1 has been silent for 2 s; the reference rests where")


@pytest.mark.parametrize("source", ["udp://5005", "udp://a:5005/x/y", "udp://a:5/?"])
def test_a_wrong_address_is_named(source: str) -> None:
    with pytest.raises(StreamError, match=re.escape(f"{source!r}; needs udp://HOST")):
        Stream(source=source)


def test_an_invalid_host_name_is_reported() -> None:
    with pytest.raises(StreamError, match="cannot listen there: not a host name"):
        opened(f"udp://{70 * 'ö'}:5005", Space(3, False))


def test_a_port_in_use_is_reported_and_streams_of_one_process_share_it(
    port: int,
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", port))
        with pytest.raises(StreamError, match="cannot listen there: Address already"):
            listening(port)
    one, two = listening(port), listening(port)
    assert one.run.inbox is two.run.inbox
    with pytest.raises(StreamError, match="already carries 1 numbers; this stream"):
        Stream([0.0] * 2, source=f"udp://127.0.0.1:{port}").anchored(None).sample(0.0)
    with pytest.raises(
        StreamError, match="another stream of this process listens there"
    ):
        listening(port, "/left")


def test_a_port_is_free_again_when_its_streams_are_gone(port: int) -> None:
    for _ in range(3):
        listening(port)
    for _ in range(2):
        both = listening(port, "/left"), listening(port, "/right")
        del both


def test_a_robot_alone_leaves_the_port_to_its_loop(port: int) -> None:
    source = f"tasks.hand.trajectory.source=udp://127.0.0.1:{port}"
    document = read_document(ROOT / "examples/stream/panda.yaml")
    document.override(source)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as loop:
        loop.bind(("127.0.0.1", port))
        experiment = of_a_robot(document)
        with pytest.raises(StreamError, match="cannot listen there"):
            hsp.load_experiment(ROOT / "examples/stream/panda.yaml", source)
    assert isinstance(experiment.controller.tasks[0].trajectory, FollowedPose)


def test_each_stream_of_a_port_receives_its_part_or_none_does(
    port: int, sender: socket.socket
) -> None:
    left, right = listening(port, "/left"), listening(port, "/right")
    one, other = left.run.inbox, right.run.inbox
    for text, reason in (
        (
            {"left": {"value": [0.1]}, "right": {"value": [0.1, 0.2]}},
            "right: value has 2 numbers; this stream needs 1",
        ),
        ({"left": {"value": [0.1]}, "rihgt": {}}, "'rihgt'; did you mean 'right'?"),
        ([0.1], "a message to several streams needs a mapping"),
    ):
        before = other.rejected
        sender.sendto(json.dumps(text).encode(), ("127.0.0.1", port))
        wait_until(lambda before=before: other.rejected > before)  # type: ignore[misc]
        assert reason in left.run.last_rejection
        assert reason in right.run.last_rejection
    assert (one.count, other.count) == (0, 0)
    sender.sendto(b'{"t": 2, "left": {"value": [0.1]}}', ("127.0.0.1", port))
    wait_until(lambda: one.count == 1)
    ((_, message),) = one.after(0, take=False)
    assert (message.t, other.count) == (2.0, 0)


@pytest.mark.parametrize("senders", [1, 2])
def test_one_stream_of_two_poses_or_two_senders_lead_two_hands(
    port: int, sender: socket.socket, senders: int
) -> None:
    other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sides = {"left": 0.33, "right": -0.33}
    parts = {
        side: {"name": "panda", "position": [0, y, 0]} for side, y in sides.items()
    }
    source = f"udp://127.0.0.1:{port}"
    tasks = {
        side: {
            "type": "frame_pose",
            "frame": f"{side}_panda_tcp",
            "trajectory": {"type": "stream", "source": f"{source}/{side}"},
        }
        for side in sides
    }
    simulation = {"duration": 1.0, "control_period": 0.002, "log_period": 0.002}
    experiment = hsp.load_experiment(
        {"robot": {"parts": parts}, "tasks": tasks, "simulation": simulation}
    )
    controller, goals = experiment.controller, {}

    def lead(*_: Any) -> None:
        streams = [each.trajectory for each in controller.tasks]
        if controller.state.t < 0.1 or goals:
            return
        for task in controller.tasks:
            goals[task.name] = task.measure(controller.state)[1].tolist()
            goals[task.name][2] += 0.05
        reported = {name: {"value": each} for name, each in goals.items()}
        texts = (
            [reported]
            if senders == 1
            else [{name: reported[name]} for name in reported]
        )
        for _ in range(2):
            for one, text in zip((sender, other), texts, strict=False):
                data = json.dumps({"t": 7.0, **text}).encode()
                one.sendto(data, ("127.0.0.1", port))
        wait_until(lambda: all(each.run.inbox.count == 2 for each in streams))
        if senders == 2:  # every stream moves its own hand
            sender.sendto(data, ("127.0.0.1", port))
            wait_until(lambda: all(each.run.inbox.rejected for each in streams))
            assert re.match(r"right: \S+ is ignored: ", streams[0].run.last_rejection)

    run = experiment.run(on_row=lead)
    other.close()
    for name in sides:
        np.testing.assert_allclose(
            run[f"task.{name}.actual"][-1], goals[name], atol=1e-5
        )
        assert np.abs(run[f"task.{name}.error"]).max() < 5e-4
    heights = (run[f"task.{name}.reference"][:, 2] for name in sides)
    np.testing.assert_allclose(*heights, atol=1e-12)  # at the same times


@pytest.mark.parametrize(
    ("clock", "warned"),
    [
        (lambda k: 0.05 * k, []),
        (lambda k: 0.05 * k - 1e-3 * (k % 2) - 0.9 * (k == 7), []),  # late ones
        (lambda k: 0.05 * k - 5.0 * (k > 5), ["jumps back by 4.95 s"]),
        (lambda k: 0.05 * k + 3.0 * (k > 5), ["jumps ahead by 3 s"]),
        (lambda k: None, []),
    ],
)
def test_a_clock_that_jumps_is_reported_once(
    clock: Callable[[int], float | None],
    warned: list[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    inbox = Inbox(Space(1, False), "ros2://goal")
    for k in range(12):
        inbox.receive("one", 100.0 + 0.05 * k, {"value": [0.0], "t": clock(k)})
    for k in range(2):  # a restarted policy has another clock
        inbox.receive("two", 110.0 + 0.05 * k, {"value": [0.0], "t": 0.05 * k})
    assert [each.removeprefix("ros2://goal: the sender's clock ")
            for each in caplog.messages] == warned  # fmt: skip


def test_a_joystick_s_velocities_name_their_axes(
    port: int, sender: socket.socket
) -> None:
    stream = hsp.StreamPose(
        [0.0] * 3, [1.0, 0.0, 0.0], source=f"udp://127.0.0.1:{port}"
    ).anchored(pin.SE3.Identity())
    stream.sample(0.0)
    inbox = stream.run.inbox
    twist = [0.1, 0.0, 0.0, 0.0, 0.0, 0.4]
    for axes in ("tool", "hand"):
        data = json.dumps({"velocity": twist, "axes": axes}).encode()
        sender.sendto(data, ("127.0.0.1", port))
    wait_until(lambda: inbox.count + inbox.rejected == 2)
    assert inbox.reason == "axes is 'hand'; needs 'world' or 'tool'"
    stream.sample(0.01)
    found = stream.sample(0.11)  # it was read 0.1 s ago
    assert found.orientation.rotation.T @ found.position.velocity == pytest.approx(
        twist[:3], abs=1e-9
    )
