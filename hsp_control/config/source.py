"""What an experiment is read from: a name, a file, a log, or the data itself."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.exceptions import ConfigError
from hsp_control.common.resources import bundled_configs, is_file
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.config.document import Document
from hsp_control.config.streams import with_recordings
from hsp_control.declaration.language import shown, spoken
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.sources import is_robot, packaged_folders
from hsp_control.simulation import Rollout


def read_document(
    source: str | PathLike[str] | dict[str, Any],
    *,
    strict: bool = False,
    allow: Sequence[str | PathLike[str]] = (),
) -> Document:
    """Return the configuration's data with the location of each key."""
    document = _read(source)
    if strict:
        own = [] if isinstance(source, dict) else [Path(document.name).parent]
        document.access = only_within([*own, *packaged_folders(), *allow])
        document.packages = frozenset(map(str, allow))
    return document


def _read(source: str | PathLike[str] | dict[str, Any]) -> Document:
    if isinstance(source, dict):
        return Document(source, {}, "configuration")
    if not isinstance(source, str | PathLike):
        raise ConfigError(f"{shown(source)} is neither a name, a path nor a dict")
    path = Path(source)
    if path.suffix in {".npz", ".journal"}:
        run = Rollout.load(path)
        if run.config is None:
            raise ConfigError(
                f"{path}: this log was made from Python and contains no configuration"
                + (f": {lost}" if (lost := run.meta.get("config_lost")) else "")
            )
        if lost := run.meta.get("changes_lost"):
            raise ConfigError(
                f"{path}: the run cannot be repeated, because changes were made while "
                f"it ran that are not data: {lost}"
            )
        if lost := run.meta.get("streams_lost"):
            raise ConfigError(
                f"{path}: the run cannot be repeated, because {lost} messages of its "
                "streams were too many to be recorded"
            )
        _check_heard(path, run)
        made = run.meta.get("changes") or []
        config = with_recordings(
            run.config,
            run.meta.get("streams") or {},
            run.meta.get("plan_streams") or [],
        )
        return Document(config | {"changes": made}, {}, str(path))
    known = bundled_configs()
    if path.suffix in {".yaml", ".yml"} or is_file(path):
        return Document.read(path)
    if str(source) in known:
        return Document.read(known[str(source)])
    if is_robot(str(source)):
        raise ConfigError(
            f"{str(source)!r} is a robot, and this needs a configuration; "
            + spoken(f"hsp play {source} drives", f"Robot.load({source!r}) loads")
            + " the robot"
        )
    raise ConfigError(
        f"no configuration {str(source)!r}{did_you_mean(str(source), known)} "
        f"(give the path of a .yaml file, or one of: {listing(known)})"
    )


def _check_heard(path: Path, run: Rollout) -> None:
    """Check that a log holds all that its streams have taken."""
    for name, recordings in (run.meta.get("streams") or {}).items():
        for k, messages in enumerate(recordings):
            column = f"stream.{name}{f'_{k + 1}' if k else ''}.taken"
            taken = np.nanmax(run[column]) if column in run.columns else 0
            if taken > len(messages):
                raise ConfigError(
                    f"{path}: the run cannot be repeated: a stream of task {name!r} "
                    f"took {taken:.0f} messages, and the log holds {len(messages)} of "
                    "them, because it has no end"
                )
