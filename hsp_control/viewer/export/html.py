"""From a run to a file that plays it offline."""

from contextlib import suppress
from pathlib import Path

from hsp_control.config.models.view import ViewModel
from hsp_control.exceptions import ExportError
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.viewer.commands import Json, unpack
from hsp_control.viewer.export.packing import ArrayTable
from hsp_control.viewer.export.page import assemble
from hsp_control.viewer.export.panels import pack_panels
from hsp_control.viewer.export.scene import light_scene
from hsp_control.viewer.recorder import Recorder
from hsp_control.viewer.replay import robot_of, view_rollout


def export_html(
    rollout: Rollout,
    path: str | Path,
    *,
    robot: Robot | None = None,
    settings: ViewModel | None = None,
) -> Path:
    """Write one page that plays a run offline, with its plots beside it.

    The page needs no server and asks for nothing; a browser of 2023 or newer opens it.

    Args:
        rollout: The run.
        path: The file to write.
        robot: The robot; None: built anew from the configuration that the log holds.
        settings: Camera and speed; None: as the log's configuration says.

    Raises:
        ViewerError: If the robot cannot be found again, or the run is empty or of
            another robot.
        ExportError: If a mesh cannot be read, what reads it is not installed, or the
            file cannot be written.
    """
    path = Path(path)
    text = page_of(rollout, robot=robot, settings=settings)
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
    *,
    robot: Robot | None = None,
    settings: ViewModel | None = None,
) -> str:
    """Return the page that `export_html` writes."""
    recorder, arrays = Recorder(), ArrayTable()
    robot = robot_of(rollout) if robot is None else robot
    view_rollout(robot, rollout, settings, transport=recorder).close()
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
