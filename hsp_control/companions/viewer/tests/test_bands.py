"""Bands on the time line: from the log's columns, and in every view of the run."""

import numpy as np
import pytest

from hsp_control import Rollout, load_experiment
from hsp_control.companions.plots.log_series import spans_of
from hsp_control.companions.viewer.clip import bands_of
from hsp_control.config.experiment import Experiment

FAST = (
    "simulation.control_period=null",
    "simulation.integrator={type: rk4, step: 0.01}",
    "simulation.log_period=0.01",
)


@pytest.fixture(scope="module")
def obstacle() -> tuple[Experiment, Rollout]:
    experiment = load_experiment("panda_obstacle", "simulation.duration=0.5", *FAST)
    return experiment, experiment.run()


def altered(rollout: Rollout, **columns: np.ndarray) -> Rollout:
    return Rollout({**rollout.columns, **columns}, rollout.meta)


@pytest.mark.parametrize(
    ("active", "closed", "expected"),
    [
        ("....", 0.0, []),
        ("xxxx", 0.0, [(0.0, 3.0)]),
        (".xx.", 0.0, [(1.0, 3.0)]),
        ("x..x", 0.0, [(0.0, 1.0), (3.0, 3.0)]),
        ("x.x.", 0.5, [(0.0, 1.0), (2.0, 3.0)]),
        ("x.x.", 1.0, [(0.0, 3.0)]),
    ],
)
def test_a_row_lasts_until_the_next_one(
    active: str, closed: float, expected: list[tuple[float, float]]
) -> None:
    rows = np.array([letter == "x" for letter in active])
    assert spans_of(np.arange(4.0), rows, closed) == expected


def test_bands_are_the_logs_columns(obstacle: tuple[Experiment, Rollout]) -> None:
    experiment, run = obstacle
    n, influence = len(run), 0.4
    status = np.where(np.arange(n) < 10, 1.0, 3.0)
    status[20:] = np.nan  # rows without the law's output
    near = np.full(n, influence)
    near[30:40] = influence - 1e-6
    near[35:38] = -0.042
    (column,) = (name for name in run.columns if name.startswith("distance."))
    run = altered(run, status=status, **{column: near})
    bands = {band.name: band.spans for band in bands_of(run, experiment.controller)}
    assert bands == {
        "limit active": [pytest.approx((run.t[10], run.t[20]))],
        "inside an influence zone": [pytest.approx((run.t[30], run.t[40]))],
        "collision": [pytest.approx((run.t[35], run.t[38]))],
    }
    reported = [band.caption for band in bands_of(run, experiment.controller)]
    assert "collision, up to 4.2 cm deep" in reported
    without = "null_space.fields.0.weight=0", *FAST
    weightless = load_experiment("panda_obstacle", *without).controller
    bands = [band.name for band in bands_of(run, weightless)]
    assert bands == ["limit active", "collision"]  # no reaction there
    excess = np.zeros((n, 7))
    excess[42:46, 3] = 1e-3
    beyond = altered(run, status=np.zeros(n), position_excess=excess)
    assert {band.name: band.spans for band in bands_of(beyond, None)} == {
        "beyond a limit": [pytest.approx((run.t[42], run.t[46]))]
    }
    # Without the controller the start of a zone is unknown.
    assert [band.name for band in bands_of(run, None)] == ["limit active"]


@pytest.mark.parametrize("deepest", ["obstacle_clearance", "self_clearance"])
def test_a_collision_is_as_deep_as_the_deepest_of_all_distances(
    deepest: str, obstacle: tuple[Experiment, Rollout]
) -> None:
    fields = "{type: obstacle_clearance, obstacles: [ball]}, {type: self_clearance}"
    both = load_experiment("panda_obstacle", f"null_space.fields=[{fields}]", *FAST)
    _, run = obstacle
    apart = np.full(len(run), 0.3)
    columns = {f"distance.{kind}_clearance": apart for kind in ("obstacle", "self")}
    columns[f"distance.{deepest}"] = np.where(run.t < 0.1, -0.05, apart)
    bands = bands_of(altered(run, **columns), both.controller)
    (collision,) = (band for band in bands if band.name == "collision")
    assert collision.caption == "collision, up to 5.0 cm deep"
    assert collision.spans == [pytest.approx((0.0, 0.1))]


def test_a_target_out_of_reach_is_reported_with_its_distance(
    obstacle: tuple[Experiment, Rollout],
) -> None:
    """After 0.3 s at rest; before, it is far away."""
    _, run = obstacle
    error, n = np.zeros_like(run["task.hand.error"]), len(run)
    error[:, 0] = 0.31
    away = {
        "damped": np.ones(n),
        "task.hand.error": error,
        "task.hand.error_rate": np.zeros_like(error),
        "task.hand.bounded": np.full(n, 0.31),
    }
    far, out, _ = bands_of(altered(run, **away), None)
    assert (far.name, far.caption) == ("hand: target far away",) * 2
    assert out.name == "hand: target out of reach"
    assert out.caption == "hand: target out of reach, 0.31 m"
    ((start, there),), ((also, end),) = far.spans, out.spans
    assert (start, end) == (run.t[0], run.t[-1])
    assert there == also == pytest.approx(0.3, abs=0.011)
    error[40:, 0] = 0.2
    _, out, _ = bands_of(altered(run, **away), None)
    assert out.caption == "hand: target out of reach, up to 0.31 m"
