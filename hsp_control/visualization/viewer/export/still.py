"""Exports a robot that stands still to a page, with notes beside it."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from hsp_control.robot import Robot
from hsp_control.visualization.viewer.commands import unpack
from hsp_control.visualization.viewer.export.html import write_page
from hsp_control.visualization.viewer.export.page import assemble
from hsp_control.visualization.viewer.export.scene_reduction import reduce_scene
from hsp_control.visualization.viewer.packed.packing import ArrayTable
from hsp_control.visualization.viewer.recorder import Recorder
from hsp_control.visualization.viewer.viewer import Viewer


class Note(NamedTuple):
    """A note beside the robot.

    Attributes:
        heading: Its heading.
        items: Its items, one below the other.
        cure: What to do; empty: nothing.
    """

    heading: str
    items: Sequence[str]
    cure: str


def export_still(robot: Robot, path: Path, notes: Sequence[Note]) -> Path:
    """Write a page with the robot at its home posture, and return its path.

    Raises:
        ExportError: If a mesh cannot be read, the library for it is not installed, or
            the file cannot be written.
    """
    recorder, arrays = Recorder(), ArrayTable()
    with Viewer(robot, transport=recorder):
        commands = [unpack(packed) for _, _, packed in recorder.scene.items()]
    content = {
        "type": "show",
        "commands": reduce_scene(commands, arrays),
        "notes": [
            {"heading": note.heading, "items": list(note.items), "cure": note.cure}
            for note in notes
        ],
    }
    return write_page(path, assemble(robot.name, {**content, "arrays": arrays.entries}))
