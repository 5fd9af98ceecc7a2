"""Shows a run in the browser while it is computed."""

import logging
import time
from typing import Any

import numpy as np

from hsp_control.common.errors import HspControlError, LogError, ViewerError
from hsp_control.companions.viewer.clip import Clip, bands_of, extend_clip, set_clip
from hsp_control.companions.viewer.commands import set_status
from hsp_control.companions.viewer.motion import COARSEST, RunMotion, motion_of
from hsp_control.companions.viewer.page_plots import plots_so_far
from hsp_control.companions.viewer.run_drawing import RunDrawing, all_layers
from hsp_control.companions.viewer.targets import growing_paths
from hsp_control.companions.viewer.viewer import Viewer
from hsp_control.config.experiment import Experiment
from hsp_control.robot import RobotState
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_writer import LogWriter

MIN_PERIOD = 0.1  # minimum time between two messages to the page [s]
MAX_PERIOD = 1.0  # maximum time between two messages [s]
DRAWING_SHARE = 0.03  # maximum share of the computing time that drawing takes
PLOTS_SHARE = 0.01  # maximum share of the computing time that the plots take
PLOTS_PERIOD = 1.0  # minimum time between two pictures of the plots [s]
_PREVIEW_ROWS = 60

_log = logging.getLogger(__name__)


class LiveView:
    """Sends the computed rows to the page, which plays them at its own speed.

    Nothing waits for a page. The cost of drawing is measured, and rows are left out so
    that it stays a small share of the computing time. The whole run follows at the end.
    """

    def __init__(self, viewer: Viewer, experiment: Experiment) -> None:
        """Show the robot at its start, the obstacles, and the desired paths."""
        self._viewer = viewer
        self._experiment = experiment
        viewer.show(experiment.q0)
        preview = _preview(experiment)
        self._meta = preview.meta
        robot, controller = experiment.robot, experiment.controller
        motion = motion_of(robot, preview)
        shown = viewer.view.show.all_fields()
        layers = all_layers(robot, motion, controller, dark=viewer.dark)
        layers["paths"], extend = growing_paths(motion, "/paths")
        self._extend = extend if shown["paths"] else lambda _: ()
        # Layers that are hidden are not computed now.
        layers = {name: layer for name, layer in layers.items() if shown[name]}
        self._run = RunDrawing(viewer.drawing, motion, layers, shown=shown)
        self._sent = 0  # rows of the run
        self._pieces = 0
        self._cost = 0.0  # s per drawn row
        self._next = self._next_plots = 0.0
        self._plotted = False
        self._begin: float | None = None
        viewer.set_stage(self._run, experiment.scenario.title)

    def on_row(self, recorder: LogWriter) -> None:
        """Send the rows computed since the last message, if the next one is due."""
        now = time.perf_counter()
        if self._begin is None:
            self._begin = now
        if now < self._next:
            return
        # Not wall time, which includes other processes, such as the browser.
        before = time.thread_time()
        try:
            self._send(recorder, now)
            took = time.thread_time() - before
            if now >= self._next_plots and self._viewer.has_plots:
                self._send_plots(recorder, now)
        except ViewerError as error:
            _log.warning("%s; the run continues without a view", error)
            self._next = float("inf")
            return
        self._next = now + min(max(MIN_PERIOD, took / DRAWING_SHARE), MAX_PERIOD)

    def finish(self, rollout: Rollout) -> None:
        """Replace the drawn rows by the whole run; the page keeps its time."""
        elapsed = time.perf_counter() - (self._begin or 0.0)
        rate = (rollout.t[-1] - rollout.t[0]) / max(elapsed, 1e-9)
        status = f"computed at {_shown(rate)} × real time"
        self._viewer.replace_run(rollout, self._experiment.controller, status)

    def _send(self, recorder: LogWriter, now: float) -> None:
        # From the last sent row: tracks and bands continue there.
        rows = Rollout(recorder.rows(max(self._sent - 1, 0)), self._meta)
        simulated = float(rows.t[-1]) - self._experiment.scenario.simulation.start_time
        rate = simulated / max(now - (self._begin or 0.0), 1e-9)
        # share of drawing = drawn rows per second of computing · time per row
        finest = max(COARSEST, rate * self._cost / DRAWING_SHARE)
        before = time.thread_time()
        motion = motion_of(self._experiment.robot, rows, finest, coarsest=np.inf)
        self._viewer.transport.send(self._commands(motion, rows, rate))
        self._cost = (time.thread_time() - before) / len(motion.times)
        self._sent = recorder.count
        self._pieces += 1

    def _send_plots(self, recorder: LogWriter, now: float) -> None:
        """Send the plots of all rows computed so far, in place of the last ones."""
        before = time.thread_time()
        end = self._experiment.scenario.simulation.end_time
        robot = self._experiment.robot
        try:
            plots = plots_so_far(recorder, self._meta, robot, end)
        except LogError as error:
            _log.warning("%s; the run continues without plots", error)
            self._next_plots = float("inf")
            return
        self._viewer.show_plots(plots)
        took = time.thread_time() - before if self._plotted else 0.0
        self._plotted = True  # the first picture took imports with it
        self._next_plots = now + max(PLOTS_PERIOD, took / PLOTS_SHARE)

    def _commands(self, motion: RunMotion, rows: Rollout, rate: float) -> list[Any]:
        first = not self._pieces
        settings = self._experiment.scenario.simulation
        clip = Clip(
            settings.start_time,
            float(motion.times[-1]),
            list(self._run.tracks(motion)),
            settings.end_time,
            bands_of(rows, self._experiment.controller, duration=settings.duration),
        )
        view = self._viewer.view
        shown = (
            set_clip(clip, play=True, speed=view.speed, loop=view.loop)
            if first
            else [extend_clip(clip, self._pieces)]
        )
        pace = [] if first else [set_status(f"computing at {_shown(rate)} × real time")]
        return [*self._extend(motion), *shown, *pace]


def _preview(experiment: Experiment) -> Rollout:
    """Return a log of the references and obstacles, with the robot at its start."""
    # A stream would continue to the end of the preview.
    robot, controller = experiment.robot, experiment.controller.preview()
    settings = experiment.scenario.simulation
    recorder = LogWriter(controller, experiment.scene, _PREVIEW_ROWS)
    state = RobotState(robot)
    for t in np.linspace(settings.start_time, settings.end_time, _PREVIEW_ROWS):
        state.update(float(t), experiment.q0, experiment.v0)
        try:
            output = controller.compute(state)
            recorder.record(state, output, output.tau, {})
        except HspControlError:  # the run may fail at the same time
            if not len(recorder.rows(0)["t"]):
                raise
            break
    return recorder.rollout("preview", "", plant=experiment.plant.describe())


def _shown(rate: float) -> str:
    return f"{rate:.1f}" if rate < 9.95 else f"{rate:.0f}"
