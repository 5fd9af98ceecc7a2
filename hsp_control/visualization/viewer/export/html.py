"""Exports a run to a page that plays it offline."""

from contextlib import suppress
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import ExportError
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.visualization.viewer.commands import Json, unpack
from hsp_control.visualization.viewer.export.packing import ArrayTable
from hsp_control.visualization.viewer.export.page import assemble
from hsp_control.visualization.viewer.export.panels import pack_panels
from hsp_control.visualization.viewer.export.scene_reduction import reduce_scene
from hsp_control.visualization.viewer.recorder import Recorder
from hsp_control.visualization.viewer.replay import rebuild_run
from hsp_control.visualization.viewer.viewer import Viewer


def export_html(
    rollout: Rollout,
    path: str | Path,
    *,
    robot: Robot | None = None,
    controller: Controller | None = None,
    **view: Any,
) -> Path:
    """Write a page that plays a run offline, with its plots beside the scene.

    The page needs no server and loads no other file; it needs a browser of 2023 or
    newer.

    Args:
        rollout: The run.
        path: The file to write.
        robot: The robot; None: it and its controller are rebuilt from the configuration
            in the log.
        controller: The run's controller: see `Viewer.play`.
        view: Settings that replace those of the log's ``view``: see `Viewer`.

    Raises:
        ViewerError: If the robot cannot be rebuilt, the run is empty or of another
            robot, a view has no such field, or a value is not valid.
        ExportError: If a mesh cannot be read, the library for it is not installed, or
            the file cannot be written.
    """
    path = Path(path)
    text = page_of(rollout, robot, controller, view)
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise ExportError(
            f"{path}: cannot write the page: {error.strerror or error}"
        ) from error
    return path


def page_of(
    rollout: Rollout,
    robot: Robot | None,
    controller: Controller | None,
    view: dict[str, Any],
) -> str:
    """Return the page that `export_html` writes."""
    if robot is None:
        _, robot, _, controller = rebuild_run(rollout, "the log")
    recorder, arrays = Recorder(), ArrayTable()
    own = (rollout.config or {}).get("view", {})
    with Viewer(robot, transport=recorder, **{**own, **view}) as viewer:
        viewer.play(rollout, controller=controller)
    commands = [unpack(packed) for _, _, packed in recorder.scene.items()]
    content: Json = {
        "type": "show",
        "commands": reduce_scene(commands, arrays),
        "plots": pack_panels(rollout, arrays),
        "about": _about(rollout),
    }
    title = str(rollout.meta.get("title") or robot.name)
    return assemble(title, {**content, "arrays": arrays.entries})


def _about(rollout: Rollout) -> Json:
    """Return the description and the facts at the foot of the page."""
    meta, config = rollout.meta, rollout.config or {}
    facts = [
        ("robot", meta["robot"]["name"]),
        ("field", meta.get("field", "")),
        ("metric", meta.get("metric", "")),
        ("hsp_control", meta.get("versions", {}).get("hsp_control", "")),
    ]
    if rollout.status != "completed":
        facts.insert(0, (rollout.status, meta.get("message", "")))
    return {
        "text": " ".join(str(config.get("description") or "").split()),
        "facts": [[name, str(value)] for name, value in facts if value],
    }
