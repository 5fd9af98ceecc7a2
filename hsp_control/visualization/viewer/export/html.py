"""From a run to a file that plays it offline."""

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
from hsp_control.visualization.viewer.export.scene import light_scene
from hsp_control.visualization.viewer.recorder import Recorder
from hsp_control.visualization.viewer.replay import act_of
from hsp_control.visualization.viewer.viewer import Viewer


def export_html(
    rollout: Rollout,
    path: str | Path,
    *,
    robot: Robot | None = None,
    controller: Controller | None = None,
    **view: Any,
) -> Path:
    """Write one page that plays a run offline, with its plots beside it.

    The page needs no server and asks for nothing; a browser of 2023 or newer opens it.

    Args:
        rollout: The run.
        path: The file to write.
        robot: The robot; None: it and its controller are built anew from the
            configuration that the log holds.
        controller: What controlled the run: see `Viewer.play`.
        view: What to change of the log's own ``view``: see `Viewer`.

    Raises:
        ViewerError: If the robot cannot be found again, or the run is empty or of
            another robot.
        ConfigError: If there is no such thing in a view.
        ExportError: If a mesh cannot be read, what reads it is not installed, or the
            file cannot be written.
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
        _, robot, _, controller = act_of(rollout, "the log")
    recorder, arrays = Recorder(), ArrayTable()
    own = (rollout.config or {}).get("view", {})
    with Viewer(robot, transport=recorder, **{**own, **view}) as viewer:
        viewer.play(rollout, controller=controller)
    commands = [unpack(packed) for _, _, packed in recorder.scene.items()]
    content: Json = {
        "type": "show",
        "commands": light_scene(commands, arrays),
        "plots": pack_panels(rollout, arrays),
        "about": _about(rollout),
    }
    title = str(rollout.meta.get("title") or robot.name)
    return assemble(title, {**content, "arrays": arrays.entries})


def _about(rollout: Rollout) -> Json:
    """Return words about the run, for the foot of the page."""
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
