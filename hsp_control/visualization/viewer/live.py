"""A run in the browser while it is computed."""

import logging
import time
from collections import deque
from typing import Any

import numpy as np

from hsp_control.common.exceptions import HspControlError, ViewerError
from hsp_control.config.experiment import Experiment
from hsp_control.robot import RobotState
from hsp_control.simulation import Rollout
from hsp_control.simulation.recorder import Recorder
from hsp_control.visualization.viewer.clip import Clip, extend_clip, set_clip
from hsp_control.visualization.viewer.commands import set_status
from hsp_control.visualization.viewer.motion import COARSEST, Motion, motion_of
from hsp_control.visualization.viewer.paths import GrowingPaths
from hsp_control.visualization.viewer.run_drawing import RunDrawing, all_layers
from hsp_control.visualization.viewer.viewer import Viewer

PERIOD = 0.1
"""Least time between two messages to the page [s]."""
LONGEST = 1.0
"""Most time between two messages [s]."""
LATELY = 2.0
"""Over which time the pace is measured [s]."""
SHARE = 0.03
"""Of the computing time, what drawing may take."""
_PREVIEWED = 60

_log = logging.getLogger(__name__)


class LiveView:
    """Sends the page what is computed, as it comes; the page plays it at its own pace.

    Nothing waits for a page. What drawing costs is measured, and rows are left out so
    that it stays a small share of the computing; the whole run comes at the end.
    """

    def __init__(self, viewer: Viewer, experiment: Experiment) -> None:
        """Show the stage: the robot at its start, obstacles, and the paths to come."""
        self._viewer = viewer
        self._experiment = experiment
        viewer.show(experiment.q0)
        viewer.transport.send(
            [set_status("preparing; the first time, for some seconds")]
        )
        preview = _preview(experiment)
        self._meta = preview.meta
        robot, controller = experiment.robot, experiment.controller
        motion = motion_of(robot, preview)
        shown = viewer.view.show.model_dump()
        layers = all_layers(robot, motion, controller, dark=viewer.dark)
        layers["paths"] = GrowingPaths(motion, "/paths")
        # What nobody sees need not be computed now.
        layers = {name: layer for name, layer in layers.items() if shown[name]}
        self._run = RunDrawing(viewer.drawing, motion, layers, shown=shown)
        self._sent = 0  # rows of the run
        self._pieces = 0
        self._cost = 0.0  # s a row that is drawn
        self._next = 0.0
        self._marks: deque[tuple[float, float]] = deque()  # (computed at, time of run)
        self._begin: float | None = None
        self._size = viewer.set_stage(self._run, experiment.scenario.title)

    def on_row(self, recorder: Recorder) -> None:
        """Send what has been computed since last time, if it is time again."""
        now = time.perf_counter()
        if self._begin is None:
            self._begin = now
        if now < self._next:
            return
        # Not the clock's time: other processes, such as the browser, take that.
        before = time.thread_time()
        try:
            self._send(Rollout(recorder.rows(self._sent), self._meta), now)
        except ViewerError as error:
            _log.warning("%s; the run goes on unseen", error)
            self._next = float("inf")
            return
        took = time.thread_time() - before
        self._next = now + min(max(PERIOD, took / SHARE), LONGEST)

    def finish(self, rollout: Rollout) -> None:
        """Have the page go on with the whole run, drawn in full.

        Raises:
            ViewerError: If the server has ended.
        """
        elapsed = time.perf_counter() - (self._begin or 0.0)
        rate = (rollout.t[-1] - rollout.t[0]) / max(elapsed, 1e-9)
        self._viewer.replace_run(
            rollout,
            self._size,
            self._experiment.controller,
            status=f"computed at {_shown(rate)} × real time",
        )

    def _send(self, rows: Rollout, now: float) -> None:
        rate = self._rate(now, float(rows.t[-1]))
        # Rows a second of computing, times their cost, are the share.
        finest = max(COARSEST, rate * self._cost / SHARE)
        before = time.thread_time()
        motion = motion_of(self._experiment.robot, rows, finest, coarsest=np.inf)
        self._viewer.transport.send(self._commands(motion, rate))
        self._cost = (time.thread_time() - before) / len(motion.times)
        self._sent += len(rows)
        self._pieces += 1

    def _rate(self, now: float, computed: float) -> float:
        """Return the seconds of the run that were computed in a second, lately."""
        marks = self._marks
        marks.append((now, computed))
        while len(marks) > 2 and marks[1][0] < now - LATELY:
            marks.popleft()
        then, before = marks[0]
        return (computed - before) / (now - then) if now > then else 0.0

    def _commands(self, motion: Motion, rate: float) -> list[Any]:
        first = not self._pieces
        clip = Clip(
            0.0,
            float(motion.times[-1]),
            list(self._run.tracks(motion)),
            self._experiment.scenario.simulation.duration,
        )
        view = self._viewer.view
        said = (
            set_clip(clip, play=True, speed=view.speed, loop=view.loop)
            if first
            else [extend_clip(clip, self._pieces)]
        )
        paths = self._run.layers.get("paths")
        grown = paths.extend(motion) if isinstance(paths, GrowingPaths) else ()
        if not rate:
            return [*grown, *said]
        return [*grown, *said, set_status(f"computing at {_shown(rate)} × real time")]


def _preview(experiment: Experiment) -> Rollout:
    """Return a log of what tasks and obstacles will do, with the robot at its start."""
    robot, controller = experiment.robot, experiment.controller
    duration = experiment.scenario.simulation.duration
    recorder = Recorder(controller, experiment.scene, _PREVIEWED)
    state = RobotState(robot)
    for t in np.linspace(0.0, duration, _PREVIEWED):
        state.update(float(t), experiment.q0, experiment.v0)
        try:
            output = controller.compute(state)
            recorder.record(state, output, output.tau, {})
        except HspControlError:  # as the run may, later
            if not len(recorder.rows(0)["t"]):
                raise
            break
    return recorder.rollout("preview", "")


def _shown(rate: float) -> str:
    return f"{rate:.1f}" if rate < 9.95 else f"{rate:.0f}"
