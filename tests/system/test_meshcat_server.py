"""The scene in an ordinary Meshcat server, which somebody else has opened."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import browsers
import numpy as np
import pytest
import umsgpack
import zmq
from browsers import until

import hsp_control as hsp
from hsp_control.common.exceptions import ViewerError
from hsp_control.visualization.viewer import Viewer, live, meshcat_transport

pytestmark = pytest.mark.process


class Recorded(threading.Thread):
    """What a Meshcat server hears, without one."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.socket = zmq.Context.instance().socket(zmq.REP)
        port = self.socket.bind_to_random_port("tcp://127.0.0.1")
        self.address = f"tcp://127.0.0.1:{port}"
        self.heard: list[dict[str, Any]] = []
        self.start()

    def run(self) -> None:
        while True:
            parts = self.socket.recv_multipart()
            if parts == [b"end"]:
                self.socket.send(b"ok")
                return self.socket.close()
            if parts == [b"url"]:
                self.socket.send(b"http://127.0.0.1:1/static/")
                continue
            kind, path, packed = parts
            command = umsgpack.unpackb(packed)
            assert (command["type"], command["path"]) == (kind.decode(), path.decode())
            self.heard.append(command)
            self.socket.send(b"ok")

    def end(self) -> None:
        with zmq.Context.instance().socket(zmq.REQ) as socket:
            socket.connect(self.address)
            socket.send(b"end")
            socket.recv()
        self.join(10.0)

    def of(self, kind: str, path: str) -> list[dict[str, Any]]:
        return [c for c in self.heard if (c["type"], c["path"]) == (kind, path)]


@pytest.fixture
def server() -> Iterator[Recorded]:
    recorded = Recorded()
    yield recorded
    recorded.end()


@pytest.fixture(scope="module")
def experiment() -> hsp.Experiment:
    return hsp.load_experiment("paper/4_moving_obstacle", "simulation.duration=1")


@pytest.fixture(scope="module")
def log(experiment: hsp.Experiment) -> hsp.Rollout:
    return experiment.run()


def test_a_state_and_a_run_are_there_and_what_is_others_is_not_touched(
    server: Recorded, experiment: hsp.Experiment, log: hsp.Rollout
) -> None:
    robot = experiment.robot
    with Viewer(robot, meshcat=server.address) as viewer:
        assert viewer.url == "http://127.0.0.1:1/static/"
        viewer.show(robot.state(0.0, log.q[50], log.v[50]))
        (*_, moved) = server.of("set_transform", "/hsp_control/robot/joint2")
        matrix = np.reshape(np.frombuffer(moved["matrix"].data), (4, 4)).T
        state = robot.state(0.0, log.q[50], log.v[50])
        np.testing.assert_array_equal(matrix, state.data.oMi[2].homogeneous)
        viewer.play(log, controller=experiment.controller)
        assert not viewer.wait_for_browser(0.0)
        viewer.wait_until_closed()
    assert {c["type"] for c in server.heard} == {
        "set_object", "set_transform", "set_property", "delete", "set_animation",
    }  # fmt: skip
    paths = [command["path"] for command in server.heard]
    assert all(path.startswith("/hsp_control/") for path in paths if path)
    assert not any("/floor" in path or "/lights" in path for path in paths)
    assert server.of("set_object", "/hsp_control/paths/tip/desired")
    (animation,) = server.of("set_animation", "")
    tracks = {
        (each["path"], track["name"]): track["keys"]
        for each in animation["animations"]
        for track in each["clip"]["tracks"]
    }
    keys = tracks["/hsp_control/obstacles/disk", ".position"]
    np.testing.assert_allclose(keys[-1]["value"], log["obstacle.disk"][-1], atol=1e-6)
    assert keys[-1]["time"] == pytest.approx(1.0)
    with pytest.raises(ViewerError, match="the viewer is closed"):
        viewer.show(robot.home())


def test_a_live_run_shows_its_last_instant(
    server: Recorded, experiment: hsp.Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    for period in ("MIN_PERIOD", "MAX_PERIOD"):  # every row is sent
        monkeypatch.setattr(live, period, 0.0)
    with Viewer(experiment.robot, meshcat=server.address) as viewer:
        view = live.LiveView(viewer, experiment)
        log = experiment.run(on_row=view.on_row)
        shown = server.of("set_property", "/hsp_control/obstacles/disk")
        where = [each["value"] for each in shown if each["property"] == "position"]
        assert len(where) > 1
        path = log["obstacle.disk"]
        for place in where:  # each is where the disk once was, later and later
            away = np.linalg.norm(path - place, axis=1)
            assert away.min() < 1e-6
        view.finish(log)
    assert server.of("set_animation", "")


def test_beside_a_visualizer_it_is_below_its_path(server: Recorded) -> None:
    class Window:
        zmq_url = server.address

    class Path:
        def lower(self) -> str:
            return "/meshcat/mine"

    class Visualizer:
        window, path = Window(), Path()

    robot = hsp.Robot.load("planar3r")
    with Viewer(robot, meshcat=Visualizer()):
        assert server.of("set_object", "/meshcat/mine/robot/joint2/link2")


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_what_is_no_server_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshcat_transport, "TIMEOUT", 0.2)
    robot = hsp.Robot.load("planar3r")
    for wrong, message in (
        ("tcp://127.0.0.1:9", r"no Meshcat server answers at tcp://127\.0\.0\.1:9"),
        ("nonsense", "'nonsense' is no address"),
        (7000, "meshcat is a meshcat.Visualizer or the address .*; got int"),
    ):
        with pytest.raises(ViewerError, match=message):
            Viewer(robot, meshcat=wrong)


@pytest.mark.browser
def test_an_ordinary_page_plays_it(
    experiment: hsp.Experiment, log: hsp.Rollout
) -> None:
    """Meshcat's own server and page, as `meshcat-server` starts them."""
    port = zmq_port()
    address = f"tcp://127.0.0.1:{port}"
    command = [sys.executable, "-u", "-m", "meshcat.servers.zmqserver"]
    process = subprocess.Popen(
        [*command, "--zmq-url", address], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        while "web_url" not in process.stdout.readline():
            assert process.poll() is None
        with Viewer(experiment.robot, meshcat=address) as viewer:
            viewer.play(log, controller=experiment.controller)
            started = browsers.started()
            page, _ = browsers.opened(next(started), str(viewer.url))
            until(page, "typeof viewer !== 'undefined' && viewer.animator.duration > 0")
            page.evaluate("viewer.animator.pause(); viewer.animator.seek(0.5)")
            found = page.evaluate(
                """() => viewer.scene_tree.find(["hsp_control", "robot", "joint3"])
                     .object.position.toArray()"""
            )
            state = experiment.robot.state(0.5, log.q[50], log.v[50])
            expected = state.data.oMi[3].translation
            np.testing.assert_allclose(found, expected, atol=2e-3)
            page.close()
            started.close()
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def zmq_port() -> int:
    with zmq.Context.instance().socket(zmq.REP) as socket:
        return int(socket.bind_to_random_port("tcp://127.0.0.1"))
