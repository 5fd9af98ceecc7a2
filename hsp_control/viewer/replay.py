"""From a log to the view: find its robot again, open a viewer, play it."""

from collections.abc import Callable
from pathlib import Path

from hsp_control.config.build_robot import build_robot
from hsp_control.config.document import Document
from hsp_control.config.models.view import ViewModel
from hsp_control.config.scenario import Scenario
from hsp_control.config.validation import validate
from hsp_control.exceptions import HspControlError, ViewerError
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.viewer import browser
from hsp_control.viewer.transport import Transport
from hsp_control.viewer.viewer import Viewer

PAGE_TIMEOUT = 15.0  # s


def robot_of(rollout: Rollout) -> Robot:
    """Return the robot of a log, built anew from the configuration that it holds.

    Raises:
        ViewerError: If the log holds none, or its robot cannot be found again.
    """
    name = rollout.meta.get("robot", {}).get("name", "?")
    if rollout.config is None:
        raise ViewerError(
            f"this log was made from Python and does not say how its robot {name!r} "
            "was built; give the robot, as in Viewer(robot).play(rollout)"
        )
    try:
        document = Document(rollout.config, {}, "the log's configuration")
        robot, _ = build_robot(document, validate(document, Scenario), Path())
    except HspControlError as error:
        raise ViewerError(f"the log's robot cannot be found again: {error}") from error
    return robot


def view_rollout(
    robot: Robot,
    rollout: Rollout,
    settings: ViewModel | None = None,
    *,
    open_browser: bool = False,
    announce: Callable[[str], None] | None = None,
    transport: Transport | None = None,
) -> Viewer:
    """Open a viewer and play a run once; the viewer stays open, at the run's end.

    Prints nothing. With a browser, it begins when the page shows the scene; without
    one it does not wait.

    Args:
        robot: The robot; of a log: see `robot_of`.
        rollout: The run.
        settings: Camera and speed; None: as the log's configuration says.
        open_browser: Open the page in the user's browser.
        announce: Is told the page's address before playing begins.
        transport: See `Viewer`.

    Raises:
        ViewerError: If the view cannot be opened, or the run is not this robot's.
    """
    if settings is None:
        settings = ViewModel.model_validate((rollout.config or {}).get("view", {}))
    viewer = Viewer(
        robot,
        camera=settings.camera,
        target=settings.target,
        transport=transport,
    )
    try:
        viewer.draw_scene(rollout)
        if announce is not None and viewer.url is not None:
            announce(viewer.url)
        if open_browser and viewer.url and browser.open_browser(viewer.url):
            viewer.wait_for_browser(PAGE_TIMEOUT)
        viewer.play(rollout, speed=settings.speed)
    except BaseException:
        viewer.close()
        raise
    return viewer
