"""Streams of a configuration: its named recordings, and those in a log."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

from hsp_control.common.errors import AccessError
from hsp_control.config.scenario import Scenario
from hsp_control.declaration import within
from hsp_control.declaration.nested import with_parts_replaced
from hsp_control.robot.description.access import Access
from hsp_control.trajectories.streams.sources import kind_of
from hsp_control.trajectories.streams.streamed import Streamed


def with_messages(scenario: Scenario, folder: Path, access: Access) -> Scenario:
    """Return a scenario whose streams hold the messages of their recordings."""

    def located(stream: Streamed) -> Streamed:
        with within("source"):
            if stream.live:
                _check_listening(stream, access)
            return stream.recorded_in(folder, lambda p: access.check(p, "recording"))

    return _with_streams(scenario, located)


def deaf(scenario: Scenario) -> Scenario:
    """Return a scenario whose streams receive nothing: their references do not move."""
    return _with_streams(scenario, lambda stream: replace(stream, source=None))


def _with_streams(
    scenario: Scenario, change: Callable[[Streamed], Streamed]
) -> Scenario:
    given = {
        "tasks": scenario.tasks,
        "changes": scenario.changes,
        "plan": scenario.plan,
    }
    found = with_parts_replaced(given, Streamed, change)
    return scenario if found is given else replace(scenario, **found)


def _check_listening(stream: Streamed, access: Access) -> None:
    assert stream.source is not None
    if not access.strict or kind_of(stream.source).is_local(stream.source):
        return
    raise AccessError(
        f"{stream.source} listens to other computers; strict reading allows only "
        "127.0.0.1"
    )


def with_recordings(
    config: Mapping[str, Any],
    received: Mapping[str, Sequence[Any]],
    planned: Sequence[Any] = (),
) -> dict[str, Any]:
    """Return a log's configuration in which its streams repeat their messages."""
    repeated = deepcopy(dict(config))
    tasks = repeated.get("tasks", {})
    of_tasks = [(tasks.get(name, {}), each) for name, each in received.items()]
    for part, recordings in (*of_tasks, (repeated.get("plan"), planned)):
        for stream, messages in zip(_streams(part), recordings, strict=False):
            stream.pop("source", None)
            stream["messages"] = messages
    return repeated


def without_sources(config: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return a configuration whose streams receive nothing: references do not move."""
    if config is None:
        return None
    deaf = deepcopy(dict(config))
    for stream in _streams(deaf):
        stream.pop("source", None)
    return deaf


def _streams(data: Any) -> Iterator[dict[str, Any]]:
    """Yield the streams in plain data, in order."""
    if isinstance(data, dict):
        if data.get("type") == "stream":
            yield data
        for each in data.values():
            yield from _streams(each)
    elif isinstance(data, list):
        for each in data:
            yield from _streams(each)
