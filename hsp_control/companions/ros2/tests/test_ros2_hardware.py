"""A robot on topics: joints by name, states by stamp, and errors are named."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from live_rigs import PERIOD, law, start
from loaded_robots import panda
from robot_cases import load
from ros2_rigs import DOMAIN, MILLISECOND, Broadcaster, fresh, joint_state

from hsp_control.common.errors import HardwareError
from hsp_control.companions.ros2 import connect
from hsp_control.companions.ros2 import hardware as ros2_hardware
from hsp_control.companions.ros2.hardware import Ros2Hardware
from hsp_control.companions.ros2.joints import Joints
from hsp_control.companions.ros2.messages import Float64MultiArray
from hsp_control.companions.ros2.node import Node, ReceivedMessage, Subscription
from hsp_control.companions.ros2.stamps import Stamps
from hsp_control.control.compensation import CompensatedController, Compensation
from hsp_control.live import LiveSettings, run_loop
from hsp_control.live.link import AgeEstimator

NAMES = panda().dof_names
LONG = 30.0


class Rig:
    """A robot that publishes states and receives efforts, and the hardware for it."""

    def __init__(self, options: str = "", **message: object) -> None:
        controller, states, self.address = fresh()
        self.address += options
        self.states = states
        node = Node(DOMAIN)
        self.efforts: Subscription[Float64MultiArray]
        self.efforts = node.subscription(f"{controller}/commands", Float64MultiArray)
        self.robot = Broadcaster(states, **message)  # type: ignore[arg-type]

    def connected(self) -> Ros2Hardware:
        """Return the hardware; afterwards states arrive one by one."""
        with self.robot.sending():
            found = Ros2Hardware(self.address, panda(), PERIOD, timeout=LONG)
        while found.read(0.0) is not None:
            pass
        return found


@pytest.fixture
def rig() -> Iterator[tuple[Rig, Ros2Hardware]]:
    made = Rig()
    hardware = made.connected()
    yield made, hardware
    hardware.close()


# --- joints --------------------------------------------------------------------------


def test_joints_are_found_by_name_in_any_order() -> None:
    rng, joints = np.random.default_rng(0), Joints(panda())
    for _ in range(20):
        order = rng.permutation(7)
        q, v = rng.standard_normal((2, 7))
        names = tuple(NAMES[i] for i in order)
        message = joint_state(1, names, q[order].tolist(), v[order].tolist())
        state = joints.state(message, "/js")
        assert state is not None
        assert np.array_equal(state, (q, v))


def test_a_message_becomes_the_joints_measurement() -> None:
    for robot in (panda(), load("planar3r")):
        rng, joints = np.random.default_rng(1), Joints(robot)
        q, v = robot.random_configuration(rng), rng.standard_normal(robot.nv)
        tau = rng.standard_normal(robot.nv)
        message = joints.message(3, q, v, tau)
        state = joints.state(message, "/js")
        assert state is not None
        assert np.allclose(state[0], q, atol=1e-15, rtol=0.0)
        assert np.array_equal(state[1], v)
        assert message.effort == tau.tolist()


@pytest.mark.parametrize(("order", "message"), [
    ("a", "joints=a: the robot has no joint 'a'"),
    (",".join(NAMES[1:]), "joints=.*: 'panda_joint1' is missing"),
    (",".join([*NAMES, NAMES[0]]), "joints=.*: a joint is there twice"),
])  # fmt: skip
def test_an_order_of_commands_has_every_joint_once(order: str, message: str) -> None:
    with pytest.raises(HardwareError, match=message):
        Joints(panda()).command_order(order)


@pytest.mark.parametrize(("names", "message"), [
    (NAMES[:-1], r"/js: a message lacks panda_joint7; it has panda_joint1, "),
    ((*NAMES, NAMES[2]), r"/js: a message names panda_joint3 twice"),
])  # fmt: skip
def test_a_message_has_every_joint_once(names: tuple[str, ...], message: str) -> None:
    with pytest.raises(HardwareError, match=message):
        Joints(panda()).state(joint_state(1, names, [0.0] * len(names)), "/js")


# --- reading and writing -------------------------------------------------------------


def test_the_newest_of_many_is_used_and_old_ones_are_not(
    rig: tuple[Rig, Ros2Hardware],
) -> None:
    made, hardware = rig
    for k in range(500):  # a flood
        made.robot.send(v=[1e-3 * k] * 7)
    found = hardware.read(LONG)
    while (newer := hardware.read(0.05)) is not None:
        found = newer
    assert found is not None
    assert found.v[0] == 0.499
    made.robot.stamp -= 2 * MILLISECOND
    made.robot.send(v=[9.0] * 7)
    made.robot.send(v=[9.0] * 7)
    assert hardware.read(0.05) is None
    assert hardware.old == 2


def test_efforts_arrive_in_the_order_of_the_controller() -> None:
    order = [3, 0, 1, 2, 6, 4, 5]  # not its own inverse
    rig = Rig("&joints=" + ",".join(NAMES[k] for k in order))
    hardware = rig.connected()
    hardware.write(np.arange(7.0))
    assert rig.efforts.wait(LONG)
    assert rig.efforts.take()[0].message.data == list(map(float, order))
    hardware.close()
    hardware.close()
    assert hardware.read(0.0) is None


# --- errors --------------------------------------------------------------------------


def test_a_faulty_message_is_a_reason_to_stop_once(
    rig: tuple[Rig, Ros2Hardware],
) -> None:
    made, hardware = rig
    made.robot.send()
    good = hardware.read(LONG)
    made.robot.send(v=[0.0] * 6)
    made.robot.send(names=NAMES[:5], q=[0.0] * 5)
    bad = hardware.read(LONG)
    assert good is not None
    assert bad is not None
    assert bad.fault == (
        f"{made.states}: a message has 7 names, and velocity has 6 numbers"
    )
    assert bad.sequence > good.sequence
    made.robot.send(v=[0.25] * 7)
    after = hardware.read(LONG)
    assert after is not None
    assert not after.fault
    assert after.sequence > bad.sequence
    assert after.v[0] == 0.25


def test_a_fault_is_not_hidden_by_a_good_state_that_came_with_it(
    rig: tuple[Rig, Ros2Hardware], monkeypatch: pytest.MonkeyPatch
) -> None:
    made, hardware = rig
    sender = hardware._sender
    assert sender is not None
    messages = [
        joint_state(made.robot.stamp + k * MILLISECOND, v=[0.0] * (6 if k == 2 else 7))
        for k in range(1, 4)
    ]
    taken = [ReceivedMessage(each, sender) for each in messages]
    monkeypatch.setattr(hardware._subscription, "take", lambda: taken)
    found = hardware.read(0.0)
    assert found is not None
    assert found.fault.endswith("has 7 names, and velocity has 6 numbers")


def test_two_publishers_of_these_joints_are_a_reason_to_stop(
    rig: tuple[Rig, Ros2Hardware],
) -> None:
    made, hardware = rig
    Broadcaster(made.states, v=[1.0] * 7).send()
    found = hardware.read(LONG)
    assert found is not None
    assert found.fault == f"{made.states}: two publishers send these joints"
    assert not found.v.any()


class Faulty:
    """Hardware in lockstep with a broadcaster whose 20th state is wrong."""

    period = PERIOD

    def __init__(self, rig: Rig, hardware: Ros2Hardware, **wrong: object) -> None:
        self.rig, self.hardware, self.wrong = rig, hardware, wrong
        self.reads, self.writes = 0, 0

    def read(self, timeout: float) -> object:
        self.reads += 1
        if self.reads < 300:
            self.rig.robot.send(**(self.wrong if self.reads == 20 else {}))
            return self.hardware.read(LONG)
        return self.hardware.read(0.0)

    def write(self, effort: np.ndarray) -> None:
        self.writes += 1
        self.hardware.write(effort)

    def close(self) -> None:
        self.hardware.close()


@pytest.mark.parametrize(("wrong", "reason"), [
    ({"v": [0.0, np.nan, *[0.0] * 5]}, r"the state is not finite: v\[1\] is nan"),
    ({"v": []}, r"a message has 7 names, and velocity has 0 numbers"),
    ({"names": NAMES[1:], "q": [0.0] * 6}, r"a message lacks panda_joint1; it has"),
    ({"q": [9.0, *start()[1:]]}, r"panda_joint1 is at 9, outside"),
])  # fmt: skip
def test_the_loop_stops_safely(
    rig: tuple[Rig, Ros2Hardware], wrong: dict[str, object], reason: str
) -> None:
    hardware = Faulty(*rig, **wrong)
    settings = LiveSettings(age=1e9)
    # No observer: this robot is at rest under any effort.
    plain = CompensatedController(law(), Compensation(momentum_observer=None))
    report = run_loop(plain, hardware, settings=settings)  # type: ignore[arg-type]
    assert report.ended == "fault"
    assert reason.replace("\\", "") in report.reason
    assert not report.silent
    assert hardware.writes > 150  # later valid states are used by the safe stop


def test_a_topic_without_subscribers(rig: tuple[Rig, Ros2Hardware]) -> None:
    made, hardware = rig
    del made.efforts
    with pytest.raises(HardwareError, match=r"no subscriber of /.*/commands is left"):
        hardware.write(np.zeros(7))


@contextmanager
def refused(message: str) -> Iterator[None]:
    with pytest.raises(HardwareError, match=message):
        yield


def refuses(address: str, message: str) -> None:
    """Check the reason; on a busy computer messages are late."""
    for patience in (1.0, 10.0, 60.0):
        with pytest.raises(HardwareError) as caught:
            Ros2Hardware(address, panda(), PERIOD, timeout=patience)
        if re.search(message, str(caught.value)):
            return
    raise AssertionError(caught.value)


def test_a_robot_that_is_not_there_is_not_waited_for_in_silence() -> None:
    controller, states, address = fresh()
    with refused(rf"no publisher of {states} in domain {DOMAIN} \(topics with sens"):
        Ros2Hardware(address, panda(), PERIOD, timeout=0.2)
    robot = Broadcaster(states)
    with robot.sending():
        refuses(address, f"no subscriber of {controller}/commands")


@pytest.mark.parametrize(("message", "reason"), [
    ({"step": 2 * MILLISECOND}, r"a state every 0.002 s; the loop's period is"),
    ({"step": MILLISECOND // 2}, r"a state every 0.0005 s; the loop's period is"),
    ({"step": 0}, r"the stamps of the states do not increase"),
    ({"names": ("a",), "q": [0.0]}, r"no state of panda_joint1, .* arrived"),
    ({"names": NAMES[:3], "q": [0.0] * 3}, r"a message lacks panda_joint4, "),
    ({"v": []}, r"a message has 7 names, and velocity has 0 numbers"),
])  # fmt: skip
def test_a_robot_that_does_not_fit_is_refused(
    message: dict[str, object], reason: str
) -> None:
    rig = Rig(**message)
    with rig.robot.sending():
        refuses(rig.address, reason)


def test_without_cyclone_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "cyclonedds.domain", None)
    with refused(
        r"needs Cyclone DDS; install it with: pip install 'hsp_control\[ros2\]"
    ):
        connect("a", panda(), PERIOD)


# --- ages ----------------------------------------------------------------------------


def test_a_state_is_as_old_as_it_waited_longer_than_the_quickest(
    rig: tuple[Rig, Ros2Hardware], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its stamp, for any offset of the robot's clock; its number has no effect."""
    _, hardware = rig
    now = [0.0]
    monkeypatch.setattr(ros2_hardware, "monotonic", lambda: now[0])
    hardware._ages = AgeEstimator()
    hardware._stamps = Stamps(0.002)
    joints = Joints(panda())
    stamp, begun, last, ages = 77_000_000_000, 0.0, 0.0, []
    for k, delay in enumerate((0.003, 0.028, 0.001, 0.006)):
        sent = 0.002 * k + (0.0007 if k == 2 else 0.0)  # with jitter
        now[0] = 500.0 + sent + delay
        message = joints.message(
            stamp + round(1e9 * sent), start(), np.zeros(7), np.zeros(7)
        )
        found = hardware._measurement(ReceivedMessage(message, sender_of(hardware)))
        assert found is not None
        assert found.t == pytest.approx(begun + sent - last)
        begun, last = 5.0 + 3.0 * k, sent  # time may restart at any state
        hardware._stamps.begin(begun)
        assert found.sequence == k
        ages.append(found.age)
    np.testing.assert_allclose(ages, [0.0, 0.025, 0.0, 0.005], rtol=0, atol=1e-9)


def sender_of(hardware: Ros2Hardware) -> int:
    """Return the publisher that the hardware receives from."""
    sender = hardware._sender
    assert sender is not None
    return sender


def test_the_first_two_reads_are_a_period_apart(rig: tuple[Rig, Ros2Hardware]) -> None:
    """For any jump of the robot's clock during the preparation in between."""
    made, hardware = rig
    hardware._reads, times = 0, []
    for _ in range(4):
        made.robot.stamp += 700 * MILLISECOND * (len(times) == 1)
        made.robot.send()
        found = hardware.read(LONG)
        assert found is not None
        times.append(found.t)
    np.testing.assert_allclose(times, PERIOD * np.arange(4), atol=1e-9)


def test_a_second_faulty_message_is_passed_over(rig: tuple[Rig, Ros2Hardware]) -> None:
    """The safe stop needs the good states."""
    made, hardware = rig
    made.robot.send()
    assert hardware.read(LONG) is not None
    made.robot.send(v=[0.0] * 6)
    bad = hardware.read(LONG)
    assert bad is not None
    assert bad.fault
    made.robot.send(v=[0.0] * 6)
    made.robot.send(v=[0.25] * 7)
    found = hardware.read(LONG)
    assert found is not None
    assert not found.fault
    assert found.v[0] == 0.25
