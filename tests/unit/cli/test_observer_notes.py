"""Notes of check and of a run's summary on the momentum observer and a load."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hsp_control.cli.main import main
from hsp_control.config import load_experiment
from hsp_control.simulation.run_summary import unexplained_rows

CONFIG: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {"hand": {"type": "frame_pose"}},
    "simulation": {"duration": 0.3, "control_period": 0.001},
}
LOAD: dict[str, Any] = {
    "type": "rigid_body",
    "payload": {"frame": "panda_tcp", "mass": 3.0},
}
SPRING = {"type": "frame_position", "impedance": {"stiffness": 600, "damping": 30}}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "off: the robot is its model"),
        ({"plant": LOAD}, "on, 50 1/s (auto)"),
        ({"plant": LOAD, "compensation": {"momentum_observer": None}}, "off"),
        ({"plant": LOAD, "compensation": {"momentum_observer": {"bandwidth": 20}}},
         "on, 20 1/s"),
        ({"plant": LOAD, "tasks": {"hand": SPRING}},
         "off: a hand with an impedance yields, task 'hand'"),
    ],
)  # fmt: skip
def test_check_reports_it(
    changes: dict[str, Any],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "held.yaml"
    path.write_text(yaml.safe_dump(CONFIG | changes), encoding="utf-8")
    assert main(["check", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["momentum_observer"] == words
    borne = found["wrong_model"]
    assert borne["growing"] <= borne["tried"] == 8
    assert len(borne["moved"][0]["resting"]) == 7


def test_a_run_reports_unexplained_efforts() -> None:
    """3 kg at the Panda's hand: 15 N·m on joint 4, a sixth of its limit."""
    heavy = load_experiment(CONFIG | {"plant": LOAD}).run()
    (row,) = unexplained_rows(heavy)
    assert row.startswith("up to ")
    assert row.endswith(" N·m that the model does not explain, on panda_joint4")
    beside = {**LOAD, "payload": {**LOAD["payload"], "center": [0.15, 0.0, 0.0]}}
    log = load_experiment(CONFIG | {"plant": beside}).run()
    _, reported, remedy = unexplained_rows(log)
    assert reported.startswith("the model does not describe the robot: that is ")
    assert "of the effort limit of panda_joint" in reported
    assert remedy == "the model has no rotors: robot: motor_inertia adds them"
    size = np.abs(log["observer.disturbance"]) / log.meta["limits"]["effort"]
    np.testing.assert_allclose(log["observer.share"], size.max(axis=1), rtol=1e-12)
    whole = {"robot": {"name": "panda", "motor_inertia": 0.05}, "plant": beside}
    assert len([*unexplained_rows(load_experiment(CONFIG | whole).run())]) == 2
    assert not [*unexplained_rows(load_experiment(CONFIG).run())]


def test_a_speed_beyond_its_limit_shows_that_the_model_is_wrong() -> None:
    log = load_experiment(CONFIG | {"plant": LOAD}).run()
    log.columns["velocity_excess"][5, 6] = 0.2 * log.meta["limits"]["velocity"][6]
    _, reported, remedy = unexplained_rows(log)
    assert "panda_joint7 is beyond a speed limit that it would keep" in reported
    assert "motor_inertia" in remedy


def test_a_safe_stop_keeps_an_observer_s_findings() -> None:
    """Every live run once printed "up to nan N·m", and never warned of a large load."""
    beside = {**LOAD, "payload": {**LOAD["payload"], "center": [0.15, 0.0, 0.0]}}
    log = load_experiment(CONFIG | {"plant": beside}).run()
    known = [*unexplained_rows(log)]
    assert len(known) == 3
    log.columns["observer.disturbance"][-1] = np.nan
    assert [*unexplained_rows(log)] == known
    log.columns["observer.disturbance"][:] = np.nan
    assert not [*unexplained_rows(log)]
