"""The viewer: a robot, what surrounds it and what it did, in a browser."""

from collections.abc import Mapping, Sequence
from html import escape
from types import TracebackType
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ViewerError
from hsp_control.config.document import Document
from hsp_control.config.models.view import ViewModel
from hsp_control.config.validation import validate
from hsp_control.control.controller import Controller
from hsp_control.geometry.scene import Scene
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation import Rollout
from hsp_control.visualization.viewer import browser
from hsp_control.visualization.viewer.camera import look_at, to_the_right
from hsp_control.visualization.viewer.clip import no_clip, set_clip
from hsp_control.visualization.viewer.commands import (
    Command,
    delete,
    seek,
    set_caption,
    set_status,
    set_time,
)
from hsp_control.visualization.viewer.comparison import Act, Comparison
from hsp_control.visualization.viewer.drawable import Drawable
from hsp_control.visualization.viewer.motion import motion_of
from hsp_control.visualization.viewer.obstacle_drawing import ObstacleDrawing
from hsp_control.visualization.viewer.robot_drawing import RobotDrawing
from hsp_control.visualization.viewer.run_drawing import RunDrawing, all_layers, clear
from hsp_control.visualization.viewer.server import Server
from hsp_control.visualization.viewer.stage import (
    draw_stage,
    in_sight,
    is_dark,
    scene_size,
)
from hsp_control.visualization.viewer.transport import Transport


class Viewer:
    """Shows a robot in a browser that may come, go and come back, or never come.

    In a notebook, a viewer that is a cell's last line shows its page there.

    Attributes:
        robot: The robot.
        view: How it is shown: a configuration's ``view``.
        drawing: The robot in the scene.
        transport: Where the commands go.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        open_browser: bool = False,
        transport: Transport | None = None,
        port: int | None = None,
        **view: Any,
    ) -> None:
        """Show the robot at its home posture.

        Args:
            robot: The robot.
            open_browser: Open the page in the user's browser.
            transport: A `Recorder`, to show nothing and only remember; None: a server
                of its own on the loopback address.
            port: The server's port; None: the first free one from 7000.
            view: What a configuration says under ``view``, such as ``camera`` and
                ``target`` [m], ``background``, or ``show={"ellipsoid": True}``.

        Raises:
            ViewerError: If Meshcat is not installed, or the server cannot start.
            ConfigError: If there is no such thing in a view.
        """
        self.robot = robot
        self.view = validate(Document(dict(view), {}, "view"), ViewModel)
        self.drawing = RobotDrawing(robot)
        self._data = robot.model.createData()
        self._obstacles: ObstacleDrawing | None = None
        self._others: list[str] = []
        self.transport = Server(port) if transport is None else transport
        try:
            self.transport.send(self.drawing.draw())
            self.draw_scene(Scene())
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
        self, scene: Rollout | Scene, *, controller: Controller | None = None
    ) -> None:
        """Show a run, at rest at its start, or a scene's obstacles.

        Replaces what was shown before, fits the stage, and places the camera.

        Args:
            scene: The run or the scene.
            controller: Of a run: see `play`.

        Raises:
            ViewerError: If the run is not this robot's or is empty, or if the server
                has ended.
        """
        if isinstance(scene, Rollout):
            self._draw_run(scene, controller)
        else:
            self._draw_obstacles(scene)

    def show(self, state: RobotState | Any) -> None:
        """Show the robot in a state, or at a configuration of shape (nq,).

        At a state, what surrounds the robot goes to where it is at the state's time.

        Raises:
            ViewerError: If the server has ended.
            ShapeError: If the configuration's shape is not (nq,).
            NonFiniteError: If it holds a NaN or an infinity.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        around: list[Command] = []
        if isinstance(state, RobotState):
            placements = state.data.oMi
            around = self._around(state.t)
        else:
            placements = self._placements(self.robot.check_configuration(state))
        self.transport.send([*around, *self.drawing.move(placements)])

    def play(
        self,
        rollout: Rollout,
        *,
        speed: float | None = None,
        loop: bool | None = None,
        controller: Controller | None = None,
    ) -> None:
        """Have the page play a run, and return at once, whether anyone looks or not.

        The page has the run then: pausing, speed and going to a time are its own.

        Args:
            rollout: The run.
            speed: Seconds of the run shown in one second; None: as the view says.
            loop: Play it again and again; None: as the view says.
            controller: What controlled the run; shows what the log's columns alone do
                not tell, such as shortest distances and self-motion.

        Raises:
            ViewerError: If the run is not this robot's or is empty, the speed is not
                positive, or the server has ended.
        """
        playing = self._playing(speed, loop)
        self._draw_run(rollout, controller, play=True, **playing)

    def compare(
        self,
        acts: Sequence[Act],
        *,
        beside: bool | None = None,
        speed: float | None = None,
        loop: bool | None = None,
    ) -> None:
        """Have the page play several runs together.

        Args:
            acts: The runs; the first is of this viewer's robot, the others may be of
                others.
            beside: Side by side; or else over each other, all but the first as ghosts.
                None: over each other if all robots have one name.
            speed: Seconds of the runs shown in one second; None: as the view says.
            loop: Play them again and again; None: as the view says.

        Raises:
            ViewerError: If a run is empty or not its robot's, the speed is not
                positive, or the server has ended.
        """
        for act in acts:
            _check(act.robot, act.rollout, act.controller)
        playing = self._playing(speed, loop)
        if beside is None:
            beside = len({act.robot.name for act in acts}) > 1
        view = self.view
        right = to_the_right(self.robot, view.camera, view.target) if beside else None
        comparison = Comparison(
            self.drawing,
            acts,
            shown=view.show.model_dump(),
            beside=right,
            dark=self.dark,
        )
        stage = self._stage(comparison, comparison.title(), fit=beside)
        clip = set_clip(comparison.clip(), play=True, **playing)
        self._obstacles = None
        self._others = comparison.roots[1:]
        self.transport.send([*stage, *clip])

    def open_browser(self) -> bool:
        """Open the page in the user's browser; return whether there is one.

        A line in the log says so if there is none.
        """
        return self.url is not None and browser.open_browser(self.url)

    def wait_until_closed(self) -> None:
        """Wait until no page shows the view any more.

        Raises:
            ViewerError: If the server has ended.
        """
        self.transport.wait_until_closed()

    def wait_for_browser(self, timeout: float) -> bool:
        """Wait until a page shows everything [s]; return whether one does.

        Raises:
            ViewerError: If the server has ended.
        """
        return self.transport.wait_for_page(timeout)

    def close(self) -> None:
        """End the server; what a page shows stays. Again is no error."""
        self.transport.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the page, in a frame."""
        if self.url is None:
            return "<p>This viewer only remembers: it has no page.</p>"
        return (
            f'<iframe src="{escape(self.url)}" style="width: 100%; height: 520px; '
            'border: 0; border-radius: 8px" allowfullscreen></iframe>'
        )

    def set_stage(self, run: RunDrawing, title: str | None) -> float:
        """Clear the stage for a run, and fit it; return the scene's size [m]."""
        points = in_sight(self._subject(run.points()), run.obstacle_points())
        self._obstacles = None
        self.transport.send(self._stage(run, title))
        return scene_size(points)

    def replace_run(
        self, rollout: Rollout, size: float, controller: Controller, status: str
    ) -> None:
        """Draw a run anew, in full, while the page goes on showing it.

        Args:
            rollout: The run.
            size: The scene's size, as `set_stage` returned it [m].
            controller: What controlled it.
            status: What is said beside the scene.

        Raises:
            ViewerError: If the server has ended.
        """
        run = self._run(rollout, controller)
        playing = self._playing(None, None)
        clip = set_clip(run.clip(), play=True, keep=True, **playing)
        self.transport.send([*clear(), *run.draw(size), *clip, set_status(status)])

    def _run(self, rollout: Rollout, controller: Controller | None) -> RunDrawing:
        _check(self.robot, rollout, controller)
        motion = motion_of(self.robot, rollout)
        layers = all_layers(self.robot, motion, controller, dark=self.dark)
        shown = self.view.show.model_dump()
        return RunDrawing(self.drawing, motion, layers, shown=shown)

    def _draw_run(
        self, rollout: Rollout, controller: Controller | None, **playing: Any
    ) -> None:
        run = self._run(rollout, controller)
        stage = self._stage(run, rollout.meta.get("title"))
        self._obstacles = None
        self.transport.send([*stage, *set_clip(run.clip(), **playing)])

    def _draw_obstacles(self, scene: Scene) -> None:
        placements = self._placements(self.robot.home())
        obstacles = ObstacleDrawing(scene)
        stage = self._stage(obstacles, None, self.drawing.points(placements))
        self._obstacles = obstacles
        still = [*obstacles.move(0.0), *self.drawing.move(placements)]
        self.transport.send([*stage, *no_clip(), *still])

    def _stage(
        self,
        scene: Drawable,
        title: str | None,
        moving: Array | None = None,
        fit: bool = False,
    ) -> list[Command]:
        """Return what clears the stage, fits it to a scene, and draws that on it.

        Args:
            scene: What is drawn.
            title: The title; None: the robot's name.
            moving: Points of the robot [m], shape (K, 3); None: the scene's own.
            fit: See all points, even if the view says where the eye is.
        """
        view = self.view
        subject = self._subject(scene.points() if moving is None else moving)
        points = in_sight(subject, scene.obstacle_points())
        floor = min(0.0, float(subject[:, 2].min()))
        commands = [
            *clear(),
            *(delete(root) for root in self._others),
            *draw_stage(points, floor, view),
            *scene.draw(scene_size(points)),
            look_at(self.robot, points, view.camera, view.target, fit=fit),
            set_caption(title or self.robot.name, scene.legend(), dark=self.dark),
            set_time(""),
            set_status(""),
        ]
        self._others = []
        return commands

    def _subject(self, moving: Array) -> Array:
        """Return points that are to be in sight in any case [m], shape (K, 3)."""
        return np.vstack([moving, self.drawing.stand()])

    def _playing(self, speed: float | None, loop: bool | None) -> Mapping[str, Any]:
        speed = self.view.speed if speed is None else speed
        if not 0.0 < speed < float("inf"):
            raise ViewerError(f"speed {speed} must be positive")
        return {"speed": speed, "loop": self.view.loop if loop is None else loop}

    def _around(self, time: float) -> list[Command]:
        """Return what moves all but the robot to where it is at a time [s]."""
        if self._obstacles is None:
            return [seek(time)]
        return [*self._obstacles.move(time), set_time(f"t = {time:.2f} s")]

    def _placements(self, q: Array) -> Any:
        """Return where all joints are in the world."""
        pin.forwardKinematics(self.robot.model, self._data, q)
        return self._data.oMi


def _check(robot: Robot, rollout: Rollout, controller: Controller | None) -> None:
    if not len(rollout):
        raise ViewerError("the run is empty: it has no row to show")
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
