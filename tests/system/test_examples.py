"""Every example runs unmodified in a copy of its folder, and the page shows it."""

import json
import re
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from page_runner import Running, Shell
from places import ROOT
from typing_commands import hsp, script, typed

from hsp_control import Rollout

EXAMPLES = ROOT / "examples"
PAGE = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
NEEDS = {
    "xacro_gripper.yaml": "xacro",
    "franka_arm.py": "pylibfranka",
    "gymnasium_pusher.py": "gymnasium",
}
SCRIPTS = sorted(each.name for each in EXAMPLES.glob("*.py"))
CONFIGURATIONS = sorted(each.name for each in EXAMPLES.glob("*.yaml"))


def lines_of(name: str) -> int:
    return len((EXAMPLES / name).read_text(encoding="utf-8").splitlines())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    copy = tmp_path / "examples"
    shutil.copytree(EXAMPLES, copy, ignore=shutil.ignore_patterns("out", "__pycache__"))
    return copy


def skip_without(name: str) -> None:
    if name in NEEDS and find_spec(NEEDS[name]) is None:
        pytest.skip(f"{name} needs {NEEDS[name]}")


@pytest.mark.parametrize("name", [each for each in SCRIPTS if "franka" not in each])
def test_a_script_runs(name: str, folder: Path) -> None:
    skip_without(name)
    assert script(name, folder)
    logs = sorted((folder / "out").glob("*.npz")) if (folder / "out").exists() else []
    for log in logs:
        run = Rollout.load(log)
        assert run.status == "completed"
        if run.t[-1] > 1.0:
            assert np.isfinite(run.tau).all()


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_a_configuration_runs(name: str, folder: Path) -> None:
    skip_without(name)
    assert "completed" in hsp(f"run {name}", folder)


def test_a_franka_s_box_is_moved(folder: Path) -> None:
    skip_without("franka_arm.py")
    host = "127.0.0.9"  # not another test's
    command = f"hsp franka-box panda_obstacle --lockstep --patience 60 --host {host}"
    with Shell(folder) as shell:
        box: Running = shell._start(command, "box")
        printed = typed([sys.executable, "franka_arm.py", host], folder)
        box.end()
    assert printed.startswith("completed")


def test_the_lesson_s_cells_run(folder: Path) -> None:
    cells = json.loads((folder / "lesson.ipynb").read_text())["cells"]
    assert not any(cell.get("outputs") for cell in cells)
    code = ["".join(each["source"]) for each in cells if each["cell_type"] == "code"]
    (folder / "lesson.py").write_text("\n".join(code))
    printed = script("lesson.py", folder)
    *_, slow, quick = printed.splitlines()
    for line in (slow, quick):
        _, measured, predicted = map(float, line.split())
        assert measured == pytest.approx(predicted, rel=0.02)


def test_examples_are_short_and_on_the_page() -> None:
    """Examples have 10 to 60 lines; the page shows all of them with a picture."""
    for name in [*SCRIPTS, *CONFIGURATIONS]:
        assert 10 <= lines_of(name) <= 65, name
        assert f"examples/{name})" in PAGE, name
    pictures = re.findall(r"figures/examples/([\w.]+)\)", PAGE)
    assert len(pictures) == len(set(pictures)) >= 20
    for picture in pictures:
        size = (ROOT / "docs" / "figures" / "examples" / picture).stat().st_size
        assert 1_000 < size < 45_000, picture
