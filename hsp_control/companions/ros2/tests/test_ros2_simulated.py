"""A simulated robot on topics: lockstep, and causes of its stop."""

from collections.abc import Callable, Iterator
from threading import Event, Thread

import numpy as np
import pytest
from live_rigs import PERIOD, law, watched
from loaded_robots import panda
from odd_errors import OddError
from places import covering
from played import wait_until
from ros2_rigs import DOMAIN, fresh

from hsp_control.companions.ros2 import simulated
from hsp_control.companions.ros2.hardware import Ros2Hardware
from hsp_control.companions.ros2.messages import Float64MultiArray, MultiArrayLayout
from hsp_control.companions.ros2.node import Node, TopicPublisher
from hsp_control.companions.ros2.simulated import RobotTopics, serve
from hsp_control.live import LiveSettings, Phase, SimulatedRobot, run_loop

LONG = 60.0
PATIENT = LiveSettings(age=1e9, missing=10_000, watchdog=10_000)


class Served:
    """A robot served in a thread, in lockstep."""

    def __init__(self) -> None:
        self.controller, _, self.address = fresh()
        self.robot: SimulatedRobot = watched(PATIENT)
        self.stop = Event()
        topics = RobotTopics(self.address, panda())
        self._thread = Thread(
            target=serve,
            args=(self.robot, topics),
            kwargs={
                "stop_reason": lambda: "enough" if self.stop.is_set() else None,
                "lockstep": True,
            },
        )
        self._thread.start()

    def sender(self) -> TopicPublisher[Float64MultiArray]:
        made = Node(DOMAIN).publisher(f"{self.controller}/commands", Float64MultiArray)
        assert made.matched == 1
        return made

    def ended(self) -> str:
        self._thread.join(LONG)
        assert not self._thread.is_alive()
        return self.robot.reason


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.stop.set()
    made.ended()


def test_a_loop_over_the_wire_comes_to_its_end(served: Served) -> None:
    hardware = Ros2Hardware(served.address, panda(), PERIOD, timeout=LONG)
    report = run_loop(law(), hardware, duration=0.2, settings=PATIENT)
    assert report.ended == "completed", report.reason
    assert served.ended() == "the loop closed the connection"


def test_efforts_of_another_order_reach_their_joints() -> None:
    order = [3, 0, 1, 2, 6, 4, 5]  # not its own inverse
    controller, _, address = fresh()
    names = ",".join(panda().dof_names[k] for k in order)
    topics = RobotTopics(f"{address}&joints={names}", panda())
    sender = Node(DOMAIN).publisher(f"{controller}/commands", Float64MultiArray)
    assert sender.matched == 1
    sender.send(Float64MultiArray(MultiArrayLayout(), list(map(float, order))))
    assert topics.wait(LONG)
    (effort,) = topics.efforts(1)
    np.testing.assert_array_equal(effort, np.arange(7.0))


def wrong_size(send: Callable[[list[float]], None], _: Served) -> None:
    send([0.0] * 6)


def not_finite(send: Callable[[list[float]], None], _: Served) -> None:
    send([np.nan, *[0.0] * 6])


def second_publisher(send: Callable[[list[float]], None], served: Served) -> None:
    other = served.sender()
    other.send(Float64MultiArray(MultiArrayLayout(), [0.0] * 7))


@pytest.mark.parametrize(("mistake", "reason"), [
    (wrong_size, "an effort has 6 numbers; the robot has 7 joints"),
    (not_finite, "an effort is not finite: [nan, 0.0, "),
    (second_publisher, "/commands: two publishers send efforts"),
])  # fmt: skip
def test_a_wrong_effort_stops_the_robot(
    served: Served, mistake: Callable[..., None], reason: str
) -> None:
    publisher = served.sender()

    def send(data: list[float]) -> None:
        publisher.send(Float64MultiArray(MultiArrayLayout(), data))

    send([0.0] * 7)
    mistake(send, served)
    assert reason in served.ended()
    assert served.robot.phase == Phase.HOLDING


class Listened:
    """Topics without a network: sent messages, with the test's clock."""

    commands, left = "/commands", False

    def __init__(self, late_at: int, late: float) -> None:
        self.now, self.late_at, self.late = 0.0, late_at, late
        self.sent: list[tuple[int, float]] = []

    def efforts(self, most: int) -> list[np.ndarray]:
        return [np.zeros(7)]

    def send(self, stamp: int, *_: object) -> None:
        self.sent.append((stamp, self.now))
        if len(self.sent) == self.late_at:
            self.now += self.late

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.mark.parametrize("late", [0.004, 0.2])
def test_stamps_go_on_where_the_process_did_not(
    late: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A few late periods are caught up; during many the robot rests while time
    advances."""
    topics, robot = Listened(10, late), watched(PATIENT)
    monkeypatch.setattr(simulated, "monotonic", lambda: topics.now)
    monkeypatch.setattr(simulated, "sleep", topics.sleep)
    reasons = iter([None] * 40)
    serve(
        robot,
        topics,  # type: ignore[arg-type]
        stop_reason=lambda: next(reasons, "enough"),
    )
    stamps, times = np.array(topics.sent[:40]).T
    ahead = (stamps - stamps[0]) * 1e-9 - (times - times[0])
    # At the end it is in step again, whether periods were caught up or skipped.
    assert abs(ahead[-1]) < 1.5 * PERIOD
    steps = np.diff(stamps) * 1e-9
    assert (steps.max() > 0.1) == (late > 0.1)


@pytest.mark.parametrize(
    ("function", "raised"),
    covering(["efforts", "send"], [OddError, MemoryError, GeneratorExit]),
)
def test_any_exception_of_a_topic_stops_the_robot(
    served: Served,
    function: str,
    raised: type[BaseException],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    publisher = served.sender()
    publisher.send(Float64MultiArray(MultiArrayLayout(), [0.0] * 7))
    wait_until(lambda: served.robot.phase == Phase.RUNNING)

    def fails(*_: object) -> None:
        raise raised("why")

    monkeypatch.setattr(RobotTopics, function, fails)
    publisher.send(Float64MultiArray(MultiArrayLayout(), [0.0] * 7))
    assert served.ended() == f"{raised.__name__}: why"
    assert served.robot.phase == Phase.HOLDING


def test_an_uncommanded_robot_ends_on_request(served: Served) -> None:
    served.stop.set()
    assert served.ended() == ""
    assert served.robot.phase == Phase.WAITING
