"""Check how logs are played in the view, and which cannot be."""

import re
from pathlib import Path

import numpy as np
import pytest
from clips import Clip, Recorder, told

from hsp_control import Robot, Rollout, load_experiment
from hsp_control.common.exceptions import ViewerError
from hsp_control.visualization.viewer import Viewer, robot_of, view_logs
from hsp_control.visualization.viewer.commands import CAMERA, CLIP
from hsp_control.visualization.viewer.motion import motion_of

pytestmark = pytest.mark.process

MOVING = "paper/4_moving_obstacle"


@pytest.fixture(scope="module")
def run() -> Rollout:
    return load_experiment(MOVING, "simulation.duration=1.5").run()


@pytest.fixture(scope="module")
def arm() -> Robot:
    return Robot.load("planar3r")


@pytest.fixture
def recorder() -> Recorder:
    return Recorder()


def test_coarse_logs_play_smoothly_and_fine_ones_are_thinned(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    coarse = Rollout({k: v[::10] for k, v in run.columns.items()}, run.meta)
    viewer.draw_scene(coarse)
    clip = Clip(recorder)
    times = clip.times("/robot/joint3", "position")
    assert (times[0], times[-1]) == (coarse.t[0], coarse.t[-1])
    assert np.diff(times).max() < 0.034
    assert np.isin(coarse.t, times).all()
    # Between two rows the links keep their lengths: joints turn, nothing is cut short.
    for t in times:
        places = [clip.value(f"/robot/joint{k}", "position", t) for k in (1, 2, 3)]
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-6)

    fine = motion_of(arm, resampled(run, 4000))
    assert len(fine.times) < 160
    assert (fine.times[0], fine.times[-1]) == (run.t[0], run.t[-1])


def resampled(run: Rollout, rows: int) -> Rollout:
    t = np.linspace(run.t[0], run.t[-1], rows)
    near = np.searchsorted(run.t, t).clip(0, len(run) - 1)
    return Rollout({k: v[near] for k, v in run.columns.items()} | {"t": t}, run.meta)


def test_what_cannot_be_played_is_refused(arm: Robot, run: Rollout) -> None:
    viewer = Viewer(arm, transport=Recorder())
    with pytest.raises(ViewerError, match="speed -1 must be positive"):
        viewer.play(run, speed=-1)
    with pytest.raises(ViewerError, match=r"ings: camra: .*did you mean 'camera'"):
        Viewer(arm, transport=Recorder(), camra=[1, 2, 3])
    with pytest.raises(ViewerError, match=r"controller is for iiwa14 with nq = 7"):
        viewer.play(run, controller=load_experiment("iiwa_singular").controller)
    empty = Rollout({k: v[:0] for k, v in run.columns.items()}, run.meta)
    with pytest.raises(ViewerError, match="the run is empty"):
        viewer.play(empty)
    other = Viewer(Robot.load("iiwa14"), transport=Recorder())
    with pytest.raises(ViewerError, match=r"of planar3r with nq = 6.*iiwa14 with nq"):
        other.draw_scene(run)


def test_a_log_is_viewed_as_its_configuration_says(
    tmp_path: Path, run: Rollout, recorder: Recorder
) -> None:
    look = {"camera": [0, 0, 9], "speed": 20.0, "show": {"paths": False}}
    config = {**(run.config or {}), "view": look}
    log = Rollout(run.columns, {**run.meta, "config": config})
    path = log.save(tmp_path / "run.npz")
    robot = robot_of(Rollout.load(path))
    assert (robot.name, robot.nq) == ("planar3r", 6)
    assert not robot.model.gravity.linear.any()  # as configured
    viewer = view_logs([path], transport=recorder)
    camera = told(recorder, CAMERA, "camera")
    assert camera["eye"] == [0.0, 0.0, 9.0]
    begin = told(recorder, CLIP, "begin")
    assert begin["speed"] == 20.0
    hidden = told(recorder, "/paths/tip/actual", "visible")
    assert hidden["value"] is False
    assert recorder.command("/targets", "visible") is None
    tip = Clip(recorder).pose("/robot/joint3", run.t[-1]) @ [1.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(tip[:2], run["task.tip.actual"][-1], atol=1e-6)
    viewer.close()


def test_a_log_whose_controller_is_gone_shows_what_its_columns_tell(
    tmp_path: Path,
    run: Rollout,
    recorder: Recorder,
    caplog: pytest.LogCaptureFixture,
) -> None:
    config = {**(run.config or {})}
    field = {"type": "point_distance", "frames": ["gone"], "obstacle": "disk"}
    config["null_space"] = {"fields": [field]}
    log = Rollout(run.columns, {**run.meta, "config": config})
    view_logs([log.save(tmp_path / "run.npz")], transport=recorder)
    assert re.search(
        r"run: no controller, only the log's columns are drawn:.*'gone'", caplog.text
    )
    assert recorder.paths("/paths/")
    assert not recorder.paths("/distances")


def test_a_log_whose_robot_is_gone_says_so(run: Rollout) -> None:
    anonymous = Rollout(
        run.columns, {k: v for k, v in run.meta.items() if k != "config"}
    )
    with pytest.raises(ViewerError, match=r"made from Python.*'planar3r'.*Viewer\("):
        robot_of(anonymous)
    config = {**(run.config or {}), "robot": {"name": "planar4r"}}
    lost = Rollout(run.columns, {**run.meta, "config": config})
    with pytest.raises(ViewerError, match=r"cannot be rebuilt.*planar4r"):
        robot_of(lost)
