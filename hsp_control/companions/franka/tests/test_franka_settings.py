"""Settings behind franka://, and the messages of the arm's errors."""

from pathlib import Path

import numpy as np
import pytest

from hsp_control.cli import main
from hsp_control.common.errors import LiveError
from hsp_control.companions.franka import FrankaSettings, Load
from hsp_control.companions.franka.reflexes import MODES, REFLEXES, explained

pylibfranka = pytest.importorskip("pylibfranka")


def test_text_and_file_equal_the_settings_in_python(tmp_path: Path) -> None:
    wanted = FrankaSettings(
        "172.16.0.2",
        realtime="ignore",
        load=Load(0.4, center=[0.0, 0.0, 0.05]),
        cutoff_frequency=100.0,
    )
    text = "?realtime=ignore&load.mass=0.4&load.center=[0, 0, 0.05]"
    assert FrankaSettings.parse(f"172.16.0.2{text}&cutoff_frequency=100.0") == wanted
    file = tmp_path / "lab.yaml"
    file.write_text(
        "address: 172.16.0.2\nrealtime: enforce\ncutoff_frequency: 100.0\n"
        "load: {mass: 0.4, center: [0, 0, 0.05]}\n"
    )
    assert FrankaSettings.parse(f"{file}?realtime=ignore") == wanted
    assert FrankaSettings.parse("a?cutoff_frequency=1.0e+2").cutoff_frequency == 100.0


@pytest.mark.parametrize(("text", "match"), [
    ("a?realtme=ignore", r"franka://a.*argument 'realtme'; did you mean 'realt"),
    ("a?realtime=maybe", "realtime: unknown value 'maybe'"),
    ("a?recover=3", "recover: "),
    ("a?realtime=ignore&realtime=enforce", "the option 'realtime' is given twice"),
    ("a?realtime", "needs options KEY=VALUE"),
    ("a?load.mass=-1", "load.mass: -1 is negative"),
    ("a?load.mas=1", r"load.*'mas'; did you mean 'mass'"),
    ("a?load.mass=1&load.inertia=[[a,0,0],[0,1,0],[0,0,1]]", "load.inertia"),
    ("a?load=1&load.mass=1", "load is 1, not a mapping"),
    ("a?collision_torque=[1, 2]", "collision_torque"),
    ("a?cutoff_frequency=[", "cutoff_frequency=.*flow"),
    ("?realtime=ignore", "address"),
    ("no_such_lab.yaml", "no_such_lab.yaml: No such file"),
])  # fmt: skip
def test_a_mistake_is_named(text: str, match: str) -> None:
    with pytest.raises(LiveError, match=match):
        FrankaSettings.parse(text)


def test_a_load_is_a_body() -> None:
    with pytest.raises(LiveError, match="not symmetric"):
        Load(1.0, inertia=[[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(LiveError, match="add up to the largest"):
        Load(1.0, inertia=np.diag([1.0, 1.0, 3.0]))
    Load(1.0, inertia=np.diag([1.0, 1.0, 2.0]))
    with pytest.raises(LiveError, match=r"1e\+30 m from the flange along an axis"):
        Load(1.0, center=[0.0, 1e30, 0.0])


def test_every_error_and_mode_of_libfranka_is_explained() -> None:
    errors = {name for name in dir(pylibfranka.Errors) if not name.startswith("_")}
    assert set(REFLEXES) == errors
    modes = {mode.name for mode in pylibfranka.RobotMode.__members__.values()}
    assert set(MODES) == modes - {"Idle"}


def test_an_exception_is_reported_with_its_names() -> None:
    text = (
        "libfranka: Move command aborted: motion aborted by reflex! "
        '["joint_reflex", "power_limit_violation"]\n'
        "control_command_success_rate: 0.97 packets lost in a row in the last sample: 2"
    )
    reported = explained("ControlException", text)
    parts = "joint_reflex: ", "collision_torque", "power_limit_violation: ", "0.97"
    assert all(part in reported for part in parts)
    flag = 'motion aborted by reflex! ["tau_J_range_violation_flag"]'
    assert explained("ControlException", flag).startswith("tau_j_range_violation: a ")
    stopped = "libfranka: Move command aborted: User Stop pressed!"
    assert "stop button was pressed" in explained("ControlException", stopped)
    other = explained("ValueError", "something new\nand more")
    assert other == "ValueError: something new; and more"


def test_a_missing_address_is_reported(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["live", "panda_obstacle", "--robot", "franka"]) == 2
    assert "mean franka://ADDRESS?" in capsys.readouterr().err
