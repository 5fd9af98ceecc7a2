"""A Panda's controllers and states, and all of a controller's output."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from loaded_robots import panda

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.trajectories import HoldOrientation

GAINS = hsp.Gains(natural_frequency=20.0)
TCP = "panda_tcp"
CENTER = np.array([0.35, 0.1, 0.5])
# Below every singular value of the random states: the law is exact there.
EXACT = 1e-4

METRICS: dict[str, Callable[[int], hsp.metrics.Metric]] = {
    "identity": lambda nv: hsp.metrics.IdentityMetric(),
    "coordinates": lambda nv: hsp.metrics.CoordinatesMetric(np.tril(np.ones((nv, nv)))),
    "mass_matrix": lambda nv: hsp.metrics.MassMatrixMetric(),
}
metrics = pytest.mark.parametrize("kind", METRICS)


def circle() -> hsp.Circle:
    return hsp.Circle(0.1, 2.0, CENTER, normal=[0.0, 1.0, 1.0])


def track(**options: Any) -> hsp.FramePosition:
    """Return a task that is far from its path, with linear feedback."""
    options = {"largest_error": "none", **options}
    return hsp.FramePosition(TCP, circle(), gains=GAINS, **options)


def hold_orientation() -> hsp.FrameOrientation:
    upright = HoldOrientation(np.eye(3))
    return hsp.FrameOrientation(TCP, upright, gains=GAINS, largest_error="none")


def states(count: int, seed: int = 0) -> list[tuple[float, Array, Array]]:
    rng = np.random.default_rng(seed)
    return [
        (
            float(rng.uniform()),
            panda().random_configuration(rng),
            rng.standard_normal(7),
        )
        for _ in range(count)
    ]


def contents(out: hsp.ControlOutput) -> dict[str, Any]:
    """Return an output's content by name."""
    return {
        "tau": out.tau,
        "acceleration": out.acceleration,
        "null_space_error": out.null_space_error,
        "damped": out.damped,
        **{f"task.{k}": v for k, v in out.task._asdict().items()},
        **{f"field.{k}": v for k, v in out.field._asdict().items()},
    }


def assert_same(first: dict[str, Any], second: dict[str, Any]) -> None:
    """Assert equality bit for bit."""
    assert first.keys() == second.keys()
    for name, value in first.items():
        np.testing.assert_array_equal(value, second[name], err_msg=name)
