"""Invalid file names give one message."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.errors import HspControlError
from hsp_control.simulation.journal import JournalReader, JournalWriter

NAMES = {"long": "x" * 300, "huge": "x" * 1_000_000, "nul": "a\0b"}
USES: dict[str, Callable[[str], object]] = {
    "load": lambda name: hsp.Rollout.load(f"{name}.npz"),
    "save": lambda name: hsp.Rollout({"t": np.zeros(1)}, {}).save(f"{name}.npz"),
    "write": lambda name: JournalWriter(Path(name)),
    "read": lambda name: JournalReader(Path(name)).read(),
    "robot": lambda name: hsp.Robot.load(f"{name}.urdf"),
    "any robot": hsp.Robot.load,
    "configuration": hsp.load_experiment,
    "yaml": lambda name: hsp.load_experiment(f"{name}.yaml"),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("use", USES)
def test_a_name_that_no_file_can_have(
    use: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HspControlError):
        USES[use](NAMES[name])
    assert not list(tmp_path.iterdir())
