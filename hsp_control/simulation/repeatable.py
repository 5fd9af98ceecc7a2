"""What came during a run, as data, so that the run can be repeated from its log."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hsp_control.common.exceptions import ConfigError
from hsp_control.control.controller import Controller
from hsp_control.control.plan import RunningPlan
from hsp_control.declaration.nested import parts_within, with_parts_replaced
from hsp_control.declaration.plain_data import plain_data
from hsp_control.tasks import Task
from hsp_control.trajectories.streams.stream import Streamed


def repeatable(
    controller: Controller, tasks: Mapping[str, Task], plan: RunningPlan | None
) -> dict[str, Any]:
    """Return the changes that were made, and what streams have taken, as JSON data."""
    streams = {
        name: list(parts_within(task, Streamed))
        for name, task in tasks.items()
        if task.remembers
    }
    heard = {name: [list(s.record) for s in each] for name, each in streams.items()}
    lost = sum(s.unrecorded for each in streams.values() for s in each)
    found = _changes(controller) | ({"streams": heard} if heard else {})
    if plan is not None:
        planned = list(parts_within(plan.plan, Streamed))
        lost += sum(stream.unrecorded for stream in planned)
        if planned:
            found["plan_streams"] = [list(stream.record) for stream in planned]
    return found | ({"streams_lost": lost} if lost else {})


def _changes(controller: Controller) -> dict[str, Any]:
    try:
        changes = [
            plain_data(with_parts_replaced(change, Streamed, _as_recorded))
            for change in controller.changes
        ]
    except ConfigError as error:
        return {"changes": None, "changes_lost": str(error)}
    return {"changes": changes}


def _as_recorded(stream: Streamed) -> Streamed:
    return replace(stream, source=None, messages=stream.record)
