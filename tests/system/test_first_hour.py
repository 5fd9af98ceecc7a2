"""A newcomer's first steps, with the commands of README, tutorial and recipes."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

from hsp_control import Cost, Rollout
from hsp_control.cli import main
from hsp_control.common.resources import bundled_robots

pytestmark = pytest.mark.process

Capture = pytest.CaptureFixture[str]
SHORT = "--set simulation.duration=0.5"


def page(name: str, language: str) -> list[str]:
    """Return a page's blocks of code in a language."""
    text = (ROOT / name).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def command(name: str, begins: str) -> str:
    """Return the first command of a page with the given beginning."""
    lines = "".join(page(name, "sh")).replace("\\\n", " ").splitlines()
    return next(line for line in lines if line.startswith(begins)).split("#")[0]


def hsp(line: str, capsys: Capture) -> str:
    """Run a command, and return its output."""
    assert main(shlex.split(line.removeprefix("hsp "))) == 0, line
    return capsys.readouterr().out


def kept(printed: str, name: str) -> Rollout:
    """Rename the log of a run, and read it."""
    (path,) = re.findall(r"^Log: (.+)$", printed, re.MULTILINE)
    return Rollout.load(Path(path).rename(name))


@pytest.fixture(autouse=True)
def _in_a_folder_with_the_readme_s_yaml(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Cost.family, "members", dict(Cost.family.members))
    (readme,) = page("README.md", "yaml")
    Path("mine.yaml").write_text(readme)


def test_a_gain_is_changed_and_the_runs_are_compared(capsys: Capture) -> None:
    changed = command("README.md", "hsp run mine.yaml --set")
    slow = kept(hsp(f"hsp run mine.yaml {SHORT}", capsys), "slow.npz")
    quick = kept(hsp(f"{changed} {SHORT}", capsys), "quick.npz")
    at = slow.t == 0.1
    for run, gain in ((slow, 8.0), (quick, 20.0)):
        decay = run["null_space_norm"] / run["null_space_norm"][0]
        np.testing.assert_allclose(
            decay[at], np.exp(-gain * 0.1), rtol=0.03
        )  # (1 - K_N h)^100
    hsp("hsp plot slow.npz --out figures", capsys)
    hsp("hsp export slow.npz quick.npz --html both.html", capsys)
    assert list(Path("figures").glob("*.png"))
    assert Path("both.html").stat().st_size > 100_000


def test_a_user_s_urdf(capsys: Capture) -> None:
    urdf = bundled_robots()["planar3r"] / "planar3r.urdf"
    Path("arm.urdf").write_text(urdf.read_text())
    printed = hsp(command("docs/own_robot.md", "hsp inspect arm.urdf"), capsys)
    (advice,) = re.findall(r"start: auto", printed)
    text = Path("mine.yaml").read_text().replace("name: panda", "name: arm.urdf")
    text = text.replace("type: frame_pose", "type: frame_position, axes: xy")
    text = text.replace("type: joint_centering", "type: target_posture")  # no limits
    Path("mine.yaml").write_text(f"{text}\n{advice}\n")
    assert np.abs(kept(hsp("hsp run mine.yaml", capsys), "arm.npz").q).max() > 0.0


def test_a_user_s_cost_from_python_and_from_yaml(capsys: Capture) -> None:
    recipe = "docs/how_to/own_cost.md"
    python = page(recipe, "python")[0]
    space: dict = {}
    exec(compile(python, recipe, "exec"), space)
    assert space["elbow"].weight == 20.0
    function = re.search(r"^def .*?\n\n", python, re.MULTILINE | re.DOTALL)
    assert function is not None
    Path("my_costs.py").write_text(function[0])
    text = (ROOT / recipe).read_text(encoding="utf-8")
    line, declared = re.findall(r"`(hsp run [^`]+|\{type: function_cost[^`]+)`", text)
    text = Path("mine.yaml").read_text()
    text = text.replace("{type: joint_centering, weight: 2}", declared)
    Path("mine.yaml").write_text(text)
    run = kept(hsp(f"{line} {SHORT}", capsys), "elbow.npz")
    start = space["robot"].state(0.0, run.q[0], run.v[0])
    value = 20.0 * space["elbow_at_its_height"](start)
    np.testing.assert_allclose(run["field.value"][0], value, rtol=1e-12)


def test_another_metric_and_no_limits(capsys: Capture) -> None:
    Path("metric.yaml").write_text(page("docs/how_to/metric.md", "yaml")[0])
    hsp("hsp run metric.yaml", capsys)
    free = kept(hsp("hsp run mine.yaml --set limits=none", capsys), "free.npz")
    limited = kept(hsp("hsp run mine.yaml", capsys), "limited.npz")
    np.testing.assert_array_equal(free.q, limited.q)  # none of them is active
