"""The plots of the live page: messages, their amount, and their receivers."""

import numpy as np
import pytest

from hsp_control import Rollout, load_experiment
from hsp_control.companions.viewer import ComparedRun, InlineView, SceneRecorder, Viewer
from hsp_control.companions.viewer.commands import PLOTS, key_of, unpack
from hsp_control.companions.viewer.live_plots import Curve, live_plots
from hsp_control.companions.viewer.page_plots import (
    PREVIEW_ROWS,
    plots_of,
    plots_so_far,
)
from hsp_control.config import Experiment
from hsp_control.simulation.log_writer import LogWriter as Rows

MOVING = "paper/4_moving_obstacle"


@pytest.fixture(scope="module")
def computed() -> tuple[Experiment, Rollout, list[tuple[int, dict]]]:
    """A run of 1.5 s, and the messages due at some of its rows."""
    experiment = load_experiment(
        MOVING, "simulation.duration=1.5", "simulation.log_period=0.001"
    )
    sent = []

    def on_row(rows: Rows) -> None:
        count = len(rows.rows(0)["t"])
        if count in {1, 2, 600, 1400}:
            meta = rows.meta("", "")
            plots = plots_so_far(rows, meta, experiment.robot, 1.5)
            sent.append((count, unpack(plots.packed)))

    return experiment, experiment.run(on_row=on_row), sent


def test_a_run_so_far_has_the_axis_of_the_whole_and_few_points(computed) -> None:
    _, _, sent = computed
    assert [count for count, _ in sent] == [1, 2, 600, 1400]
    for _, command in sent:
        plots = command["plots"]
        assert (plots["start"], plots["end"]) == (0.0, 1.5)
        titles = [panel["title"] for panel in plots["panels"]]
        assert titles[:2] == ["Task error ‖e‖", "Null-space error ‖e_N‖"]
        assert titles[-1] == "Efforts τ"
        assert max(each["rows"] for each in command["arrays"]) <= PREVIEW_ROWS + 1
    null_space = sent[-1][1]["plots"]["panels"][1]
    assert any(curve["predicted"] for curve in null_space["series"])


def test_only_an_own_server_gets_them_and_a_notebook_never(computed) -> None:
    experiment, log, _ = computed
    recorder = SceneRecorder()
    with Viewer(experiment.robot, transport=recorder) as viewer:
        assert not viewer.has_plots
        viewer.play(log, controller=experiment.controller)
        assert recorder.scene.get(key_of(PLOTS, "plots")) is None
        bare = len(InlineView(recorder.scene).page)
        viewer.show_plots(
            plots_of([ComparedRun("", experiment.robot, log, experiment.controller)])
        )
        assert recorder.scene.get(key_of(PLOTS, "plots")) is not None
        assert len(InlineView(recorder.scene).page) == pytest.approx(bare, rel=1e-3)
        viewer.play(log)  # a new stage has none, until they are sent again
        assert recorder.scene.get(key_of(PLOTS, "plots")) is None


def test_a_share_of_a_limit_has_no_sign() -> None:
    """The joint that is nearest to its limit, in either direction."""
    curve = Curve("largest", "v", slice(0, 3), np.array([1.0, 2.0, np.inf]))
    rows = {"t": np.arange(3.0), "v": np.array([[-0.9, 1.0, 9.0], [0.1, -1.0, -9.0]])}
    np.testing.assert_allclose(curve.values(rows), [90.0, 50.0])


def test_each_part_of_an_error_is_the_norm_of_its_own_rows() -> None:
    """Of a pose: first the position's rows, then those of the orientation."""
    run = load_experiment("panda_obstacle", "simulation.duration=0.02").run()
    error = np.random.default_rng(1).standard_normal((len(run), 6))
    rows = {**run.columns, "task.hand.error": error}
    place, turn = (p for p in live_plots(rows, run.meta) if p.title == "Task error")
    for plot, part in ((place, slice(3)), (turn, slice(3, 6))):
        expected = np.linalg.norm(error[:, part], axis=1)
        np.testing.assert_allclose(plot.curves[0].values(rows), expected)
