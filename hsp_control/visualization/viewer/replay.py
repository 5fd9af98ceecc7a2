"""From logs to the view: find their robots and controllers again, and play them."""

import logging
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from hsp_control.common.exceptions import AccessError, HspControlError, ViewerError
from hsp_control.config.build_robot import build_robot
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.config.scenario import Scenario
from hsp_control.config.validation import validate
from hsp_control.robot import Robot
from hsp_control.robot.description.access import ANYWHERE, Access, only_within
from hsp_control.robot.description.sources import packaged_folders
from hsp_control.simulation import Rollout
from hsp_control.visualization.viewer.comparison import Act
from hsp_control.visualization.viewer.transport import Transport
from hsp_control.visualization.viewer.viewer import Viewer

_log = logging.getLogger(__name__)


def access_for(
    logs: Sequence[Path], strict: bool, allow: Sequence[str | PathLike[str]]
) -> Access:
    """Return which files logs may name: told to be strict, those beside them."""
    if not strict:
        return ANYWHERE
    return only_within([*(log.parent for log in logs), *packaged_folders(), *allow])


def robot_of(rollout: Rollout, access: Access = ANYWHERE) -> Robot:
    """Return the robot of a log, built anew from the configuration that it holds.

    Args:
        rollout: The log.
        access: Which files it may name.

    Raises:
        ViewerError: If the log holds none, or its robot cannot be found again.
    """
    document = _document(rollout, access)
    try:
        robot, _ = build_robot(document, validate(document, Scenario), Path())
    except HspControlError as error:
        raise ViewerError(f"the log's robot cannot be found again: {error}") from error
    return robot


def act_of(rollout: Rollout, name: str, access: Access = ANYWHERE) -> Act:
    """Return a log with its robot and, if that can be built anew, its controller.

    A line in the log says so if it cannot.

    Args:
        rollout: The log.
        name: What to call it.
        access: Which files it may name.

    Raises:
        ViewerError: If the log holds no configuration, or its robot is gone.
        AccessError: If it names a file that is not allowed.
    """
    for obstacle, about in rollout.meta.get("obstacles", {}).items():
        if file := about.get("parameters", {}).get("file"):
            access.check(Path(str(file)), f"{name}: obstacle {obstacle!r}: mesh")
    try:
        experiment = build(_document(rollout, access))
    except AccessError:
        raise
    except HspControlError as error:
        robot = robot_of(rollout, access)
        _log.warning("%s: only what its columns tell is drawn: %s", name, error)
        return Act(name, robot, rollout)
    return Act(name, experiment.robot, rollout, experiment.controller)


def view_logs(
    logs: Sequence[Path],
    *,
    beside: bool | None = None,
    speed: float | None = None,
    loop: bool | None = None,
    port: int | None = None,
    transport: Transport | None = None,
    strict: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Viewer:
    """Open a viewer that plays one log, or several together; it stays open.

    Camera, speed and what is shown are as the first log's configuration says.

    Args:
        logs: The files.
        beside: Of several: see `Viewer.compare`.
        speed: Seconds of the run shown in one second; None: as the log says.
        loop: Play it again and again; None: as the log says.
        port: See `Viewer`.
        transport: See `Viewer`.
        strict: For logs of strangers: see `load_experiment`.
        allow: Further folders for strict reading.

    Raises:
        LogError: If a log cannot be read.
        ViewerError: If a log is empty, its robot cannot be found again, or the view
            cannot be opened.
    """
    access = access_for(logs, strict, allow)
    names = zip(logs, _names(logs), strict=True)
    acts = [_act(path, name, access) for path, name in names]
    first = acts[0]
    view = (first.rollout.config or {}).get("view", {})
    viewer = Viewer(first.robot, port=port, transport=transport, **view)
    try:
        if len(acts) == 1:
            viewer.play(
                first.rollout, controller=first.controller, speed=speed, loop=loop
            )
        else:
            viewer.compare(acts, beside=beside, speed=speed, loop=loop)
    except BaseException:
        viewer.close()
        raise
    return viewer


def _act(path: Path, name: str, access: Access) -> Act:
    try:
        return act_of(Rollout.load(path), name, access)
    except ViewerError as error:
        raise ViewerError(f"{path}: {error}") from error


def _document(rollout: Rollout, access: Access) -> Document:
    if rollout.config is None:
        name = rollout.meta.get("robot", {}).get("name", "?")
        raise ViewerError(
            f"this log was made from Python and does not say how its robot {name!r} "
            "was built; give the robot, as in Viewer(robot).play(rollout)"
        )
    document = Document(rollout.config, {}, "the log's configuration")
    document.access = access
    return document


def _names(logs: Sequence[Path]) -> list[str]:
    """Return names that tell the logs apart: the files', with folders if they must."""
    stems = [path.stem for path in logs]
    if len(set(stems)) == len(stems):
        return stems
    full = [str(path.with_suffix("")) for path in logs]
    if len(set(full)) == len(full):
        return full
    return [f"{name} ({k})" for k, name in enumerate(full, start=1)]
