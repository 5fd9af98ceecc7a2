"""The viewer: shows a robot, its surroundings and its runs in a browser."""

import logging
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ExportError, LogError, ViewerError
from hsp_control.common.numbers import check_positive
from hsp_control.companions.viewer import transport
from hsp_control.companions.viewer.clip import bands_of, remove_clip, set_clip
from hsp_control.companions.viewer.commands import (
    CLIP,
    PageCommand,
    delete,
    page_command,
    remove_plots,
    set_caption,
    set_status,
    set_time,
)
from hsp_control.companions.viewer.comparison import ComparedRun, Comparison
from hsp_control.companions.viewer.motion import motion_of
from hsp_control.companions.viewer.obstacles import SceneDrawing
from hsp_control.companions.viewer.offline_page import InlineView
from hsp_control.companions.viewer.page_plots import plots_of
from hsp_control.companions.viewer.robot_drawing import RobotDrawing
from hsp_control.companions.viewer.run_drawing import RunDrawing, all_layers, clear
from hsp_control.companions.viewer.stage import (
    draw_stage,
    in_sight,
    is_dark,
    look_at,
    right_direction,
    scene_size,
    stage_legend,
)
from hsp_control.companions.viewer.transport import PageServer, SceneRecorder
from hsp_control.config.scenario import ViewSettings
from hsp_control.control.interface import Controller
from hsp_control.declaration.language import check_kind
from hsp_control.geometry.scene import Scene
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.recorded import warn_of_another_robot
from hsp_control.simulation import Rollout

StageContent = RunDrawing | Comparison | SceneDrawing

_log = logging.getLogger(__name__)


class Viewer:
    """Shows a robot in a browser; pages may be opened, closed and reopened at any time.

    In a notebook, a viewer in the last line of a cell puts its scene into the
    notebook, where it stays; `url` is the live page. See also `show`.

    Attributes:
        robot: The robot.
        view: The settings, as under ``view`` in a configuration.
        drawing: The robot in the scene.
        transport: The server, or a `SceneRecorder`.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        open_browser: bool = False,
        transport: SceneRecorder | None = None,
        port: int | None = None,
        **view: Any,
    ) -> None:
        """Show the robot at its home posture.

        Args:
            robot: The robot.
            open_browser: Open the page in the user's browser.
            transport: A `SceneRecorder`, to store the commands and show nothing; None:
                a new server on the loopback address.
            port: The server's port; None: the first free one from 7000.
            view: Fields of `ViewSettings`, the keys of a configuration's ``view``:
                ``camera`` and ``target`` [m], ``background``,
                ``show={"ellipsoid": True}``, ...

        Raises:
            ViewerError: If a view has no such field, a value is not valid, Meshcat is
                not installed, or the server cannot start.
        """
        self.robot = check_kind("robot is", robot, Robot, ViewerError)
        self.view = ViewSettings(**view)
        self.drawing = RobotDrawing(robot)
        self._data = robot.model.createData()
        self._obstacles: SceneDrawing | None = None
        self._others: list[str] = []
        self._plotted = False
        self.transport = PageServer(port) if transport is None else transport
        try:
            # Its meshes last: they then appear at their poses, in their light.
            still = self._with_obstacles(Scene(), None)
            self.transport.send([*still, *self.drawing.draw()])
        except BaseException:
            self.close()
            raise
        if open_browser:
            self.open_browser()

    @property
    def url(self) -> str | None:
        """The page's address; None where there is no page."""
        return self.transport.url

    @property
    def dark(self) -> bool:
        """Whether the background is dark."""
        return is_dark(self.view.background)

    def draw_scene(
        self,
        scene: Rollout | Scene,
        *,
        controller: Controller | None = None,
        title: str | None = None,
    ) -> None:
        """Show a run, paused at its start, or a scene's obstacles.

        Replaces the previous run or scene, fits the stage, and places the camera.

        Args:
            scene: The run or the scene.
            controller: The run's controller: see `play`.
            title: The title above a scene; None: the robot's name.

        Raises:
            ViewerError: If the run is empty or not of this robot, or if the server has
                ended.
        """
        if isinstance(scene, Rollout):
            self._draw_run(scene, controller, **self._playing(None, None))
        else:
            self.transport.send(self._with_obstacles(scene, title))

    def show(self, state: RobotState | Any) -> None:
        """Show the robot in a state, or at a configuration of shape (nq,).

        With a state, obstacles move to their poses at the state's time.

        Raises:
            ViewerError: If the server has ended.
            ShapeError: If the configuration's shape is not (nq,).
            NonFiniteError: If it holds a NaN or an infinity.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        others: list[PageCommand] = []
        if isinstance(state, RobotState):
            placements = state.data.oMi
            others = self._move_others(state.t)
        else:
            placements = self._placements(self.robot.check_configuration(state))
        self.transport.send([*others, *self.drawing.move(placements)])

    def play(
        self,
        rollout: Rollout,
        *,
        speed: float | None = None,
        loop: bool | None = None,
        controller: Controller | None = None,
    ) -> None:
        """Send a run to the page, which plays it; return at once.

        The page then controls pause, speed and time by itself.

        Args:
            rollout: The run.
            speed: Seconds of the run per second of real time; None: the view's setting.
            loop: Repeat the run; None: the view's setting.
            controller: The run's controller; it is needed for layers that are not in
                the log's columns, such as minimum distances and self-motion.

        Raises:
            ViewerError: If the run is empty or not of this robot, the speed is not
                positive, or the server has ended.
        """
        playing = self._playing(speed, loop)
        self._draw_run(rollout, controller, play=True, **playing)

    def compare(
        self,
        runs: Sequence[ComparedRun],
        *,
        beside: bool | None = None,
        ghosts: bool = True,
        speed: float | None = None,
        loop: bool | None = None,
    ) -> None:
        """Send several runs to the page, which plays them together; return at once.

        Args:
            runs: The runs; the first is of this viewer's robot, the others may be of
                other robots.
            beside: True: side by side; False: overlaid, all but the first as ghosts.
                None: overlaid if all robots have the same name.
            ghosts: False: overlaid, each with all its layers, as an exported page with
                a switch needs them.
            speed: Seconds of the runs per second of real time; None: the view's
                setting.
            loop: Repeat the runs; None: the view's setting.

        Raises:
            ViewerError: If a run is empty or not of its robot, the speed is not
                positive, or the server has ended.
        """
        for run in runs:
            _check(run.robot, run.rollout, run.controller)
        playing = self._playing(speed, loop)
        if beside is None:
            beside = len({run.robot.name for run in runs}) > 1
        view = self.view
        right = (
            right_direction(self.robot, view.camera, view.target) if beside else None
        )
        comparison = Comparison(
            self.drawing,
            runs,
            shown=view.show.all_fields(),
            beside=right,
            dark=self.dark,
            ghosts=ghosts,
        )
        stage = self._stage(comparison, comparison.title(), fit=beside)
        clip = set_clip(comparison.clip(), play=True, **playing)
        self._obstacles = None
        self._others = comparison.roots[1:]
        self.transport.send([*stage, *clip])
        self._plot(runs)

    def open_browser(self) -> bool:
        """Open the page in the user's browser; return whether there is one."""
        return self.url is not None and transport.open_browser(self.url)

    def wait_until_closed(self) -> None:
        """Wait until no page is open any more."""
        self.transport.wait_until_closed()

    def wait_for_browser(self, timeout: float) -> bool:
        """Wait until a page shows everything; return whether one does.

        Args:
            timeout: The longest time to wait [s].

        Raises:
            ViewerError: If the server has ended.
        """
        return self.transport.wait_for_page(timeout)

    def close(self) -> None:
        """End the server; open pages keep their scene. A second call has no effect."""
        self.transport.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook; with unreadable meshes, the live page."""
        try:
            return InlineView(self.transport.scene, url=self.url)._repr_html_()
        except ExportError as error:
            reason = f"<p>Only while the program runs: {escape(str(error))}</p>"
        if self.url is None:
            return reason
        return (
            f'<iframe src="{escape(self.url)}" style="width: 100%; height: 520px; '
            f'border: 0; border-radius: 8px" allowfullscreen></iframe>{reason}'
        )

    def set_stage(self, run: RunDrawing, title: str | None) -> float:
        """Clear the stage and fit it to a run; return the scene's size [m]."""
        self._obstacles = None
        self.transport.send(self._stage(run, title))
        return self._size

    def replace_run(
        self, rollout: Rollout, controller: Controller, status: str
    ) -> None:
        """Replace a partly drawn run by the complete one; the page keeps its time."""
        run = self._run(rollout, controller)
        playing = self._playing(None, None)
        clip = set_clip(run.clip(), play=True, keep=True, **playing)
        # Layers that were not computed meanwhile now have their switches, too.
        caption = self._caption(run, rollout.meta.get("title"))
        self.transport.send(
            [*clear(), *run.draw(self._size), *clip, caption, set_status(status)]
        )
        self._plot([ComparedRun("", self.robot, rollout, controller)])

    def show_plots(self, plots: PageCommand) -> None:
        """Show plots beside the scene, until another scene is drawn."""
        self._plotted = True
        self.transport.send([plots])

    @property
    def has_plots(self) -> bool:
        """Whether its pages show plots, as those of its server do."""
        return isinstance(self.transport, PageServer)

    def _plot(self, runs: Sequence[ComparedRun]) -> None:
        """Show the plots of runs beside the scene, which is already there."""
        if not self.has_plots:
            return
        try:
            self.show_plots(plots_of(runs))
        except LogError as error:  # the scene needs fewer columns than the plots
            _log.warning("no plots beside the scene: %s", error)

    def _run(self, rollout: Rollout, controller: Controller | None) -> RunDrawing:
        _check(self.robot, rollout, controller)
        motion = motion_of(self.robot, rollout)
        layers = all_layers(self.robot, motion, controller, dark=self.dark)
        shown = self.view.show.all_fields()
        bands = bands_of(rollout, controller)
        return RunDrawing(self.drawing, motion, layers, shown=shown, bands=bands)

    def _draw_run(
        self, rollout: Rollout, controller: Controller | None, **playing: Any
    ) -> None:
        run = self._run(rollout, controller)
        warn_of_another_robot(self.robot, rollout.meta)
        stage = self._stage(run, rollout.meta.get("title"))
        self._obstacles = None
        self.transport.send([*stage, *set_clip(run.clip(), **playing)])
        self._plot([ComparedRun("", self.robot, rollout, controller)])

    def _with_obstacles(self, scene: Scene, title: str | None) -> list[PageCommand]:
        """Return the commands that show the robot at home with a scene's obstacles."""
        placements = self._placements(self.robot.home())
        obstacles = SceneDrawing(scene, self.drawing.points(placements))
        stage = self._stage(obstacles, title)
        self._obstacles = obstacles
        still = [*obstacles.move(0.0), *self.drawing.move(placements)]
        return [*stage, *remove_clip(), *still]

    def _stage(
        self, scene: StageContent, title: str | None, fit: bool = False
    ) -> list[PageCommand]:
        """Return the commands that clear the stage, fit it, and draw a scene."""
        view = self.view
        subject = self._subject(scene.points())
        points = in_sight(subject, scene.obstacle_points())
        floor = min(0.0, float(subject[:, 2].min()))
        self._size = scene_size(points)
        commands = [
            *([remove_plots()] if self._plotted else []),
            *clear(),
            *(delete(root) for root in self._others),
            *draw_stage(points, floor, view),
            *scene.draw(self._size),
            look_at(self.robot, points, view.camera, view.target, fit=fit),
            self._caption(scene, title),
            set_time(""),
            set_status(""),
        ]
        self._others = []
        self._plotted = False
        return commands

    def _caption(self, scene: StageContent, title: str | None) -> PageCommand:
        """Return the command that sets the title and the legend; None: its name."""
        legend = [*scene.legend(), *stage_legend(self.view)]
        return set_caption(title or self.robot.name, legend, dark=self.dark)

    def _subject(self, moving: Array) -> Array:
        """Return the points that must be visible [m], shape (K, 3)."""
        return np.vstack([moving, self.drawing.fixed_points()])

    def _playing(self, speed: float | None, loop: bool | None) -> Mapping[str, Any]:
        speed = self.view.speed if speed is None else speed
        speed = check_positive("speed", speed, "", ViewerError)
        return {"speed": speed, "loop": self.view.loop if loop is None else loop}

    def _move_others(self, time: float) -> list[PageCommand]:
        """Return the commands that move everything but the robot to a time [s]."""
        if self._obstacles is None:
            return [page_command("seek", CLIP, "seek", time=float(time))]
        return [*self._obstacles.move(time), set_time(f"t = {time:.2f} s")]

    def _placements(self, q: Array) -> Any:
        """Return the placements of all joints in the world."""
        pin.forwardKinematics(self.robot.model, self._data, q)
        return self._data.oMi


def _check(robot: Robot, rollout: Rollout, controller: Controller | None) -> None:
    if not len(rollout):
        raise ViewerError("the run is empty: it has no rows")
    if rollout.q.shape[1] != robot.nq:
        name = rollout.meta.get("robot", {}).get("name", "?")
        raise ViewerError(
            f"the run is of {name} with nq = {rollout.q.shape[1]}; "
            f"this viewer's robot is {robot.name} with nq = {robot.nq}"
        )
    if controller is not None and controller.robot.nq != robot.nq:
        raise ViewerError(
            f"the controller is for {controller.robot.name} with nq = "
            f"{controller.robot.nq}; the run's robot {robot.name} has nq = {robot.nq}"
        )
