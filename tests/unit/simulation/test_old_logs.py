"""Logs of version 0.1 load, are drawn and run again.

They have ``robot.freedoms`` instead of ``robot.dofs``, the class of a task instead of
what its error consists of, and a configuration with the keys of that version.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsp_control import Rollout, load_experiment
from hsp_control.simulation.journal import JournalWriter
from hsp_control.simulation.log_meta import renamed_entries
from hsp_control.simulation.log_series import joint_names

SMALL = {
    "robot": {"name": "planar3r"},
    "tasks": {
        "tip": {"type": "frame_position", "axes": "xy", "trajectory": {"type": "hold"}}
    },
    "simulation": {"duration": 0.1},
}


EVERY: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {
        "position": {"type": "frame_position", "axes": "xz", "priority": 2},
        "orientation": {"type": "frame_orientation", "priority": 3},
        "pose": {"type": "frame_pose", "priority": 4},
        "pointing": {"type": "pointing", "direction": [0, 0, -1], "priority": 5},
        "mass": {"type": "center_of_mass", "axes": "xy", "priority": 6},
        "posture": {"type": "joint_posture", "joints": ["panda_joint1"], "priority": 7},
        "relative": {"type": "relative_pose", "reference": "panda_link4",
                     "priority": 8},
        "momentum": {"type": "angular_momentum", "priority": 9,
                     "trajectory": {"type": "hold", "point": [0, 0, 0]}},
    },
    "simulation": {"duration": 0.01},
}  # fmt: skip
"""A task of each type."""


@pytest.fixture(scope="module")
def new() -> Rollout:
    return load_experiment(SMALL).run()


@pytest.fixture
def old(new: Rollout) -> Rollout:
    """A log as version 0.1 wrote it."""
    robot = dict(new.meta["robot"])
    robot["freedoms"] = robot.pop("dofs")
    tasks = {name: older(task) for name, task in new.meta["tasks"].items()}
    return Rollout(new.columns, {**new.meta, "robot": robot, "tasks": tasks})


def older(task: dict[str, Any]) -> dict[str, Any]:
    """Return the meta data of a task as version 0.1 wrote it."""
    return {key: each for key, each in task.items() if key not in ("error", "drawn")}


def check(read: Rollout, new: Rollout) -> None:
    assert read.meta["robot"] == new.meta["robot"]
    assert "freedoms" not in read.meta["robot"]
    assert joint_names(read) == ["joint1", "joint2", "joint3"]


def test_an_old_log_is_loaded(new: Rollout, old: Rollout, tmp_path: Path) -> None:
    read = Rollout.load(old.save(tmp_path / "old.npz"))
    assert read.meta == new.meta
    check(read, new)


def test_an_old_truncated_log_is_salvaged(
    new: Rollout, old: Rollout, tmp_path: Path
) -> None:
    path = old.save(tmp_path / "old.npz")
    path.write_bytes(path.read_bytes()[:-3000])
    read = Rollout.salvage(path)
    assert read.meta["lost"]
    check(read, new)


@pytest.mark.parametrize("truncated", [False, True])
def test_an_old_journal_is_loaded(
    truncated: bool, new: Rollout, old: Rollout, tmp_path: Path
) -> None:
    path = tmp_path / "old.journal"
    journal = JournalWriter(path)
    journal.write_heading(old.columns, old.meta)
    for i in range(len(old)):
        journal.write_row({name: a[i : i + 1] for name, a in old.columns.items()})
    journal.write_end("completed", "")
    journal.close()
    if truncated:
        path.write_bytes(path.read_bytes()[:-100])
    read = Rollout.load(path)
    assert read.status == ("interrupted" if truncated else "completed")
    check(read, new)
    check(Rollout.load(read.save(tmp_path / "again.npz")), new)


def test_the_error_of_every_task_is_known_from_its_class() -> None:
    tasks = load_experiment(EVERY).run().meta["tasks"]
    assert len(tasks) == 8
    old = {name: older(task) for name, task in tasks.items()}
    assert old != tasks
    assert renamed_entries({"tasks": old})["tasks"] == tasks


def test_a_task_of_another_class_stays_as_it_is() -> None:
    tasks = {"mine": {"type": "MyTask", "rows": 3}, "odd": {"type": "FramePosition"}}
    assert renamed_entries({"tasks": tasks})["tasks"] == tasks


def test_an_old_log_is_run_again(new: Rollout, old: Rollout, tmp_path: Path) -> None:
    """Its configuration holds every key, null where there was nothing."""
    config = json.loads(json.dumps(new.config))
    config["tasks"]["tip"] |= {"schedule": None, "blend": None, "priority": 1}
    config |= {"limits": None, "contacts": {}, "base": None}
    del config["changes"]
    old.meta["config"] = config
    again = load_experiment(old.save(tmp_path / "old.npz")).run()
    np.testing.assert_array_equal(again.tau, new.tau)


@pytest.mark.parametrize("robot", [None, [], "freedoms", {"dofs": ["a"]}, {}])
def test_other_meta_data_is_not_changed(robot: object) -> None:
    meta = {"robot": robot, "freedoms": 3}
    assert renamed_entries(meta) == meta
    assert renamed_entries({}) == {}
    both = {"robot": {"dofs": ["new"], "freedoms": ["own"]}}
    assert renamed_entries(both) == both
