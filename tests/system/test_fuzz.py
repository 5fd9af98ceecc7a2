"""Small samples of the campaigns, which ``make fuzz`` runs in full."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
from campaigns import faults, frozen, random_states
from campaigns.cases import KINDS, count_cases
from campaigns.soak import PROCESS_GROWTH, PYTHON_GROWTH, soak
from campaigns.worker import Worker
from places import THOROUGH

from hsp_control.common.resources import bundled_robots
from hsp_control.simulation import Rollout

pytestmark = pytest.mark.process

SEED = 2
"""A seed other than the campaigns', for other cases."""
DRAWN = 3000 if THOROUGH else 1000
"""Random states of a frozen controller, in runs of 1000."""


@pytest.mark.parametrize("robot", bundled_robots())
def test_random_states(robot: str) -> None:
    for tally in random_states.bundled(robot, SEED, 2000):
        assert tally.good, tally.examples
    assert tally.steps == 2000
    assert tally.limited > 0
    assert tally.damped > 0
    assert tally.status[2] > 0  # limits were active


@pytest.mark.parametrize(
    ("config", "compensators"),
    [
        ("panda_limits", ()),
        ("panda_limits", tuple(frozen.COMPENSATORS)),
        ("whole_body/solo12_trunk", ()),
    ],
)
def test_frozen_controllers(config: str, compensators: tuple[str, ...]) -> None:
    for tally in frozen.compared(
        config, DRAWN, 0.2, SEED, compensators=bool(compensators)
    ):
        assert not tally.different
    assert {*tally.compensators} == {*compensators}
    assert (tally.run, tally.drawn) == (201, DRAWN)
    assert sum(tally.status.values()) > DRAWN


@pytest.mark.parametrize(
    ("kind", "cases"), [("yaml", 30 if THOROUGH else 5), ("urdf", 5)]
)
def test_mutated_files(kind: str, cases: int) -> None:
    count = count_cases(KINDS[kind], SEED, cases)
    assert count.good, "\n".join(count.examples)
    assert count.kinds["refused"] > 0


def test_crashes_and_hangs_are_noticed() -> None:
    """The harness detects every kind of failure, and continues."""
    with Worker("campaigns.crash_case:case", 1.0) as worker:
        assert worker.ask(0, 3).kind == "fine"  # the first has a minute more
        kinds = [worker.ask(0, index).kind for index in (1, 0, 2, 3)]
    assert kinds == ["hang", "crash", "crash", "fine"]


def test_memory_stays_flat() -> None:
    """Four seconds at 1 kHz, after a warm-up of one."""
    found = soak(5.0, 4)
    python, process = found.growth
    assert found.steps == 5000
    assert python < PYTHON_GROWTH / 10
    assert process < PROCESS_GROWTH
    assert found.worst_error < 1e-2


# --- faults --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run() -> Rollout:
    return faults.short_run(0.3)


@pytest.fixture(scope="module")
def log(run: Rollout, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run.save(tmp_path_factory.mktemp("log") / "whole.npz")


def sample(count: int, once: Callable[[Random, Path], faults.Faults]) -> set[str]:
    """Inject faults, and return their outcomes, all good."""
    outcomes: set[str] = set()
    for k in range(count):
        with tempfile.TemporaryDirectory() as folder:
            found = once(Random(k), Path(folder))
        assert found.good, found.wrong
        outcomes |= set(found.outcomes)
    return outcomes


def test_a_disk_that_fills(run: Rollout, log: Path) -> None:
    size = log.stat().st_size
    sample(30, lambda r, f: faults.full_disk(run, size, r, f))


def test_ctrl_c_at_any_moment(log: Path) -> None:
    sample(3 if THOROUGH else 2, lambda r, f: faults.interrupted(r, f, log, 6.0))


def test_a_run_that_cannot_be_saved_is_saved_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from hsp_control.cli import main

    (tmp_path / "out").mkdir()
    name = "2_rest-simulation.duration=0.02.npz"
    (tmp_path / "out" / f".{name}.part").symlink_to("/dev/full")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    short = ["--set", "simulation.duration=0.02"]
    command = ["run", "paper/2_rest", "--out", str(tmp_path / "out"), *short]
    assert main(command) == 2
    captured = capsys.readouterr()
    assert "No space left on device; the log is saved elsewhere" in captured.err
    (elsewhere,) = tmp_path.glob(f"hsp-*/{name}")
    assert f"Log: {elsewhere}" in captured.out
    assert len(Rollout.load(elsewhere)) == 3
