"""The viewer: a robot, what surrounds it and what it did, in a browser."""

from collections.abc import Callable, Iterable, Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.controller import Controller
from hsp_control.exceptions import ViewerError
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Scene
from hsp_control.simulation import Rollout
from hsp_control.viewer import browser, run_drawing
from hsp_control.viewer.camera import look_at
from hsp_control.viewer.clip import no_clip, set_clip
from hsp_control.viewer.commands import Command, seek, set_caption, set_time
from hsp_control.viewer.obstacle_drawing import ObstacleDrawing
from hsp_control.viewer.robot_drawing import RobotDrawing
from hsp_control.viewer.run_drawing import RunDrawing
from hsp_control.viewer.server import Server
from hsp_control.viewer.stage import draw_stage, in_sight, scene_size
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
        self._obstacles: ObstacleDrawing | None = None
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
        self.transport.send([*around, *self._drawing.move(placements)])

    def play(
        self,
        rollout: Rollout,
        *,
        speed: float = 1.0,
        loop: bool = False,
        controller: Controller | None = None,
    ) -> None:
        """Have the page play a run, and return at once, whether anyone looks or not.

        The page has the run then: pausing, speed and going to a time are its own.

        Args:
            rollout: The run.
            speed: Seconds of the run shown in one second.
            loop: Play it again and again.
            controller: What controlled the run; shows what the log's columns alone do
                not tell, such as shortest distances and self-motion.

        Raises:
            ViewerError: If the run is not this robot's or is empty, the speed is not
                positive, or the server has ended.
        """
        if not 0.0 < speed < float("inf"):
            raise ViewerError(f"speed {speed} must be positive")
        run = self._draw_run(rollout, controller)
        self.transport.send(set_clip(run.clip(), play=True, loop=loop, speed=speed))

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

    def _draw_run(self, rollout: Rollout, controller: Controller | None) -> RunDrawing:
        self._check(rollout)
        run = RunDrawing(self._drawing, rollout, controller=controller)
        self._obstacles = None
        self._stage(
            run.points(),
            run.obstacle_points(),
            run.draw,
            str(rollout.meta.get("title") or self.robot.name),
            run.legend(),
        )
        self.transport.send(set_clip(run.clip()))
        return run

    def _draw_obstacles(self, scene: Scene) -> None:
        placements = self._placements(self.robot.home())
        obstacles = ObstacleDrawing(scene)
        self._obstacles = obstacles
        self._stage(
            self._drawing.points(placements),
            obstacles.obstacle_points(),
            obstacles.draw,
            self.robot.name,
            obstacles.legend(),
        )
        still = [*no_clip(), *obstacles.move(0.0), *self._drawing.move(placements)]
        self.transport.send(still)

    def _stage(
        self,
        moving: Array,
        others: Array,
        draw: Callable[[float], Iterable[Command]],
        title: str,
        legend: list[tuple[str, str]],
    ) -> None:
        """Clear the stage, fit it to points of the robot and others, and draw on it."""
        subject = np.vstack([moving, self._drawing.stand()])
        points = in_sight(subject, others)
        self.transport.send(
            [
                *run_drawing.clear(),
                *draw_stage(points, floor=min(0.0, float(subject[:, 2].min()))),
                *draw(scene_size(points)),
                look_at(self.robot, points, self._camera, self._target),
                set_caption(title, legend),
                set_time(""),
            ]
        )

    def _around(self, time: float) -> list[Command]:
        """Return what moves all but the robot to where it is at a time [s]."""
        if self._obstacles is None:
            return [seek(time)]
        return [*self._obstacles.move(time), set_time(f"t = {time:.2f} s")]

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
