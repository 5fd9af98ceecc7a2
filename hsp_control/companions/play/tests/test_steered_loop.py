"""A steered live loop without a page: messages become motion of the robot."""

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli.live_experiment import simulated_robot
from hsp_control.companions.play import steering
from hsp_control.companions.play.live_loop import (
    TIMEOUT,
    Channel,
    DeadMansKey,
    Mirror,
    SteeredLoop,
    channel_pair,
)
from hsp_control.companions.viewer import SceneRecorder, Viewer
from hsp_control.companions.viewer.live_picture import Picture
from hsp_control.control.compensation import CompensatedController
from hsp_control.live import InProcessRobot, LoopReport, OperatorRequests, run_loop
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import sample_weight


class Steered:
    """A steered loop in simulated time; messages arrive at times of the loop."""

    def __init__(self, journal: Path, **more: Any) -> None:
        self.experiment = hsp.load_experiment("panda_obstacle")
        controller = self.experiment.controller
        controller.compute(0.0, self.experiment.q0, self.experiment.v0)
        self.here, there = channel_pair()
        self.page = Channel(there)
        self.requests = OperatorRequests()
        self.now = 0.0
        self.loop = SteeredLoop(
            controller, 0.001, self.here, self.requests, clock=lambda: self.now, **more
        )
        self.journal = journal
        self.said: list[tuple[float, dict[str, Any]]] = []
        self.heard: list[dict[str, Any]] = []
        self.each: list[Any] = []

    def close(self) -> None:
        self.here.close()
        self.page.close()

    def at(self, t: float, **message: Any) -> None:
        self.said.append((t, message))

    def on_period(self, t: float) -> None:
        self.now = t
        while self.said and self.said[0][0] <= t:
            self.page.send(self.said.pop(0)[1])
        self.loop.on_period(t)
        for action in self.each:
            action(t)

    def run(self, duration: float) -> LoopReport:
        experiment = self.experiment
        return run_loop(
            CompensatedController(experiment.controller, experiment.compensation),
            InProcessRobot(simulated_robot(experiment)),
            duration=duration,
            requests=self.requests,
            log=self.journal,
            scene=experiment.scene,
            on_period=self.on_period,
        )


@pytest.fixture
def steered(tmp_path: Path) -> Iterator[Steered]:
    steered = Steered(tmp_path / "live.journal")
    yield steered
    steered.close()


@pytest.fixture
def keyed(tmp_path: Path) -> Iterator[Steered]:
    """Its dead-man key is held at the beginning."""
    key = DeadMansKey(lambda: steered.now)
    steered = Steered(tmp_path / "live.journal", key=key)
    key.update(held=True)
    yield steered
    steered.close()


def test_a_dragged_target_is_reached(steered: Steered) -> None:
    targets, obstacles = steered.loop.handles.places()
    pose = np.array(targets["hand"])
    pose[:3] += [0.02, -0.05, 0.06]
    ball = np.add(obstacles["ball"], [0.1, 0.1, -0.1])
    steered.at(0.1, do="move", target="hand", pose=pose.tolist())
    steered.at(0.1, do="obstacle", name="ball", position=ball.tolist())
    steered.at(0.2, do="set", id="null_space_gain", value=20.0)
    steered.at(0.3, do="dance")
    assert steered.run(2.0).ended == "completed"
    log = hsp.Rollout.load(steered.journal)
    np.testing.assert_allclose(log["task.hand.actual"][-1, :3], pose[:3], atol=1e-4)
    np.testing.assert_allclose(log["obstacle.ball"][-1], ball, atol=1e-9)
    assert np.abs(log["task.hand.error"][log.t > 0.1]).max() < 1e-3
    words = steered.page.receive(1000)
    assert words[-1]["values"]["null_space_gain"] == 20.0
    refused = [word for word in words if "cannot do" in word["message"]]
    assert refused
    assert [word["warning"] for word in words] == [word in refused for word in words]
    np.testing.assert_allclose(words[-1]["targets"]["hand"][:3], pose[:3], atol=1e-9)


def test_who_lets_go_of_the_key_stops_the_robot(keyed: Steered) -> None:
    """A timeout after the last message; the end is that of any safe stop."""
    for k in range(11):
        keyed.at(0.05 * k, do="hold", held=True)
    report = keyed.run(5.0)
    assert report.ended == "operator"
    assert report.reason == "the dead-man's key was released"
    log = hsp.Rollout.load(keyed.journal)
    stopped = log.t[log["live.phase"] >= 2.0][0]
    assert stopped == pytest.approx(0.5 + TIMEOUT, abs=0.003)


@pytest.mark.parametrize(("message", "reason"), [
    ({"do": "hold", "held": False}, "the dead-man's key was released"),
    ({"do": "left"}, "the dead-man's key was released"),
    ({"do": "stop"}, "stopped from the page"),
])  # fmt: skip
def test_it_stops_at_once(keyed: Steered, message: dict[str, Any], reason: str) -> None:
    keyed.at(0.1, **message)
    report = keyed.run(5.0)
    assert report.reason == reason
    log = hsp.Rollout.load(keyed.journal)
    stopped = log.t[log["live.phase"] >= 2.0][0]
    assert stopped == pytest.approx(0.1, abs=0.003)


def test_messages_after_the_stop_have_no_effect(steered: Steered) -> None:
    for x, said in ((0.5, {"do": "nothing"}), (0.6, {"do": "stop"})):
        steered.page.send(said)
        steered.page.send({"do": "obstacle", "name": "ball", "position": [x, 0.0, 1.0]})
        steered.loop.listen()
        assert steered.loop.handles.places()[1]["ball"] == [0.5, 0.0, 1.0]
    assert steered.requests.reason == "stopped from the page"


def test_an_excess_message_is_dropped_without_waiting() -> None:
    here, there = channel_pair()
    other = Channel(there)
    for _ in range(10_000):
        here.send({"do": "nothing", "text": "x" * 200})
    words = other.receive(100_000)
    assert 0 < len(words) < 10_000
    assert other.receive() == []
    assert not here.lost
    other.close()
    here.send({})
    assert here.lost
    assert here.receive() == []
    here.close()


def test_the_picture_follows_the_journal(steered: Steered) -> None:
    """The mirror draws the loop's rows; its field follows the loop's."""
    experiment = hsp.load_experiment("panda_obstacle")
    heard, page_end = channel_pair()
    mirror = Mirror(experiment, 0.001, steered.journal, heard, held=False)
    loop_side = Channel(page_end)
    with Viewer(experiment.robot, transport=SceneRecorder()) as viewer:
        picture = Picture(mirror, viewer)
        start = {c.path: c for c in picture.frame(running=True, rate=1.0)}
        assert start
        steered.at(0.1, do="set", id="field", value=False)
        pose = np.array(steered.loop.handles.places()[0]["hand"])
        pose[2] += 0.05
        steered.at(0.1, do="move", target="hand", pose=pose.tolist())

        def look(t: float) -> None:
            for word in steered.page.receive():
                loop_side.send(word)
            mirror.read()

        steered.each.append(look)
        steered.run(1.6)  # changes are forgotten a second after they are complete
        assert mirror.over == ""
        mirror.read()
        picture.frame(running=False, rate=1.0)
    assert mirror.over == "the duration is over"
    assert mirror.handles.values["field"] is False
    mirrored = mirror.controller
    weights = [
        sample_weight(term.weight, mirrored.state)[0]
        for term in terms_of(mirrored.field)
    ]
    assert weights == [0.0, 0.0]
    targets, _ = mirror.handles.places()
    np.testing.assert_allclose(targets["hand"], pose, atol=1e-9)
    log = hsp.Rollout.load(steered.journal)
    assert mirror.t == log.t[-1]
    np.testing.assert_array_equal(mirror.controller.state.q, log.q[-1])
    mirror.say({"do": "obstacle", "name": "ball", "position": [0.3, 0.3, 0.3]})
    (passed,) = loop_side.receive()
    assert json.dumps(passed)
    assert passed["position"] == [0.3, 0.3, 0.3]
    ball = mirror.handles.obstacles["ball"]  # its zone follows it here
    assert ball.where(mirrored.state) == [0.3, 0.3, 0.3]
    loop_side.close()
    heard.close()


def test_a_page_whose_process_ends_is_a_fault(steered: Steered) -> None:
    """Without a page no operator can stop the robot: this is a fault."""
    steered.each.append(lambda t: steered.page.close() if t > 0.05 else None)
    report = steered.run(1.0)
    assert "the process of the page has ended" in report.reason
    assert steered.requests.fault


def test_the_rate_of_a_live_loop_is_that_of_the_last_second(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a loop at half of real time that waited for 100 s first."""
    clock: list[float] = [500.0]
    rates: list[float] = []
    monkeypatch.setattr(steering, "monotonic", lambda: clock[-1])
    monkeypatch.setattr(steering, "sleep", lambda s: clock.append(clock[-1] + s))
    monkeypatch.setattr(steering, "_ended", lambda: clock[-1] > 505.0)
    mirror: Any = SimpleNamespace(t=100.0, over="")
    mirror.read = lambda: setattr(mirror, "t", 100.0 + 0.5 * (clock[-1] - 500.0))
    picture: Any = SimpleNamespace(draw=lambda running, rate: rates.append(rate))
    steering._show(mirror, picture, SimpleNamespace(messages=list))  # type: ignore[arg-type]
    assert set(np.round(rates, 3)) == {0.0, 0.5}  # none before the first second
    assert rates[-1] == pytest.approx(0.5)
