"""Physically impossible inertias, and their projection to possible ones."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from robot_texts import ARM, INERTIA
from scipy.optimize import minimize
from wording import wording

from hsp_control import Robot
from hsp_control.robot.description.inertias import (
    FLOOR,
    impossible_inertias,
    is_possible,
    nearest_possible,
    project_inertias,
)

SEEDS = range(30)


def second_moments(tensor: np.ndarray) -> np.ndarray:
    """Return Σ = ½ tr(I) 1 - I, shape (3, 3)."""
    return 0.5 * np.trace(tensor) * np.eye(3) - tensor


def of_no_body(seed: int) -> np.ndarray:
    """Return a symmetric matrix that violates the triangle inequality."""
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    low, middle = rng.uniform(-0.1, 1.0, 2)
    high = low + middle + rng.uniform(0.05, 2.0)
    return axes @ np.diag([low, middle, high]) @ axes.T


@pytest.mark.parametrize("seed", SEEDS)
def test_projection_is_of_a_body_symmetric_and_idempotent(seed: int) -> None:
    tensor = of_no_body(seed)
    assert not is_possible(tensor)
    projected = nearest_possible(tensor)
    np.testing.assert_array_equal(projected, projected.T)
    moments = np.linalg.eigvalsh(second_moments(projected))
    assert moments[0] >= FLOOR * moments.sum() * (1.0 - 1e-9)
    assert nearest_possible(projected) is projected
    np.testing.assert_allclose(  # the axes are unchanged
        projected @ tensor, tensor @ projected, atol=1e-14 * np.abs(tensor).max()
    )


@pytest.mark.parametrize("seed", range(5))
def test_projection_is_nearest_in_the_pseudo_inertia(seed: int) -> None:
    """No other mass, centre of mass and second moments are nearer: by general
    search."""
    tensor, mass = of_no_body(seed), 0.7
    wrong = np.zeros((4, 4))
    wrong[:3, :3], wrong[3, 3] = second_moments(tensor), mass
    right = wrong.copy()
    right[:3, :3] = second_moments(nearest_possible(tensor))

    def distance(lower: np.ndarray) -> float:
        """To L Lᵀ + FLOOR/(1 - 3 FLOOR) tr(S) 1 in the block S of the moments."""
        root = np.zeros((4, 4))
        root[np.tril_indices(4)] = lower
        body = root @ root.T
        share = FLOOR / (1.0 - 3.0 * FLOOR)
        body[:3, :3] += share * np.trace(body[:3, :3]) * np.eye(3)
        return float(np.linalg.norm(body - wrong))

    start = np.eye(4)[np.tril_indices(4)]
    found = minimize(distance, start, method="BFGS", options={"gtol": 1e-9})
    assert np.linalg.norm(right - wrong) <= found.fun + 1e-9
    assert found.fun < np.linalg.norm(right - wrong) + 1e-3  # the search came near


HEAVY = INERTIA.replace('izz="0.1"', 'izz="0.5"')


def write(folder: Path, inertia: str) -> Path:
    path = folder / "arm.urdf"
    path.write_text(ARM.replace(INERTIA, inertia, 1))
    return path


def test_links_are_named_with_the_reason() -> None:
    robot = ElementTree.fromstring(ARM.replace(INERTIA, HEAVY, 1))
    (found,) = impossible_inertias(robot)
    assert found.link == "upper"
    assert re.search(wording("... moment 0.5 ... 0.1 + 0.1 = 0.2 kg·m²"), found.reason)
    project_inertias(robot)
    assert not list(impossible_inertias(robot))


def test_a_robot_is_loaded_with_projected_inertias(tmp_path: Path) -> None:
    path = write(tmp_path, HEAVY)
    requested, not_asked = Robot.load(path, project_inertias=True), Robot.load(path)
    changed, given = requested.model.inertias[1], not_asked.model.inertias[1]
    assert changed.mass == given.mass == 2.0
    np.testing.assert_array_equal(changed.lever, given.lever)
    np.testing.assert_allclose(given.inertia, np.diag([0.1, 0.1, 0.5]))
    np.testing.assert_allclose(
        changed.inertia, nearest_possible(np.diag([0.1, 0.1, 0.5])), rtol=1e-14
    )
    assert requested.model.inertias[2] == not_asked.model.inertias[2]
