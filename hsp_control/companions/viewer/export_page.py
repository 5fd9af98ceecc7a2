"""Exports runs to a page that plays them offline."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from hsp_control.common.errors import ExportError
from hsp_control.common.unicode_text import utf8
from hsp_control.companions.viewer.commands import Json
from hsp_control.companions.viewer.comparison import (
    GHOST_OPACITY,
    ComparedRun,
    ghost_color,
    run_parts,
)
from hsp_control.companions.viewer.offline_page import scene_page
from hsp_control.companions.viewer.packing import ArrayTable
from hsp_control.companions.viewer.page_plots import pack_panels
from hsp_control.companions.viewer.replay import rebuild_run
from hsp_control.companions.viewer.transport import SceneRecorder
from hsp_control.companions.viewer.viewer import Viewer
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout


def export_html(
    rollout: Rollout | Sequence[ComparedRun],
    path: str | Path,
    *,
    robot: Robot | None = None,
    controller: Controller | None = None,
    **view: Any,
) -> Path:
    """Write a page that plays a run offline, with its plots beside the scene.

    A page of several runs has a switch between them, and their curves in the same
    plots. Runs of one robot are overlaid; different robots stand side by side.

    The page needs no server and loads no other file; it needs a browser of 2023 or
    newer.

    Args:
        rollout: The run; or several of different names, with their robots and
            controller. The view is that of the first.
        path: The file to write.
        robot: The robot of a single run; None: it and its controller are rebuilt from
            the configuration in the log.
        controller: The controller of a single run: see `Viewer.play`.
        view: Settings that replace those of the log's ``view``: see `Viewer`.

    Raises:
        ViewerError: If the robot cannot be rebuilt, a run is empty or of another robot,
            a view has no such field, or a value is not valid.
        ExportError: If there is no run, two have the same name, a robot or a controller
            is given for several, a mesh cannot be read, the library for it is not
            installed, or the file cannot be written.
    """
    return write_page(Path(path), page_of(_runs(rollout, robot, controller), view))


def write_page(path: Path, text: str) -> Path:
    """Write a page atomically: completely or not at all.

    Raises:
        ExportError: If it cannot be written.
    """
    part = path.parent / f".{path.name}.part"  # also of "."
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(utf8(text))
        part.replace(path)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise ExportError(
            f"{path}: cannot write the page: {error.strerror or error}"
        ) from error
    return path


def page_of(runs: Sequence[ComparedRun], view: dict[str, Any]) -> str:
    """Return the page that `export_html` writes."""
    first, names = runs[0], [run.name for run in runs]
    recorder, arrays = SceneRecorder(), ArrayTable()
    own = (first.rollout.config or {}).get("view", {})
    beside = len({run.robot.name for run in runs}) > 1
    with Viewer(first.robot, transport=recorder, **{**own, **view}) as viewer:
        if len(runs) == 1:
            viewer.play(first.rollout, controller=first.controller)
        else:
            viewer.compare(runs, beside=beside, ghosts=False)
    content: Json = {
        "plots": pack_panels(runs, arrays),
        "about": _about(runs),
    }
    if len(runs) > 1:
        content["runs"] = {
            "names": names,
            "parts": [] if beside else run_parts(names),
            "colors": [ghost_color(number) for number in range(len(runs))],
            "opacity": GHOST_OPACITY,
        }
    titles = {str(run.rollout.meta.get("title") or "") for run in runs}
    title = titles.pop() if len(titles) == 1 else " and ".join(names)
    title = title or first.robot.name
    return scene_page(recorder.scene, title, arrays, **content)


def _runs(
    rollout: Rollout | Sequence[ComparedRun],
    robot: Robot | None,
    controller: Controller | None,
) -> Sequence[ComparedRun]:
    if isinstance(rollout, Rollout):
        if robot is None:
            return [rebuild_run(rollout, "the log")]
        return [ComparedRun("the log", robot, rollout, controller)]
    if robot is not None or controller is not None:
        raise ExportError("each of several runs has its own robot and controller")
    names = [run.name for run in rollout]
    if not names:
        raise ExportError("there is no run to export")
    if len(set(names)) < len(names):
        raise ExportError(f"runs must have different names, not {', '.join(names)}")
    return rollout


_HELP = (
    "In the plots: click to go to a time, drag to zoom (or pinch), Esc for the whole "
    "run; click a name to see it alone."
)


def _about(runs: Sequence[ComparedRun]) -> list[str]:
    """Return the paragraphs at the foot of the page: descriptions and facts."""
    lines = [_HELP]
    for run in runs:
        meta, config = run.rollout.meta, run.rollout.config or {}
        text = " ".join(str(config.get("description") or "").split())
        facts = [
            (run.rollout.status, meta.get("message", "")),
            ("robot", meta["robot"]["name"]),
            ("field", meta.get("field", "")),
            ("metric", meta.get("metric", "")),
            ("hsp_control", meta.get("versions", {}).get("hsp_control", "")),
        ]
        if run.rollout.status == "completed":
            del facts[0]
        words = [f"{name} {value}" for name, value in facts if value]
        lines += [text] if text and text not in lines else []
        lines.append("  ·  ".join([run.name, *words] if len(runs) > 1 else words))
    return lines
