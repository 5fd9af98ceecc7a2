"""The active impedance follows the planned one as fast as its damping permits."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from spring_energy import next_numbers

import hsp_control as hsp
from hsp_control.control.followed_impedance import FollowedImpedance
from hsp_control.tasks.feedback import ErrorPart

H = 0.001
PARTS = (
    ErrorPart("position", "m", "m/s", 3),
    ErrorPart("orientation", "rad", "rad/s", 3),
)
ENDS = np.array([3, 6])


def springs(rng: np.random.Generator, damping: str) -> np.ndarray:
    """Return the matrices of an impedance with rotated axes."""

    def turned(most: float) -> Any:
        turn = np.linalg.qr(rng.normal(size=(6, 6)))[0]
        matrix = (turn * rng.uniform(0.1 * most, most, 6)) @ turn.T
        return (0.5 * (matrix + matrix.T)).tolist()

    given: dict[str, Any] = {"largest_force": [40.0, 5.0]}
    given[damping] = 0.8 if damping == "damping_ratio" else turned(60.0)
    return hsp.Impedance(turned(800.0), **given).numbers(PARTS)


@pytest.mark.parametrize("damping", ["damping", "damping_ratio"])
@pytest.mark.parametrize("speed", [0.0, 0.02, 1.0])
@pytest.mark.parametrize("away", [0.01, 0.5])  # within the largest force, and beyond
def test_as_in_plain_numpy(damping: str, speed: float, away: float) -> None:
    outcomes = set()
    for seed in range(20):
        rng = np.random.default_rng(seed)
        now, target = springs(rng, damping), springs(rng, damping)
        share = rng.choice([0.0, 0.1])  # whether it has waited
        planned, then = now + share * (target - now), now + 0.2 * (target - now)
        root = rng.normal(size=(6, 6))
        e, e_dot = away * rng.normal(size=6), speed * rng.normal(size=6)
        in_force: Any = SimpleNamespace(numbers=now.copy(), mobility=root @ root.T)
        followed = FollowedImpedance(in_force, ENDS)
        followed.ramp[0] = 0.05
        expected, waits = next_numbers(
            now, planned, then, ENDS, in_force.mobility, e, e_dot, 0.05, H
        )
        outcomes.add(followed.move(planned, then, e, e_dot, H))
        assert bool(followed.waits[0]) is waits
        np.testing.assert_allclose(followed.numbers, expected, rtol=1e-9, atol=1e-9)
    if speed == 0.0:
        assert True in outcomes
