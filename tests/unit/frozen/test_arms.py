"""The drivers for arms compile and stop, with declarations instead of vendor
headers."""

import subprocess
from pathlib import Path

import pytest
from frozen_runs import EXAMPLE, compiled
from places import further

import hsp_control as hsp

DECLARED = Path(__file__).parent / "declarations"


@pytest.fixture
def frozen(tmp_path: Path) -> Path:
    controller = hsp.load_experiment("panda_limits").controller
    return hsp.freeze(controller, tmp_path / "panda.hsp")


def declared(folder: Path, stands_for: str, headers: list[str]) -> list[str]:
    """Return the flags that replace the vendor's headers by ours."""
    for each in headers:
        header = folder / "include" / each
        header.parent.mkdir(parents=True, exist_ok=True)
        header.write_text(f'#include "{DECLARED / stands_for}"\n')
    return ["-std=c++20", f"-I{folder / 'include'}"]


def test_libfranka_s_callback_brakes_and_ends(frozen: Path, tmp_path: Path) -> None:
    names = ("duration", "exception", "model", "robot")
    flags = declared(tmp_path, "franka.hpp", [f"franka/{each}.h" for each in names])
    program = compiled(EXAMPLE / "franka.cpp", tmp_path, *flags, language="c++")
    command = [program, "host", frozen, "3"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # The fourth state is refused; the arm is at rest, so it holds in the next one.
    assert (done.returncode, done.stdout) == (1, "4\n")
    assert "t, q or v is not finite" in done.stderr


@pytest.mark.parametrize("release", ["LATER", *further("HUMBLE")])
def test_a_controller_of_ros2_control_brakes(
    release: str, frozen: Path, tmp_path: Path
) -> None:
    headers = [
        "controller_interface/controller_interface.hpp",
        "pluginlib/class_list_macros.hpp",
    ]
    flags = declared(tmp_path, "ros2_control.hpp", headers)
    flags += [f"-D{release}", f"-I{EXAMPLE}"]
    source = DECLARED / "run_controller.cpp"
    program = compiled(source, tmp_path, *flags, language="c++")
    done = subprocess.run([program, frozen], capture_output=True, text=True, check=True)
    names, *rows = done.stdout.splitlines()
    assert names.split() == [
        f"{joint}/{each}" for each in ("position", "velocity") for joint in range(1, 8)
    ]
    went, effort = zip(*(map(float, row.split()) for row in rows), strict=True)
    assert effort[20] == effort[19]  # the last one
    assert effort[21] != effort[20]  # the effort of the stop
    assert len({*effort[21:30]}) == 1  # holds a robot at rest
    # Without a state: the last effort for five periods, then the manager is informed.
    assert [k for k, ok in enumerate(went) if not ok] == [*range(35, 40)]
