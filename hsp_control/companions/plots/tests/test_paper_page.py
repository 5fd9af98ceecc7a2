"""docs/paper.md and its pictures: every number and every frame is from a run."""

import importlib.util
import re
from types import ModuleType

import numpy as np
import pytest
from places import ROOT

from hsp_control import Rollout, load_experiment
from hsp_control.common.arrays import Array
from hsp_control.companions.plots.log_series import joint_positions
from hsp_control.config import Experiment

DOCS = ROOT / "docs"
FIGURES = (2, 3, 4, 5)
UNITS = {"": 1.0, "m": 1.0, "s": 1.0, "rad": 1.0, "rad/s": 1.0, "kN·m": 1e3}


def load_drawing() -> ModuleType:
    """Return docs/make_figures.py, which is a script beside the documents."""
    path = DOCS / "make_figures.py"
    spec = importlib.util.spec_from_file_location("make_figures", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


drawing = load_drawing()
PAPER = {one.number: one for one in drawing.PAPER}


@pytest.fixture(scope="module")
def runs() -> dict[int, Rollout]:
    return {n: load_experiment(PAPER[n].configuration).run() for n in FIGURES}


# ------------------------------------------------------------------------ the numbers


def angles(rollout: Rollout) -> Array:
    """Return absolute angles, as in the paper's panels (b), shape (N, 3)."""
    theta, what = joint_positions(rollout)
    assert what == "absolute joint angle"
    return theta


def drift(rollout: Rollout) -> float:
    """Return the largest change of an angle per revolution, without the first one."""
    theta = angles(rollout)
    turns = drawing.TURN * np.arange(1, 5)
    at = [[np.interp(t, rollout.t, theta[:, k]) for k in range(3)] for t in turns]
    return float(np.abs(np.diff(at, axis=0)).max())


def joint_distance(rollout: Rollout) -> float:
    """Return the smallest distance of joints two and three to the disk's centre [m]."""
    away = rollout["skeleton"][:, 1:3] - rollout["obstacle.disk"][:, None]
    return float(np.linalg.norm(away, axis=2).min())


def link_distance(rollout: Rollout) -> float:
    """Return the smallest distance of the links to the disk's centre [m]."""
    points, center = rollout["skeleton"], rollout["obstacle.disk"][:, None]
    link = np.diff(points, axis=1)
    from_root = center - points[:, :-1]
    share = np.clip((from_root * link).sum(axis=2) / (link**2).sum(axis=2), 0.0, 1.0)
    away = from_root - share[..., None] * link
    return float(np.linalg.norm(away, axis=2).min())


def without_the_disk() -> Experiment:
    fields = "[{type: equal_joint_angles, joints: [joint2, joint3], weight: 5}]"
    return load_experiment(PAPER[5].configuration, f"null_space.fields={fields}")


def farthest_apart(here: Rollout) -> float:
    """Return the final distance of two runs of (1) that start 1e-9 rad apart [rad]."""
    there = load_experiment(PAPER[2].configuration)
    there.q0[:] = there.robot.integrate(there.q0, np.array([1e-9, 0.0, 0.0]))
    return float(np.abs(angles(there.run()) - angles(here)).max())


def log_channels(number: int, run: Rollout) -> dict[str, float]:
    """Return the numbers that the page may quote of a run, in SI units."""
    det, late = run["manipulability"], run.t >= 5.0
    found = {
        "largest tracking error from 5 s on": np.abs(run["task.tip.error"][late]).max(),
        "largest angle of link 1": np.abs(angles(run)[:, 0]).max(),
        "largest angle of link 3": np.abs(angles(run)[:, 2]).max(),
        "largest self-motion from 5 s on": run["null_space_norm"][late].max(),
        "largest ‖e_N‖": run["null_space_norm"].max(),
        "‖e_N‖ at the end": run["null_space_norm"][-1],
        "smallest det(J Jᵀ)": det.min(),
        "time of the smallest": run.t[det.argmin()],
        "largest effort": np.abs(run.tau).max(),
        "largest drift of an angle from one turn to the next": drift(run),
    }
    if number == 2:
        found["largest distance of two runs whose starts differ by 1e-9 rad"] = (
            farthest_apart(run)
        )
    if number == 5:
        found["smallest distance of a joint from the disk's centre"] = joint_distance(
            run
        )
        found["smallest distance of a link from the disk's centre"] = link_distance(run)
        bare = joint_distance(without_the_disk().run())
        found["the same without 1/d₂² + 1/d₃²"] = bare
    return {name: float(value) for name, value in found.items()}


def table(number: int) -> dict[str, str]:
    """Return the rows of the table under a figure's heading, label to value."""
    page = (DOCS / "paper.md").read_text(encoding="utf-8")
    (section,) = re.findall(rf"^## Figure {number}:(.*?)(?=^## |\Z)", page, re.M | re.S)
    rows = re.findall(r"^\| (.+?) \| (.+?) \|$", section, re.M)
    return {label: value for label, value in rows if label != "quantity"}


def agrees(printed: str, measured: float) -> bool:
    """Return whether a printed bound holds, or a printed number is the measured one."""
    bound, digits, unit = re.fullmatch(r"([<>]?) ?([\d.e-]+) ?(\S*)", printed).groups()
    value = float(digits) * UNITS[unit]
    if bound:
        return measured < value if bound == "<" else measured > value
    last_place = 10.0 ** -len(digits.partition(".")[2]) * UNITS[unit]
    return abs(measured - value) <= 0.5000001 * last_place


@pytest.mark.parametrize("number", FIGURES)
def test_every_number_of_the_page_comes_from_a_run(
    number: int, runs: dict[int, Rollout]
) -> None:
    printed, measured = table(number), log_channels(number, runs[number])
    assert len(printed) >= 4
    for label, value in printed.items():
        assert agrees(value, measured[label]), f"{label}: {value}, {measured[label]:g}"
