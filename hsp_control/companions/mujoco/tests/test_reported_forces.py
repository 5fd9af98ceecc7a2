"""Notes on commanded forces before a run, and after it."""

import re
from pathlib import Path

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli.main import main


def forced(config: str, contact: str, newtons: object) -> list[str]:
    """Return the options of a configuration with another commanded force."""
    ramp = f"{{type: force, contact: {contact}, at: 0, ramp: 0.5, force: {{value: "
    return [f"forces/{config}", "--set", f"changes=[{ramp}{newtons}}}}}]"]


def test_a_wipe_that_loses_contact_is_reported_before_and_after_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fast = ["--set", "tasks.path.trajectory.angular_rate=3"]
    short = ["--set", "simulation.duration=2", "--out", str(tmp_path)]
    short += ["--set", "simulation.log_period=0.001"]
    assert main(["run", *forced("panda_wipe", "wiper", 5), *fast, *short]) == 0
    reported = capsys.readouterr()
    assert (
        "it slides at 0.34 m/s, and the plant's surface pushes it off b" in reported.err
    )
    assert re.search(r"force wiper .* N at the end, missed by [2-9]\.", reported.out)
    assert re.search(r"\n +\d+ rows: contact lost", reported.out)
    (log,) = tmp_path.glob("*.npz")
    planned = hsp.Rollout.load(log)["contact.wiper.force"]
    # also in the step in which the change of the force ends
    assert np.linalg.norm(planned[1:], axis=1).min() > 0.0


@pytest.mark.parametrize(
    ("newtons", "had"), [(60, None), (150, r"at most 85\.\d of 150 N")]
)
def test_check_reports_a_force_that_soles_cannot_balance(
    newtons: float, had: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the centre of mass as at the start; a run at 150 N ends with 114 N."""
    command = forced("talos_wall", "hand", f"[0, 0, {newtons}]")
    assert main(["check", *command]) == 0
    warned = capsys.readouterr().err
    assert re.search(had, warned) if had else not warned
