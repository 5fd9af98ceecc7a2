"""States published by a live loop, received by plain sockets in Python and C."""

import json
import math
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from live_rigs import Rig, start
from loaded_robots import panda
from ports import free_port

import hsp_control as hsp
from hsp_control.common.errors import HardwareError
from hsp_control.companions.datagrams import publish
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    MomentumObserver,
)
from hsp_control.live import run_loop

FAR = [2.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]


@pytest.fixture
def states() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.bind(("127.0.0.1", 0))
        heard.settimeout(60.0)
        yield heard


def command() -> CompensatedController:
    stream = hsp.StreamPose(speed=50.0, acceleration=1e4, jerk=1e6, delay=0.0)
    task = hsp.FramePose("panda_tcp", stream, largest_error=[0.01, None], name="hand")
    controller = hsp.Controller(panda(), [task], limits=hsp.Limits())
    observer = Compensation(momentum_observer=MomentumObserver())
    return CompensatedController(controller, observer)


def test_it_publishes_the_input_of_a_policy(states: socket.socket) -> None:
    source = command()
    reported = publish(f"127.0.0.1:{states.getsockname()[1]}?rate=100", source)
    truth = []

    def on_period(t: float) -> None:
        reported(t)
        truth.append((t, source.state.q.copy(), source.output.tau.copy()))
        if len(truth) == 50:
            source.controller.stream("hand").send(FAR)

    report = run_loop(source, Rig(), duration=0.2, on_period=on_period)
    reported.ended(report.ended, report.reason)
    heard = [json.loads(states.recv(65536)) for _ in range(23)]
    running, ends = heard[:20], heard[20:]
    assert [each["number"] for each in heard] == list(range(1, 24))
    assert {each["phase"] for each in running} == {"running"}
    assert [(each["phase"], each["reason"]) for each in ends] == [
        ("completed", "the duration is over")
    ] * 3
    for each in running:
        t, q, tau = truth[round(1000.0 * each["t"])]
        assert each["t"] == t
        assert each["q"] == q.tolist()
        assert each["tau"] == tau.tolist()
        hand = each["tasks"]["hand"]
        assert each["frames"] == {"panda_tcp": hand["actual"]}
        names = {"observer.disturbance", "observer.share", "observer.wrench.hand"}
        assert set(each["log"]) == names
        where = panda().state(t, q, np.zeros(7)).position("panda_tcp")
        np.testing.assert_allclose(hand["actual"][:3], where, atol=1e-12)
        away = math.dist(hand["actual"][:3], hand["reference"][:3])
        assert ("hand" in each["bounded"]) == (away > 0.01)
    first, last = running[0], running[-1]
    assert first["joints"] == list(panda().dof_names)
    assert (first["q"], first["bounded"]) == (start().tolist(), {})
    assert last["bounded"]["hand"] > 0.1
    assert (first["streams"]["hand"]["taken"], last["streams"]["hand"]["taken"]) == (
        0, 1,
    )  # fmt: skip


def test_the_page_s_client_receives_and_answers(capsys: pytest.CaptureFixture) -> None:
    page = (Path(__file__).parents[1] / "policies.md").read_text(encoding="utf-8")
    (client,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(client.splitlines()) <= 12
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as goals:
        goals.bind(("127.0.0.1", 0))
        port = free_port()
        client = client.replace("5005", str(goals.getsockname()[1]))
        client = client.replace("5006", str(port))
        space: dict = {}
        code = compile(client, "policies.md", "exec")
        thread = Thread(target=exec, args=(code, space), daemon=True)
        thread.start()
        source = command()
        reported = publish(f"127.0.0.1:{port}?rate=10", source)
        source.effort(0.0, start(), np.zeros(7), 0.001)
        goals.settimeout(0.05)
        for k in range(1000):  # it may not be listening yet
            reported(0.1 * k)
            with suppress(TimeoutError):
                goal = json.loads(goals.recv(65536))
                break
        reported.ended("operator", "stopped by the operator (Ctrl-C)")
        thread.join(60.0)
    assert capsys.readouterr().out == "stopped by the operator (Ctrl-C)\n"
    _, actual = source.controller.tasks[0].measure(source.state)
    expected = actual.copy()
    expected[2] += 0.001
    np.testing.assert_allclose(goal["value"], expected, rtol=0.0, atol=1e-15)
    for each in ("states", "targets"):
        space[each].close()


OTHER_LANGUAGE = """
const states = require("dgram").createSocket("udp4")
let last = null
states.on("message", text => {
  const state = JSON.parse(text)
  if (state.phase === "running") { last = state; return }
  console.log(JSON.stringify([last.q, last.tasks.hand.actual, state.phase]))
  states.close()
})
states.bind(0, "127.0.0.1", () => console.log(states.address().port))
"""


@pytest.mark.process
@pytest.mark.skipif(shutil.which("node") is None, reason="needs Node.js")
def test_a_client_in_another_language_receives_the_same_numbers() -> None:
    source = command()
    node = ["node", "-e", OTHER_LANGUAGE]
    with subprocess.Popen(node, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout is not None
        reported = publish(f"127.0.0.1:{int(client.stdout.readline())}", source)
        q, v = start(), 0.1 * np.ones(7)
        source.effort(0.0, q, v, 0.001)
        reported(0.0)
        reported.ended("fault", "a door was opened")
        heard = json.loads(client.stdout.readline())
    _, actual = source.controller.tasks[0].measure(source.state)
    assert heard == [q.tolist(), actual.tolist(), "fault"]


def test_nan_is_null(states: socket.socket) -> None:
    source = command()
    reported = publish(f"127.0.0.1:{states.getsockname()[1]}", source)
    source.effort(0.0, start(), np.zeros(7), 0.001)
    source.output.tau[2] = np.nan
    reported(0.0)
    reported.ended("completed", "")
    text = states.recv(65536).decode()
    assert "NaN" not in text
    assert json.loads(text)["tau"][2] is None


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("127.0.0.1", r"needs udp://HOST:PORT"),
        ("127.0.0.1:0", r"needs udp://HOST:PORT"),
        ("127.0.0.1:5006?rate=0", r"the rate is '0'; needs a number above 0"),
        ("127.0.0.1:5006?rates=9", r"unknown option 'rates'; did you mean 'rate'\?"),
        ("no.such.host.invalid:5006", r"udp://no.such.host.invalid:5006: .*[Nn]ame"),
        (f"{70 * 'h'}:5006", r":5006: not a host name"),
        ("a..b:5006", r":5006: not a host name"),
    ],
)
def test_mistakes_are_named(address: str, message: str) -> None:
    with pytest.raises(HardwareError, match=message):
        publish(address, command())


def test_a_send_error_is_reported_once_and_has_no_other_effect(
    caplog: pytest.LogCaptureFixture,
) -> None:
    source = command()
    reported = publish("255.255.255.255:5006", source)  # forbidden for a plain socket
    source.effort(0.0, start(), np.zeros(7), 0.001)
    reported(0.0)
    reported(1.0)
    reported.ended("completed", "")
    (line,) = caplog.messages
    assert line.startswith(
        "udp://255.255.255.255:5006: the state cannot be sent there: "
    )


def test_a_joint_without_limits_is_one_angle(states: socket.socket) -> None:
    """Its configuration is a cosine and a sine."""
    robot = hsp.Robot.load("planar3r")
    task = hsp.FramePosition("tip", axes="xy")
    source = CompensatedController(hsp.Controller(robot, [task]))
    reported = publish(f"127.0.0.1:{states.getsockname()[1]}", source)
    angles = np.array([0.3, -0.5, 0.9])
    q = robot.integrate(robot.neutral(), angles)
    source.effort(0.0, q, np.zeros(3), 0.001)
    reported(0.0)
    reported.ended("completed", "")
    np.testing.assert_allclose(json.loads(states.recv(65536))["q"], angles)
