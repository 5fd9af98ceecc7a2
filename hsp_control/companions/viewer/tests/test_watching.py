"""Watching a user's loop: data read from it, and the page's content."""

import subprocess
from asyncio import CancelledError
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError, ViewerError
from hsp_control.companions.viewer import watching
from hsp_control.companions.viewer.commands import unpack
from hsp_control.companions.viewer.live_picture import Picture
from hsp_control.companions.viewer.transport import SceneRecorder
from hsp_control.companions.viewer.viewer import Viewer
from hsp_control.companions.viewer.watched_page import Watched
from hsp_control.companions.viewer.watching import Follower
from hsp_control.simulation.journal import JournalReader

PERIOD = 0.01


def controller_of(field: Any = None) -> hsp.Controller:
    panda = hsp.Robot.load("panda")
    ball = hsp.Obstacle("ball", hsp.shapes.Sphere(0.1), hsp.Hold([0.6, 0.1, 0.6]))
    limits = hsp.Limits(barriers=[hsp.limits.ObstacleDistance(minimum=0.02)])
    circle = hsp.Circle(radius=0.1, angular_rate=2.0)  # around the hand's start
    hand = hsp.FramePose("panda_tcp", circle, name="hand", blend=1.0)
    return hsp.Controller(
        panda, [hand], field or hsp.JointCentering(), scene=[ball], limits=limits
    )


class Loop:
    """A loop whose clock has any offset, like a robot's."""

    def __init__(self, controller: hsp.Controller) -> None:
        self.controller, self.k = controller, 0
        self.q, self.v = controller.robot.home(), np.zeros(controller.robot.nv)

    def step(self, steps: int = 1) -> hsp.ControlOutput:
        robot = self.controller.robot
        for _ in range(steps):
            t = 2.0**20 + self.k * PERIOD
            output = self.controller.compute(t, self.q, self.v)
            self.controller.applied(output.tau, PERIOD)
            self.v = self.v + PERIOD * output.acceleration
            self.q = robot.integrate(self.q, PERIOD * self.v)
            self.k += 1
        return output


def followed(follower: Follower) -> dict[str, Array]:
    taken = follower.newest()
    assert taken is not None
    follower.write(*taken)
    reader = JournalReader(follower.journal)
    reader.read()
    return reader.rows(reader.count - 1)


def test_a_row_equals_the_loop_s_results() -> None:
    """The copy begins at the loop's start, though it is made later."""
    loop = Loop(controller_of())
    follower = Follower(loop.controller)
    assert follower.newest() is None  # nothing was computed yet
    loop.step(20)
    output = loop.step()
    row = followed(follower)
    assert row["t"][0] == pytest.approx(20 * PERIOD, abs=1e-9)
    # The loop's effort is rate-limited; the copy has no previous effort.
    assert row["acceleration"][0] == pytest.approx(output.acceleration, abs=1e-6)
    assert row["task.hand.error"][0] == pytest.approx(output.error("hand"), abs=1e-9)
    assert row["null_space_error"][0] == pytest.approx(
        output.null_space_error, abs=1e-9
    )
    near = output.distances["obstacle_distance"]
    assert row["distance.obstacle_distance"][0] == pytest.approx(near, abs=1e-12)
    follower.end()


def test_changes_targets_and_a_new_beginning_are_followed() -> None:
    loop = Loop(controller_of())
    follower = Follower(loop.controller)
    loop.step(5)
    followed(follower)
    loop.controller.at(0.0).ramp(0.05).gains("hand", hsp.Gains(natural_frequency=20.0))
    output = loop.step(20)
    row = followed(follower)
    assert row["acceleration"][0] == pytest.approx(output.acceleration, abs=1e-6)
    goal = loop.controller.robot.state(0.0, loop.q, loop.v).position("panda_tcp")
    for away in (0.0, 0.05):  # to a new stream, and to an existing one
        target = [goal[0] - away, *goal[1:], 1.0, 0.0, 0.0, 0.0]
        loop.controller.set_target("hand", target)
        for _ in range(60):  # the copy receives the same message, at its own steps
            output = loop.step()
            row = followed(follower)
        error = output.error("hand")
        assert row["task.hand.error"][0] == pytest.approx(error, abs=1e-6)
    journal = follower.journal
    loop.controller.restart()
    loop.step(3)
    assert followed(follower)["t"][0] == pytest.approx(2 * PERIOD, abs=1e-9)
    assert follower.journal != journal
    follower.end()
    assert not journal.parent.exists()


def recorded(tmp_path: Path, controller: hsp.Controller) -> JournalReader:
    recorder = hsp.Recorder(controller, tmp_path / "mine.npz", log_period=PERIOD)
    loop = Loop(controller)
    for _ in range(5):
        recorder.record(loop.step())
    reader = JournalReader(recorder.journal)
    reader.read()
    recorder.close()
    return reader


def drawn(watched: Watched) -> tuple[dict[str, Any], set[str]]:
    """The page's setup, and its drawn nodes."""
    recorder = SceneRecorder()
    picture = Picture(watched, Viewer(watched.robot, transport=recorder))
    picture.draw(running=True, rate=1.0)
    kept = [unpack(packed) for packed in recorder.scene.pop_all()]
    setup = next(each for each in kept if each["type"] == "play_setup")
    return setup, {each["path"] for each in kept}


def test_rows_that_are_shown_no_more_take_no_disk(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(watching, "_ROWS", 3)
    loop = Loop(controller_of())
    loop.step()
    follower = Follower(loop.controller)
    files = set[Path]()
    for _ in range(8):
        loop.step()
        followed(follower)
        files.add(follower.journal)
        assert list(follower.journal.parent.iterdir()) == [follower.journal]
    assert len(files) == 3
    follower.end()


def test_a_recorder_is_shown_with_its_distances_and_plots(tmp_path: Path) -> None:
    watched = Watched(recorded(tmp_path, controller_of()))
    assert watched.controller is not None
    setup, paths = drawn(watched)
    assert setup["loop"] == "watched"
    assert not setup["targets"]
    assert not setup["controls"]
    titles = [plot["title"] for plot in setup["plots"]]
    assert titles[:3] == ["Null-space error ‖e_N‖", "Clearance", "Efforts τ"]
    assert any(path.startswith("/targets") for path in paths)
    assert any(path.startswith("/obstacles/ball") for path in paths)
    assert any(path.startswith("/distances") for path in paths)


def test_a_loop_with_a_function_of_its_own_is_shown_by_its_columns(
    tmp_path: Path,
) -> None:
    """Another process cannot rebuild it: the log has all but lines and zones."""
    own = hsp.FunctionCost(lambda state: float(state.q @ state.q))
    watched = Watched(recorded(tmp_path, controller_of(own)))
    assert watched.controller is None
    assert "user-defined" in watched.handles.message
    setup, paths = drawn(watched)
    assert "Clearance" in [plot["title"] for plot in setup["plots"]]
    assert any(path.startswith("/targets") for path in paths)
    assert not any(path.startswith("/distances") for path in paths)


def test_failures_are_reported_and_do_not_reach_the_loop() -> None:
    fails: BaseException | None = None

    def cost(state: hsp.RobotState) -> float:
        if fails is not None:
            raise fails
        return float(state.q @ state.q)

    loop = Loop(controller_of(hsp.FunctionCost(cost)))
    with hsp.viewer.watch(loop.controller) as page:
        loop.step(3)
        follower = page._follower
        assert follower is not None
        fails = FieldError("no sensor")
        with pytest.raises(FieldError):
            loop.step()
        _until(lambda: page.failure)
        assert "no sensor" in page.failure
        fails = None
        loop.step(3)
        _until(lambda: not page.failure)
        # a BaseException: the thread ends, and reports the reason
        fails = CancelledError()
        with pytest.raises(CancelledError):
            loop.step()
        _until(lambda: page.failure == "CancelledError")
    assert not follower.journal.exists()


def test_watch_accepts_loops_only() -> None:
    with pytest.raises(ViewerError, match="a Controller or a Recorder; got Robot"):
        hsp.viewer.watch(hsp.Robot.load("panda"))
    with pytest.raises(ViewerError, match="backgroun"):
        hsp.viewer.watch(controller_of(), backgroun="#fff")


def _until(true: Any) -> None:
    from time import monotonic, sleep

    deadline = monotonic() + 60.0  # ends a test that hangs
    while not true():
        assert monotonic() < deadline
        sleep(0.01)


def test_the_page_ends_with_the_loop(tmp_path: Path) -> None:
    recorder = hsp.Recorder(controller_of(), tmp_path / "mine.npz")
    page = hsp.viewer.watch(recorder)
    assert page.url.startswith("http://127.0.0.1:")
    process = page._end.peek()[2][0]
    assert isinstance(process, subprocess.Popen)
    page.close()
    assert process.returncode == 0


def test_a_state_is_not_read_while_a_step_is_in_progress() -> None:
    panda = hsp.Robot.load("panda")
    controller = hsp.Controller(panda, [hsp.FramePose("panda_tcp")])
    controller.compute(0.0, panda.home(), np.zeros(7))
    follower = Follower(controller)
    reading = Thread(target=follower.newest, daemon=True)
    with controller._lock:
        reading.start()
        reading.join(0.1)
        assert reading.is_alive()
    reading.join(20.0)
    assert not reading.is_alive()
    follower.end()
