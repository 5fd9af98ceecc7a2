"""A Franka arm as seen by the loop, with a client of given answers."""

import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from io import BytesIO
from math import pi
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.common.silence import Silence
from hsp_control.companions.franka import (
    FrankaHardware,
    FrankaSettings,
    Load,
    client,
    client_process,
    connection,
)
from hsp_control.companions.franka.client_process import ClientProcess
from hsp_control.live import Hardware, Measurement
from hsp_control.live.hardware import AdaptingHardware

APPLIED = np.linspace(-0.6, 0.6, 7)


class Answers:
    """A `ClientProcess` with the given answers.

    Attributes:
        requested: The letters of the requests.
        efforts: The sent efforts.
        patience: Timeout of the last answer [s].
    """

    def __init__(self) -> None:
        self.requested = b""
        self.efforts: list[Array] = []
        self.waiting = self.late = self.closed = False
        self.patience = 0.0
        self.last_words = ""
        self.fault: str | None = None
        self.t = 7.0

    def ask(self, message: bytes) -> None:
        assert not self.waiting
        self.waiting = True
        self.requested += message[:1]
        if message[:1] in {client.EFFORT, client.FINISH}:
            self.efforts.append(np.array(client.REQUEST.unpack(message)[1:]))

    def receive(self, timeout: float) -> bytes | None:
        self.patience = timeout
        self.fault = self.fault or self.last_words or None
        if self.fault is not None:
            raise HardwareError(self.fault)
        if self.late:
            return None
        self.waiting = False
        self.t = round(self.t + 0.001, 3)  # as in the arm's clock of milliseconds
        numbers = np.concatenate([np.arange(7.0), np.zeros(7), APPLIED])
        return client.STATE.pack(b"S", self.t, *numbers.tolist())

    def close(self) -> None:
        self.closed = True


def arm(**settings: float) -> tuple[FrankaHardware, Answers]:
    answers = Answers()
    chosen = FrankaSettings("a", **settings)  # type: ignore[arg-type]
    robot = Robot.load("panda")
    hardware = FrankaHardware(robot, answers, chosen, np.zeros(7), [])  # type: ignore[arg-type]
    return hardware, answers


def state(hardware: FrankaHardware) -> Measurement:
    found = hardware.read(0.001)
    assert found is not None
    return found


def test_control_starts_at_the_second_read_and_time_with_it() -> None:
    hardware, answers = arm()
    assert isinstance(hardware, Hardware)
    assert isinstance(hardware, AdaptingHardware)
    first, second = state(hardware), state(hardware)
    hardware.write(np.zeros(7))
    third = state(hardware)
    assert answers.requested == b"RSE"
    assert [m.sequence for m in (first, second, third)] == [0, 0, 1]
    np.testing.assert_allclose([first.t, second.t, third.t], [0.0, 0.0, 0.001])
    np.testing.assert_array_equal(third.q, np.arange(7.0))
    np.testing.assert_array_equal(third.applied, APPLIED)
    hardware.close()
    hardware.close()
    assert answers.requested == b"RSEF"
    assert answers.closed


def test_an_effort_answers_a_state() -> None:
    """Without a new state the last effort stays in force, and none is sent."""
    hardware, answers = arm()
    state(hardware)
    state(hardware)
    hardware.write(APPLIED)
    answers.late = True
    assert hardware.read(0.001) is None
    hardware.write(2.0 * APPLIED)
    answers.late = False
    state(hardware)
    assert answers.requested == b"RSE"
    answers.fault = "a reflex"
    with pytest.raises(HardwareError, match="a reflex"):
        hardware.read(0.001)
    assert hardware.fault == "a reflex"
    hardware.close()
    assert b"F" not in answers.requested


def test_a_box_in_lockstep_is_waited_for() -> None:
    hardware, answers = arm(lockstep=True)
    assert not hardware.real_time
    state(hardware)
    state(hardware)
    assert answers.patience == 60.0
    answers.late = True
    with pytest.raises(HardwareError, match="sent no state for 60 s"):
        hardware.read(0.001)


def test_states_are_numbered_by_the_arm_s_time() -> None:
    """Its clock is in milliseconds, which are not exact binary numbers."""
    hardware, _ = arm()
    state(hardware)
    state(hardware)
    for k in range(1, 500):
        hardware.write(APPLIED)
        assert state(hardware).sequence == k


def test_at_the_end_the_arm_s_reason_is_reported() -> None:
    hardware, answers = arm()
    state(hardware)
    state(hardware)
    hardware.write(APPLIED)
    answers.late = True
    assert hardware.read(0.001) is None
    assert hardware.fault is None
    answers.last_words = "a reflex"
    hardware.close()
    assert hardware.fault == "a reflex"
    assert answers.closed
    assert b"F" not in answers.requested


def test_without_the_gripper_s_process_the_arm_stops() -> None:
    hardware, _ = arm()
    gripper = hardware._gripper = ClientProcess.__new__(ClientProcess)
    gripper._link, theirs = socket.socketpair()
    gripper._silence = Silence(0.0)
    state(hardware)
    assert not state(hardware).fault
    theirs.close()  # as the system does for a dead process
    assert state(hardware).fault == "the process that drives the gripper has ended"
    gripper._link.close()


def test_a_gripper_s_process_that_hangs_is_noticed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not the gripper's client, nor while this process itself was stopped."""
    now = 10.0
    monkeypatch.setattr(client_process, "monotonic", lambda: now)
    process = ClientProcess.__new__(ClientProcess)
    process._link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    process._silence = Silence(now)
    with closing(theirs), closing(process._link):
        for step in 30 * [0.1] + [900.0] + 10 * [0.1]:
            now += step
            assert not process.trouble()
        theirs.send(client.ALIVE)
        for _ in range(51):  # the first one receives it
            now += 0.0999
            assert not process.trouble()
        now += 0.0999
        assert process.trouble() == "has sent nothing for 5 s"
        theirs.send(client.ALIVE)
        assert not process.trouble()


def how_many(call: Callable[[], object]) -> int:
    """Return how often a call succeeds before it would wait."""
    count = 0
    with suppress(BlockingIOError):
        while True:
            call()
            count += 1
    return count


def test_a_gripper_s_process_without_a_pause_does_not_hold_the_loop() -> None:
    """As many messages as a socket holds: a period reads a few of them."""
    process = ClientProcess.__new__(ClientProcess)
    process._link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    process._silence = Silence(0.0)
    with closing(theirs), closing(process._link):
        theirs.setblocking(False)
        sent = how_many(lambda: theirs.send(client.ALIVE))
        assert not process.trouble()
        process._link.setblocking(False)
        left = how_many(lambda: process._link.recv(client.LONGEST))
    assert sent > 100
    assert 0 < sent - left <= 20


@pytest.mark.parametrize("port", [0, 65536, 70000])
def test_a_port_that_is_none_is_named(port: int) -> None:
    with pytest.raises(LiveError, match=rf"gripper: port {port} is not between 1 and"):
        FrankaSettings("10.0.0.1", gripper=f"udp://127.0.0.1:{port}")


def test_both_processes_end_after_any_exception() -> None:
    class Fails(Answers):
        def close(self) -> None:
            super().close()
            raise KeyboardInterrupt

    hardware, _ = arm()
    hardware._process, hardware._gripper = both = Fails(), Fails()  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        hardware.close()
    assert [each.closed for each in both] == [True, True]


def test_ctrl_c_leaves_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """A client that hangs in libfranka does not see its connection close."""
    process = ClientProcess.__new__(ClientProcess)
    process._link, theirs = socket.socketpair()
    process._errors, process.waiting = BytesIO(), False  # type: ignore[assignment]
    hangs = [sys.executable, "-c", "import time; time.sleep(60)"]
    process._process = subprocess.Popen(hangs)

    def interrupted(self: Any, timeout: float | None = None) -> int:
        if timeout is not None:
            raise KeyboardInterrupt
        return ended(self)

    ended = subprocess.Popen.wait
    monkeypatch.setattr(subprocess.Popen, "wait", interrupted)
    with closing(theirs), pytest.raises(KeyboardInterrupt):
        process.close()
    assert process._process.returncode == -signal.SIGKILL
    assert process._errors.closed


def test_control_that_does_not_start_is_an_error() -> None:
    hardware, answers = arm()
    state(hardware)
    answers.late = True
    with pytest.raises(HardwareError, match="torque control did not start in 5 s"):
        hardware.read(0.001)


def test_the_filter_is_libfranka_s() -> None:
    """lowpass_filter.cpp: gain y + (1 - gain) y_last, gain = h / (h + 1 / (2 π f))."""
    hardware, answers = arm(cutoff_frequency=100.0)
    state(hardware)
    state(hardware)
    effort = APPLIED + 0.5
    hardware.write(effort)
    gain = 0.001 / (0.001 + 1.0 / (2.0 * pi * 100.0))
    wanted = gain * effort + (1.0 - gain) * APPLIED
    np.testing.assert_allclose(answers.efforts[-1], wanted, rtol=1e-12)
    unfiltered, answers = arm()
    state(unfiltered)
    state(unfiltered)
    unfiltered.write(effort)
    np.testing.assert_allclose(answers.efforts[-1], effort, rtol=1e-12)


def test_a_first_effort_with_gravity_is_refused() -> None:
    hardware, answers = arm()
    state(hardware)
    state(hardware)
    robot = Robot.load("panda")
    gravity = robot.inverse_dynamics(robot.home(), np.zeros(7), np.zeros(7))
    with pytest.raises(HardwareError, match=r"jumps by 2\d.* N·m; a Franka adds g"):
        hardware.write(gravity)
    assert answers.requested == b"RS"


def test_a_load_that_the_robot_did_not_take_is_refused() -> None:
    load = Load(0.5, center=[0.0, 0.0, 0.1])
    settings = FrankaSettings("a", load=load)
    taken = {"mass": 0.5, "center": [0.0, 0.0, 0.1], "inertia": [0.0] * 9}
    connection._check_load(settings, taken)
    for name, other in (("mass", 0.0), ("center", [0.0] * 3), ("inertia", [0.1] * 9)):
        with pytest.raises(HardwareError, match=f"reports {name} .* set_load"):
            connection._check_load(settings, taken | {name: other})


def test_without_pylibfranka_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(HardwareError, match=r"pip install 'hsp_control\[franka\]'"):
        ClientProcess()


def test_the_hand_and_the_load_of_an_arm_are_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = {
        "q": [0.0] * 7, "masses": [], "gravities": [],
        "end_effector": 0.73, "load": {"mass": 0.25}, "total": {"mass": 0.98},
    }  # fmt: skip
    monkeypatch.setattr(connection, "reached", lambda *_, **__: (Answers(), found))
    alike = SimpleNamespace(check=lambda mass: None, __str__=lambda: "alike")
    monkeypatch.setattr(connection, "difference", lambda *_: alike)
    hardware = connection.connect("a?realtime=ignore", Robot.load("panda"), 0.001)
    first, *_ = hardware.lines
    assert "end effector 0.73 kg (Desk), load 0.25 kg, " in first
