"""The names of tasks in a log: of two tasks of one name, each has its own columns."""

from collections.abc import Iterable, Mapping, Set
from typing import Any

from hsp_control.control.planned import PlannedTask
from hsp_control.tasks import Task


def task_meta(task: Task) -> dict[str, Any]:
    """Return the log's description of a task."""
    return {
        "type": type(task).__name__,
        "rows": task.rows,
        "error": [list(part) for part in task.error_parts],
        "drawn": list(task.drawn),
        "axes": getattr(task, "axes", None),
        "frame": getattr(task, "frame", None),
    }


class TaskNames:
    """The names of the tasks of a run in its log.

    While one task fades into another one of its name, the later one has a number. It
    reuses the columns of a task that is gone if they mean the same.

    Attributes:
        present: The names of the present tasks, by key.
    """

    def __init__(self) -> None:
        """Begin without a task."""
        self.present: Mapping[int, str] = {}
        self._meta: dict[str, dict[str, Any]] = {}  # of all, also of past ones

    def update(self, present: Iterable[PlannedTask]) -> Mapping[int, str]:
        """Return the names of the tasks that are present now, by key."""
        tasks = {each.key: each.task for each in present}
        names = {key: name for key, name in self.present.items() if key in tasks}
        for key, task in tasks.items():
            if key not in names:
                names[key] = self._new(task, {*names.values()})
        self.present = names
        return names

    def _new(self, task: Task, taken: Set[str]) -> str:
        meta = task_meta(task)
        name, k = task.name, 2
        while name in taken or self._meta.get(name, meta) != meta:
            name, k = f"{task.name}_{k}", k + 1
        self._meta[name] = meta
        return name
