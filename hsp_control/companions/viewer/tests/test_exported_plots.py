"""The plots of a page: the floor of held efforts, and the curves of several runs."""

from pathlib import Path

import numpy as np
import pytest
from places import further

import hsp_control.companions.plots as plots
from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.errors import ExportError
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.analysis import expected_floor
from hsp_control.companions.plots.log_series import held_period
from hsp_control.companions.viewer import ComparedRun, export_html
from hsp_control.companions.viewer.packing import ArrayTable
from hsp_control.companions.viewer.page_plots import Edge, Panel, pack_panels, panels_of
from hsp_control.law import MetricSample

PLANAR = "paper/4_moving_obstacle"


def run_of(*settings: str, name: str = PLANAR) -> ComparedRun:
    experiment = load_experiment(name, *settings)
    return ComparedRun("", experiment.robot, experiment.run(), experiment.controller)


@pytest.fixture(scope="module")
def planar() -> ComparedRun:
    return run_of("simulation.duration=1")


@pytest.fixture(scope="module")
def held() -> ComparedRun:
    return run_of("simulation.duration=4", "simulation.control_period=0.002")


# -- the floor of held efforts --------------------------------------------------------


@pytest.mark.parametrize("name", ["panda_obstacle", *further(PLANAR)])
def test_the_floor_is_the_measured_one_and_falls_with_the_period(name: str) -> None:
    periods, sizes = (*further(0.001), 0.002, 0.005), []
    for period in periods:
        settings = [f"simulation.control_period={period}", "simulation.duration=6"]
        run = run_of(*settings, name=name)
        floor = expected_floor(run.rollout, run.controller)
        assert floor is not None
        late = run.rollout.t > 2.0  # the start has decayed to 1e-9
        measured = run.rollout["null_space_norm"][late]
        # The norms pass through zero, where their ratio is meaningless.
        far = floor[late] > 0.1 * floor[late].max()
        ratio = (measured / floor[late])[far]
        assert (ratio.min(), ratio.max()) == pytest.approx((1.0, 1.0), abs=0.25)
        assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
        sizes.append(np.sqrt(np.mean(measured**2)))
    expected = np.divide(periods, periods[0])
    np.testing.assert_allclose(np.divide(sizes, sizes[0]), expected, rtol=0.05)


def test_the_floor_is_a_norm_in_the_metric() -> None:
    """After one row: P (1 - exp(-K_N Δt))/(K_N Δt) h/2 P M⁻¹ Δτ, from e_N = 0."""
    run = run_of(
        "null_space.metric={type: mass_matrix}", "simulation.duration=0.05",
        "simulation.control_period=0.002", name="panda_obstacle",
    )  # fmt: skip
    log, controller = run.rollout, run.controller
    assert controller is not None
    floor = expected_floor(log, controller)
    assert floor is not None
    state = run.robot.state(log.t[0], log.q[0], log.v[0])
    L = controller.metric.evaluate(state, MetricSample.allocate(7)).L
    W, J = L @ L.T, state.frame("panda_tcp").jacobian
    P = np.eye(7) - np.linalg.solve(W, J.T) @ np.linalg.inv(
        J @ np.linalg.solve(W, J.T)
    ) @ J  # fmt: skip
    change = np.linalg.solve(state.mass_matrix, log.tau[1] - log.tau[0])
    decayed = 10.0 * (log.t[1] - log.t[0])  # K_N Δt
    e = 0.5 * 0.002 * (1.0 - np.exp(-decayed)) / decayed * P @ change
    assert floor[1] == pytest.approx(np.sqrt(e @ W @ e), rel=1e-6)


def test_where_no_floor_is_known_none_is_drawn(
    planar: ComparedRun, held: ComparedRun
) -> None:
    assert held_period(planar.rollout) is None
    assert held_period(held.rollout) == 0.002
    assert expected_floor(planar.rollout, planar.controller) is None
    assert expected_floor(held.rollout, None) is None
    rows = slice(None, None, 40)  # 0.4 s: a decay at 10 1/s is not resolved
    columns = {name: column[rows] for name, column in held.rollout.columns.items()}
    assert expected_floor(Rollout(columns, held.rollout.meta), held.controller) is None
    no_gain = {k: v for k, v in held.rollout.meta.items() if k != "null_space_gain"}
    unknown = Rollout(held.rollout.columns, no_gain)
    assert expected_floor(unknown, held.controller) is None
    change = {"type": "null_space_gain", "gain": 20.0, "at": 1.0}
    changing = Rollout(held.rollout.columns, {**held.rollout.meta, "changes": [change]})
    assert expected_floor(changing, held.controller) is None
    anonymous = {k: v for k, v in held.rollout.meta.items() if k != "config"}
    assert held_period(Rollout(held.rollout.columns, anonymous)) is None


# -- distances and units --------------------------------------------------------------


def test_a_distance_to_a_centre_says_so_and_has_the_radius_as_its_line(
    planar: ComparedRun,
) -> None:
    def distance(log: Rollout) -> Panel:
        (panel,) = (p for p in panels_of(log) if p.title == "Minimum distance")
        return panel

    log = planar.rollout
    panel = distance(log)
    (curve,) = panel.series
    assert curve.name == "joint to centre of disk"
    assert panel.edges == [Edge(0.2, "radius 0.2 m")]
    packed = pack_panels([planar, planar], ArrayTable())
    (plot,) = (p for p in packed["panels"] if p["title"] == "Minimum distance")
    assert plot["edges"] == [{"value": 0.2, "name": "radius 0.2 m"}]  # once
    assert plot["low"] < 0.2
    figure = plots.diagnostics_figure(log)
    (axes,) = (a for a in figure.axes if a.get_ylabel() == "minimum distance [m]")
    drawn = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert set(drawn) == {"joint to centre of disk", "radius 0.2 m"}
    assert set(np.asarray(drawn["radius 0.2 m"])) == {0.2}
    # Between surfaces contact is at zero; the default for logs without the information.
    columns = {"distance.point_distance": {"unit": "m", "meaning": ""}}
    old = Rollout(log.columns, log.meta | {"columns": log.meta["columns"] | columns})
    assert distance(old).edges == [Edge(0.0, "contact")]
    # A box has no radius.
    disk = log.meta["obstacles"]["disk"] | {"shape": "Box"}
    boxed = Rollout(log.columns, log.meta | {"obstacles": {"disk": disk}})
    assert distance(boxed).edges == []
    assert distance(boxed).series[0].name == "joint to centre of disk"


# -- several runs ---------------------------------------------------------------------


def test_incomparable_logs_are_reported(planar: ComparedRun, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    with pytest.raises(ExportError, match="there is no run"):
        export_html([], path)
    named = planar._replace(name="a")
    with pytest.raises(ExportError, match="must have different names, not a, a"):
        export_html([named, named], path)
    with pytest.raises(ExportError, match="has its own robot and controller"):
        export_html([named], path, robot=planar.robot)
    assert not path.exists()


def test_the_command_exports_two_logs(planar: ComparedRun, tmp_path: Path) -> None:
    logs = [
        str(planar.rollout.save(tmp_path / f"{n}.npz")) for n in ("with", "without")
    ]
    page = tmp_path / "page.html"
    assert main(["export", *logs, "--html", str(page)]) == 0
    title = planar.rollout.meta["title"]  # of both; the switch has their names
    assert f"<title>{title}</title>" in page.read_text(encoding="utf-8")
    titled = []
    for number, log in enumerate(logs):
        rollout = Rollout.load(Path(log))
        meta = {**rollout.meta, "title": f"Case {number}"}
        titled.append(str(Rollout(rollout.columns, meta).save(Path(log))))
    assert main(["export", *titled, "--html", str(page)]) == 0
    assert "<title>Case 0 and Case 1</title>" in page.read_text(encoding="utf-8")


def test_a_comparison_lasts_from_the_first_start_to_the_last_end(
    planar: ComparedRun,
) -> None:
    log = planar.rollout
    late = Rollout({**log.columns, "t": log.t + 2.0}, log.meta)
    for runs in ((log, late), (late, log)):
        plots = [ComparedRun(str(k), planar.robot, run) for k, run in enumerate(runs)]
        packed = pack_panels(plots, ArrayTable())
        assert (packed["start"], packed["end"]) == (0.0, 3.0)


def test_bounds_of_all_compared_runs_are_drawn(planar: ComparedRun) -> None:
    log = planar.rollout
    disk = log.meta["obstacles"]["disk"] | {"radius": 0.3}
    larger = Rollout(log.columns, log.meta | {"obstacles": {"disk": disk}})
    plots = [planar._replace(name="a"), planar._replace(name="b", rollout=larger)]
    panels = pack_panels(plots, ArrayTable())["panels"]
    (edges,) = (each["edges"] for each in panels if each["title"] == "Minimum distance")
    assert [each["value"] for each in edges] == [0.2, 0.3]


def test_a_curve_has_one_colour_in_all_compared_runs(planar: ComparedRun) -> None:
    """Also where another curve stands before it, which would have its colour."""
    log = planar.rollout
    other = {"distance.other": log["distance.point_distance"] + 1.0}
    more = Rollout({**other, **log.columns}, log.meta)
    plots = [planar._replace(name="a"), planar._replace(name="b", rollout=more)]
    panels = pack_panels(plots, ArrayTable())["panels"]
    (curves,) = (p["series"] for p in panels if p["title"] == "Minimum distance")
    disk, added, again = ((each["name"], each["color"]) for each in curves)
    assert added == ("other", palette.series(0))
    assert disk == again == ("joint to centre of disk", palette.series(0))


def test_a_note_says_how_many_milliseconds_an_effort_is_held() -> None:
    run = run_of("simulation.duration=0.1", "simulation.control_period=0.002")
    _, null_space, *_ = panels_of(run.rollout)
    assert null_space.note == "effort held for 2 ms"
