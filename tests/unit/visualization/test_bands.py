"""Bands on the time line: from the log's columns, and in whatever shows the run."""

import numpy as np
import pytest

from hsp_control import Rollout, load_experiment
from hsp_control.config.experiment import Experiment
from hsp_control.visualization.viewer import (
    ComparedRun,
    LiveView,
    Recorder,
    Viewer,
    live,
)
from hsp_control.visualization.viewer.clip import CLOSED_SHARE, bands_of, spans_of

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


def told(recorder: Recorder) -> dict[str, list[list[float]]]:
    clip = recorder.command("/clip", "begin")
    assert clip is not None
    return {band["name"]: band["spans"] for band in clip["bands"]}


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
    (column,) = (name for name in run.columns if name.startswith("distance."))
    run = altered(run, status=status, **{column: near})
    bands = {band.name: band.spans for band in bands_of(run, experiment.controller)}
    assert bands == {
        "limit active": [pytest.approx((run.t[10], run.t[20]))],
        "inside an influence zone": [pytest.approx((run.t[30], run.t[40]))],
    }
    excess = np.zeros((n, 7))
    excess[42:46, 3] = 1e-3
    beyond = altered(run, status=np.zeros(n), position_excess=excess)
    assert {band.name: band.spans for band in bands_of(beyond, None)} == {
        "beyond a limit": [pytest.approx((run.t[42], run.t[46]))]
    }
    # Without the controller nobody knows where a zone begins.
    assert [band.name for band in bands_of(run, None)] == ["limit active"]


def test_a_target_out_of_reach_is_told_with_its_distance(
    obstacle: tuple[Experiment, Rollout],
) -> None:
    """Once it has rested for 0.3 s; before, it is far away."""
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


def test_chattering_is_one_band(obstacle: tuple[Experiment, Rollout]) -> None:
    _, run = obstacle
    damped = np.arange(len(run)) % 2.0
    duration = 1.1 * (run.t[1] - run.t[0]) / CLOSED_SHARE
    (band,) = bands_of(altered(run, damped=damped), None, duration=duration)
    assert band.name == "bounded at a singularity"
    assert len(band.spans) == 1
    (band,) = bands_of(altered(run, damped=damped), None)
    assert len(band.spans) > 10


def test_a_run_is_shown_with_its_bands(obstacle: tuple[Experiment, Rollout]) -> None:
    experiment, run = obstacle
    recorder = Recorder()
    viewer = Viewer(experiment.robot, transport=recorder)
    viewer.play(run, controller=experiment.controller)
    assert told(recorder) == {"inside an influence zone": [[0.0, 0.5]]}
    bounded = altered(run, damped=np.ones(len(run)))
    viewer.compare(
        [
            ComparedRun("with", experiment.robot, run, experiment.controller),
            ComparedRun("without", experiment.robot, bounded),
        ]
    )
    assert told(recorder) == {
        "with: inside an influence zone": [[0.0, 0.5]],
        "without: bounded at a singularity": [[0.0, 0.5]],
    }


def test_bands_grow_with_a_run_that_is_computed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each part begins where the last one ended: the page makes one band of them."""
    experiment = load_experiment("panda_obstacle", "simulation.duration=0.3", *FAST)
    recorder = Recorder()
    view = LiveView(Viewer(experiment.robot, transport=recorder), experiment)
    monkeypatch.setattr(live, "MIN_PERIOD", 0.0)
    monkeypatch.setattr(live, "MAX_PERIOD", 0.0)
    rollout = experiment.run(on_row=view.on_row)
    parts = [recorder.command("/clip", "begin")]
    while (more := recorder.command("/clip", f"more {len(parts)}")) is not None:
        parts.append(more)
    assert len(parts) > 3
    spans = [
        span for part in parts if part for b in part["bands"] for span in b["spans"]
    ]
    starts, ends = (np.array(times) for times in zip(*spans, strict=True))
    assert (starts[1:] <= ends[:-1]).all()
    assert ends[-1] == pytest.approx(0.3)
    view.finish(rollout)
    assert told(recorder) == {"inside an influence zone": [[0.0, 0.3]]}
