"""What a run's table says in words, of numbers that are made up."""

from typing import Any

import numpy as np
import pytest

from hsp_control.cli import run_summary
from hsp_control.cli.run_summary import excess_rows, force_rows
from hsp_control.simulation.measures import ForceKept


class Log:
    """Columns and meta data, as of a `Rollout`."""

    def __init__(self, meta: dict[str, Any], **columns: Any) -> None:
        self.meta, self.columns = meta, columns
        self.t = columns["t"]

    def __getitem__(self, name: str) -> Any:
        return self.columns[name]


def test_the_worst_joint_its_unit_and_its_time_are_said() -> None:
    t = np.array([0.0, 0.5, 1.0, 1.5])
    position, velocity = np.zeros((2, 4, 3))
    position[1, 2], position[2, 1], velocity[2, 0] = 0.04, 0.02, 0.7
    meta = {"robot": {"dofs": ["a", "b", "c"], "units": ["rad", "rad", "m"]}}
    log: Any = Log(meta, t=t, position_excess=position, velocity_excess=velocity)
    first, second = excess_rows(log)
    assert first.startswith("c is 0.04 m beyond its position limit at 0.5 s (2 rows)")
    assert second.startswith("a is 0.7 rad/s beyond its speed limit at 1 s (1 rows)")


def test_what_became_of_a_force_is_its_root_mean_square(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wanted = np.full(4, 10.0)
    actual = np.array([10.0, 10.0, 10.0, 16.0])
    planned = np.array([10.0, 10.0, 7.0, 10.0])
    kept = ForceKept("pad", wanted, planned, actual, 3)
    monkeypatch.setattr(run_summary, "forces_kept", lambda _: [kept])
    log: Any = None
    assert list(force_rows(log)) == [
        ("force pad", "16 of 10 N at the end, missed by 3 N rms"),
        ("", "1 rows: planned up to 3 N off, for a limit or the balance"),
        ("", "3 rows: contact lost"),
    ]
