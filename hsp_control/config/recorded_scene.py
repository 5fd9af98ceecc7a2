"""The meshes of a log's obstacles, on computers without their files."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hsp_control.common.resources import is_file
from hsp_control.common.suggestions import listing
from hsp_control.robot.description.recorded_meshes import is_recorded, recorded_meshes
from hsp_control.simulation import Rollout

_log = logging.getLogger(__name__)


def with_recorded_scene(run: Rollout) -> Rollout:
    """Return a log whose obstacles' meshes are files of this computer.

    They are those of the run: a file that has changed since is not used, and a warning
    names it.

    Raises:
        ModelError: If the recorded meshes are damaged.
    """
    data = run.meta.get("obstacle_meshes")
    if not data:
        return run
    recorded = recorded_meshes(data)
    there = {name for name in recorded if is_file(Path(name))}
    same = {name for name in there if is_recorded(Path(name), recorded[name])}
    if changed := sorted(there - same):
        _log.warning(
            "meshes of obstacles have changed since the log was made: those of the log "
            "are used: %s",
            listing(changed),
        )
    files = {name: file for name, file in recorded.items() if name not in same}
    meta = dict(run.meta)
    meta["obstacles"] = _renamed(meta.get("obstacles"), files)
    if isinstance(config := meta.get("config"), Mapping):
        meta["config"] = {**config, "scene": _renamed(config.get("scene"), files)}
    return Rollout(run.columns, meta)


def _renamed(value: Any, files: Mapping[str, Path]) -> Any:
    """Return data in which each ``file`` is on this computer."""
    if isinstance(value, Mapping):
        return {
            key: str(files.get(str(inside), inside))
            if key == "file"
            else _renamed(inside, files)
            for key, inside in value.items()
        }
    return value
