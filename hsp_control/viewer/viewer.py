"""The viewer: a robot, what surrounds it and what it did, in a browser."""

from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.exceptions import ViewerError
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Scene
from hsp_control.simulation import Rollout
from hsp_control.viewer import browser, obstacle_drawing, playback, rollout_drawing
from hsp_control.viewer.camera import look_at
from hsp_control.viewer.commands import delete, set_caption, set_time
from hsp_control.viewer.moments import configuration_between, moment
from hsp_control.viewer.obstacle_drawing import ObstacleDrawing
from hsp_control.viewer.playback import Playback
from hsp_control.viewer.robot_drawing import RobotDrawing
from hsp_control.viewer.rollout_drawing import RolloutDrawing
from hsp_control.viewer.server import Server
from hsp_control.viewer.stage import draw_stage, in_sight, scene_size
from hsp_control.viewer.surroundings import Surroundings
from hsp_control.viewer.transport import Transport


class Viewer:
    """Shows a robot in a browser that may come, go and come back, or never come.

    Attributes:
        robot: The robot.
        transport: Where the commands go.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        open_browser: bool = False,
        camera: Sequence[float] | None = None,
        target: Sequence[float] | None = None,
        transport: Transport | None = None,
        port: int | None = None,
    ) -> None:
        """Show the robot at its home posture.

        Args:
            robot: The robot.
            open_browser: Open the page in the user's browser.
            camera: Where one looks from [m], shape (3,); chosen to see all if None.
            target: Where one looks at [m], shape (3,); the middle of all if None.
            transport: A `Recorder`, to show nothing and only remember; None: a server
                of its own on the loopback address.
            port: The server's port; None: the first free one from 7000.

        Raises:
            ViewerError: If Meshcat is not installed, or the server cannot start.
        """
        self.robot = robot
        self._camera, self._target = camera, target
        self._drawing = RobotDrawing(robot)
        self._data = robot.model.createData()
        self.transport = Server(port) if transport is None else transport
        try:
            self.transport.send(self._drawing.draw())
            self.draw_scene(Scene())
        except BaseException:
            self.close()
            raise
        if open_browser and self.url is not None:
            browser.open_browser(self.url)

    @property
    def url(self) -> str | None:
        """The page's address; None where there is no page."""
        return self.transport.url

    def draw_scene(self, scene: Rollout | Scene) -> None:
        """Show a run's paths, targets and obstacles, or a scene's obstacles.

        Replaces what was shown before, fits the stage, and places the camera.

        Raises:
            ViewerError: If the run is not this robot's or is empty, or if the server
                has ended.
        """
        around: Surroundings
        if isinstance(scene, Rollout):
            self._check(scene)
            around = RolloutDrawing(scene)
            start, q, name = float(scene.t[0]), scene.q[0], scene.meta.get("title")
        else:
            around = ObstacleDrawing(scene)
            start, q, name = 0.0, self.robot.home(), None
        placements = self._placements(q)
        moving = around.points()
        if not len(moving):
            moving = self._drawing.points(placements)
        subject = np.vstack([moving, self._drawing.stand()])
        points = in_sight(subject, around.obstacle_points())
        self.transport.send(
            [
                delete(obstacle_drawing.ROOT),
                delete(rollout_drawing.ROOT),
                *draw_stage(points, floor=min(0.0, float(subject[:, 2].min()))),
                *around.draw(scene_size(points)),
                *around.move(start),
                *self._drawing.move(placements),
                look_at(self.robot, points, self._camera, self._target),
                set_caption(str(name or self.robot.name), around.legend()),
                set_time(""),
            ]
        )
        self._scene, self._around = scene, around

    def show(self, state: RobotState | Any) -> None:
        """Show the robot in a state, or at a configuration of shape (nq,).

        At a state, what surrounds the robot goes to where it is at the state's time.

        Raises:
            ViewerError: If the server has ended.
            ShapeError: If the configuration's shape is not (nq,).
            NonFiniteError: If it holds a NaN or an infinity.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
        """
        if isinstance(state, RobotState):
            self._show(state.t, state.data.oMi)
        else:
            q = self.robot.check_configuration(state)
            self.transport.send(self._drawing.move(self._placements(q)))

    def play(
        self, rollout: Rollout, *, speed: float = 1.0, loop: bool = False
    ) -> Playback:
        """Play a run in real time; frames that come too late are left out.

        Returns when the run is over, whether anyone looks or not. What is returned, and
        a line in the log if it was not smooth, tells how it went.

        Args:
            rollout: The run.
            speed: Seconds of the run shown in one second.
            loop: Play it again and again, until interrupted.

        Raises:
            ViewerError: If the run is not this robot's or is empty, the speed is not
                positive, or the server has ended.
        """
        if rollout is not self._scene:
            self.draw_scene(rollout)

        def draw(time: float) -> None:
            q = configuration_between(self.robot, rollout.q, moment(rollout.t, time))
            self._show(time, self._placements(q))

        start, end = float(rollout.t[0]), float(rollout.t[-1])
        while True:
            played = playback.play(draw, start, end, speed)
            if not loop or end <= start:
                return played

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

    def _show(self, time: float, placements: Any) -> None:
        self.transport.send(
            [
                *self._drawing.move(placements),
                *self._around.move(time),
                set_time(f"t = {time:.2f} s"),
            ]
        )

    def _placements(self, q: Array) -> Any:
        """Return where all joints are in the world."""
        pin.forwardKinematics(self.robot.model, self._data, q)
        return self._data.oMi

    def _check(self, rollout: Rollout) -> None:
        if not len(rollout):
            raise ViewerError("the run is empty: it has no row to show")
        if rollout.q.shape[1] != self.robot.nq:
            name = rollout.meta.get("robot", {}).get("name", "?")
            raise ViewerError(
                f"the run is of {name} with nq = {rollout.q.shape[1]}; "
                f"this viewer's robot is {self.robot.name} with nq = {self.robot.nq}"
            )
