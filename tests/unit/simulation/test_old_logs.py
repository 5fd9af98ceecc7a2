"""Logs of version 0.1 have ``robot.freedoms`` instead of ``robot.dofs``; they load."""

from pathlib import Path

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


@pytest.fixture(scope="module")
def new() -> Rollout:
    return load_experiment(SMALL).run()


@pytest.fixture
def old(new: Rollout) -> Rollout:
    """A log as version 0.1 wrote it."""
    robot = dict(new.meta["robot"])
    robot["freedoms"] = robot.pop("dofs")
    return Rollout(new.columns, {**new.meta, "robot": robot})


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


@pytest.mark.parametrize("robot", [None, [], "freedoms", {"dofs": ["a"]}, {}])
def test_other_meta_data_is_not_changed(robot: object) -> None:
    meta = {"robot": robot, "freedoms": 3}
    assert renamed_entries(meta) == meta
    assert renamed_entries({}) == {}
    both = {"robot": {"dofs": ["new"], "freedoms": ["own"]}}
    assert renamed_entries(both) == both
