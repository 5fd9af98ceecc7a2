"""Recordings for Rerun's viewer as a format of ``hsp export``."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hsp_control.companions.viewer.command import ExportFormat

if TYPE_CHECKING:
    from hsp_control.companions.viewer.comparison import ComparedRun


def _write(
    run: "ComparedRun",
    path: Path,
    options: argparse.Namespace,
    progress: Callable[[float], None],
) -> Path:
    from hsp_control.companions.rerun.log import log_to_rerun

    log_to_rerun(run.rollout, run.robot, path=path)
    return path


RERUN = ExportFormat(
    what="a file of Rerun",
    files={"rrd": "a file for Rerun's viewer; needs the extra rerun"},
    add_options=lambda export: None,
    write=_write,
)
