"""The plugin's client, in pure Python, with a loop: part of `make test`."""

import json
import socket
from collections.abc import Callable, Iterator
from math import pi
from time import monotonic, sleep

import numpy as np
import pinocchio as pin
import pytest
from hsp_datagrams import Loop, LoopError, quaternion_of, rotation_vector_of
from live_rigs import Rig, panda, start

import hsp_control as hsp
from hsp_control.companions.datagrams import publish
from hsp_control.control.compensation import CompensatedController
from hsp_control.live import run_loop


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def states() -> str:
    return f"127.0.0.1:{free_port()}"


@pytest.fixture
def loop(states: str) -> Iterator[Loop]:
    opened = Loop(states, timeout=60.0)
    yield opened
    opened.close()


def hear_all(loop: Loop) -> None:
    last = None
    while True:
        last = loop.state(last)["number"]


def test_it_receives_states_and_moves_the_hand(states: str, loop: Loop) -> None:
    targets = f"127.0.0.1:{free_port()}"
    stream = hsp.StreamPose(source=f"udp://{targets}", delay=0.02)
    task = hsp.FramePose("panda_tcp", stream, name="hand")
    source = CompensatedController(hsp.Controller(panda(), [task]))
    told = publish(f"{states}?rate=50", source)
    hand = source.controller.tasks[0].trajectory
    first: list[float] = []

    def lead(t: float) -> None:
        told(t)
        period = round(1000.0 * t)
        if period % 100 or period > 300:
            return
        x, y, z, *turned = loop.state()["frames"]["panda_tcp"]
        first.append(z)
        if period < 300:
            loop.send(targets, [x, y, first[0] + 5e-5 * period, *turned])
        else:
            goals = [[x, y, first[0] + d, *turned] for d in (0.015, 0.02)]
            loop.send_chunk(targets, goals, [0.05, 0.1])
        while hand.run.inbox.count < len(first):  # the loop has no clock
            sleep(1e-3)

    report = run_loop(source, Rig(), duration=1.0, on_period=lead)
    counts = source.controller.stream("hand").counts()
    assert (counts["taken"], counts["rejected"]) == (4, 0)
    where = source.state.position("panda_tcp")
    rest = panda().state(0.0, start(), np.zeros(7)).position("panda_tcp")
    np.testing.assert_allclose(where - rest, [0.0, 0.0, 0.02], atol=1e-4)
    told.ended(report.ended, report.reason)
    with pytest.raises(LoopError, match="the loop has ended: the duration is over"):
        hear_all(loop)


Told = Callable[..., None]


@pytest.fixture
def tell(states: str) -> Iterator[Told]:
    host, port = states.split(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:

        def told(number: int, phase: str = "running", **more: object) -> None:
            state = {"number": number, "phase": phase, "reason": "", **more}
            sender.sendto(json.dumps(state).encode(), (host, int(port)))

        told.raw = lambda data: sender.sendto(data, (host, int(port)))  # type: ignore[attr-defined]
        yield told


def test_old_or_invalid_states_are_ignored(
    loop: Loop, tell: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged, is_newer = [], loop._is_newer

    def noted(received: dict) -> bool:
        judged.append((received["number"], is_newer(received)))
        return judged[-1][1]

    monkeypatch.setattr(loop, "_is_newer", noted)
    tell(5)
    tell(4)  # overtaken
    for text in (b"\xff", b"[1, 2]", b'{"number": 9}', b"{"):
        tell.raw(text)  # type: ignore[attr-defined]
    tell(6)
    tell(7, "fault")
    tell(7, "fault")
    tell(1)  # another run
    tell(2, t=0.01)
    end = monotonic() + 60.0
    while len(judged) < 7 and monotonic() < end:
        sleep(0.001)
    ends = [(7, True), (7, False)]
    assert judged == [(5, True), (4, False), (6, True), *ends, (1, True), (2, True)]
    assert loop.state(later_than=1)["t"] == 0.01


def test_a_loop_that_is_silent_or_a_port_that_is_taken_is_named(states: str) -> None:
    deaf = Loop(states, timeout=0.05)
    with pytest.raises(LoopError, match=rf"no state .* hsp live CONFIG .*{states}"):
        deaf.state()
    with pytest.raises(LoopError, match=rf"udp://{states}: cannot listen there"):
        Loop(states)
    deaf.close()
    with pytest.raises(ValueError, match="'5006' is no address; needs HOST:PORT"):
        Loop("5006")


def test_rotation_vectors_are_pinocchio_s_and_go_on_at_half_a_turn() -> None:
    rng = np.random.default_rng(0)
    for _ in range(1000):
        turn = rng.standard_normal(3) * rng.uniform(0.0, 2.0)
        q = pin.Quaternion(pin.exp3(turn)).coeffs()
        assert abs(q @ quaternion_of(turn)) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(
            pin.exp3(np.array(rotation_vector_of(q))), pin.exp3(turn), atol=1e-12
        )
    last, steps = None, []
    for angle in np.linspace(pi - 0.4, pi + 3.0, 200):  # a hand pointing down
        new = rotation_vector_of(quaternion_of([angle, 1e-3, 0.0]), last)
        steps.append(
            0.0 if last is None else float(np.linalg.norm(np.subtract(new, last)))
        )
        last = new
    assert max(steps) < 0.02
    ahead, behind = (
        rotation_vector_of(quaternion_of([pi + each, 0.0, 0.0])) for each in (0.1, -0.1)
    )
    np.testing.assert_allclose(np.subtract(ahead, behind), [0.2, 0.0, 0.0], atol=1e-12)
