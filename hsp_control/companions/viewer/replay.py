"""Plays logs in a viewer: rebuilds their robots and controllers first."""

import logging
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from hsp_control.common.errors import AccessError, HspControlError, ViewerError
from hsp_control.companions.viewer.comparison import ComparedRun
from hsp_control.companions.viewer.offline_page import HEIGHT, InlineView
from hsp_control.companions.viewer.transport import SceneRecorder
from hsp_control.companions.viewer.viewer import Viewer
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.config.loaded_scenario import load_robot, validate
from hsp_control.config.logged_run import logged_document
from hsp_control.config.recorded_scene import with_recorded_scene
from hsp_control.config.scenario import Scenario
from hsp_control.control.interface import Controller
from hsp_control.declaration.language import check_kind
from hsp_control.robot import Robot
from hsp_control.robot.description.access import ANYWHERE, Access, only_within
from hsp_control.robot.description.sources import packaged_folders
from hsp_control.robot.recorded import recorded_robot, usable_record
from hsp_control.simulation import Rollout

_log = logging.getLogger(__name__)


def access_for(
    logs: Sequence[Path], strict: bool, allow: Sequence[str | PathLike[str]]
) -> Access:
    """Return which files logs may read."""
    if not strict:
        return ANYWHERE
    return only_within([*(log.parent for log in logs), *packaged_folders(), *allow])


def robot_of(rollout: Rollout, access: Access = ANYWHERE) -> Robot:
    """Return the robot of a log, which is in the log, or in its configuration.

    Args:
        rollout: The log.
        access: Which files it may read.

    Raises:
        ViewerError: If the log has no configuration, or its robot cannot be rebuilt.
    """
    record = usable_record(rollout.meta)
    try:
        if record is not None:
            return recorded_robot(record, access)
    except AccessError:
        raise
    except HspControlError as error:
        raise ViewerError(f"the log's robot cannot be rebuilt: {error}") from error
    document = _document(rollout, access)
    try:
        robot = load_robot(document, validate(document, Scenario))
    except HspControlError as error:
        raise ViewerError(f"the log's robot cannot be rebuilt: {error}") from error
    return robot


def rebuild_run(rollout: Rollout, name: str, access: Access = ANYWHERE) -> ComparedRun:
    """Return a log with its robot and, if it can be rebuilt, its controller."""
    if not access.strict:  # an untrusted log writes no files
        rollout = with_recorded_scene(rollout)
    for obstacle, about in rollout.meta.get("obstacles", {}).items():
        if file := about.get("parameters", {}).get("file"):
            access.check(Path(str(file)), f"{name}: obstacle {obstacle!r}: mesh")
    if rollout.config is None and usable_record(rollout.meta) is not None:
        return ComparedRun(name, robot_of(rollout, access), rollout)
    try:
        experiment = build(_document(rollout, access))
    except AccessError:
        raise
    except HspControlError as error:
        robot = robot_of(rollout, access)
        _log.warning(
            "%s: no controller, only the log's columns are drawn: %s", name, error
        )
        return ComparedRun(name, robot, rollout)
    return ComparedRun(name, experiment.robot, rollout, experiment.controller)


def load_runs(logs: Sequence[Path], access: Access = ANYWHERE) -> list[ComparedRun]:
    """Return logs with their robots and controllers, by the names of their files."""
    names = zip(logs, _names(logs), strict=True)
    return [_load(path, name, access) for path, name in names]


def view_logs(
    logs: Sequence[Path],
    *,
    beside: bool | None = None,
    speed: float | None = None,
    loop: bool | None = None,
    transport: SceneRecorder | None = None,
    strict: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Viewer:
    """Open a viewer that plays one log, or several together; the caller closes it.

    Camera, speed and visible layers are those of the first log's configuration.

    Args:
        logs: The files.
        beside: For several logs: see `Viewer.compare`.
        speed: Seconds of the run per second of real time; None: the log's setting.
        loop: Repeat the run; None: the log's setting.
        transport: See `Viewer`.
        strict: For untrusted logs: see `load_experiment`.
        allow: Further folders for strict reading.

    Raises:
        LogError: If a log cannot be read.
        ViewerError: If a log is empty, its robot cannot be rebuilt, or the view cannot
            be opened.
    """
    runs = load_runs(logs, access_for(logs, strict, allow))
    first = runs[0]
    view = (first.rollout.config or {}).get("view", {})
    viewer = Viewer(first.robot, transport=transport, **view)
    try:
        if len(runs) == 1:
            viewer.play(
                first.rollout, controller=first.controller, speed=speed, loop=loop
            )
        else:
            viewer.compare(runs, beside=beside, speed=speed, loop=loop)
    except BaseException:
        viewer.close()
        raise
    return viewer


def show(
    rollout: Rollout,
    *,
    robot: Robot | None = None,
    controller: Controller | None = None,
    height: int = HEIGHT,
    **view: Any,
) -> InlineView:
    """Return a view of a run for a notebook: it starts no server and needs none.

    It is paused at the run's start; its player, legend and keys are those of the view.

    Args:
        rollout: The run.
        robot: The robot; None: it and its controller are rebuilt from the configuration
            in the log.
        controller: The run's controller: see `Viewer.play`.
        height: The height of its frame [pixels].
        view: Settings that replace those of the log's ``view``: see `Viewer`.

    Raises:
        ViewerError: If the robot cannot be rebuilt, the run is empty or of another
            robot, a view has no such field, or a value is not valid.
        ExportError: If a mesh cannot be read, or the library for it is not installed.
    """
    check_kind("rollout is", rollout, Rollout, ViewerError)
    if robot is None:
        _, robot, rollout, controller = rebuild_run(rollout, "the log")
    recorder = SceneRecorder()
    own = (rollout.config or {}).get("view", {})
    with Viewer(robot, transport=recorder, **{**own, **view}) as viewer:
        viewer.draw_scene(rollout, controller=controller)
    return InlineView(recorder.scene, height=height)


def _load(path: Path, name: str, access: Access) -> ComparedRun:
    try:
        return rebuild_run(Rollout.load(path), name, access)
    except ViewerError as error:
        raise ViewerError(f"{path}: {error}") from error


def _document(rollout: Rollout, access: Access) -> Document:
    if rollout.config is None:
        name = rollout.meta.get("robot", {}).get("name", "?")
        raise ViewerError(
            f"this log was made from Python: it has no configuration of its robot "
            f"{name!r}{_why_missing(rollout)}; give the robot, as in "
            "Viewer(robot).play(rollout)"
        )
    return logged_document(rollout, access)


def _why_missing(rollout: Rollout) -> str:
    record = rollout.meta.get("robot", {}).get("record")
    why = record.get("missing") if isinstance(record, dict) else None
    return f", and {why}" if why else ""


def _names(logs: Sequence[Path]) -> list[str]:
    """Return distinct names of the logs: the file names, with folders if necessary."""
    stems = [path.stem for path in logs]
    if len(set(stems)) == len(stems):
        return stems
    full = [str(path.with_suffix("")) for path in logs]
    if len(set(full)) == len(full):
        return full
    return [f"{name} ({k})" for k, name in enumerate(full, start=1)]
