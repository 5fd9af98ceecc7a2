"""The plots of a page: the floor of held efforts, and the curves of several runs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import hsp_control.visualization.plots as plots
from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.exceptions import ExportError
from hsp_control.simulation.log_series import held_period
from hsp_control.visualization.viewer import ComparedRun, export_html
from hsp_control.visualization.viewer.comparison import run_parts
from hsp_control.visualization.viewer.packed.packing import ArrayTable
from hsp_control.visualization.viewer.packed.plot_packing import (
    Edge,
    Panel,
    PlottedRun,
    expected_floor,
    pack_panels,
    panels_of,
)

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


@pytest.mark.parametrize("name", [PLANAR, "panda_obstacle"])
def test_the_floor_is_what_is_measured_and_falls_with_the_period(name: str) -> None:
    sizes = []
    for period in (0.001, 0.002, 0.005):
        settings = [f"simulation.control_period={period}", "simulation.duration=6"]
        run = run_of(*settings, name=name)
        floor = expected_floor(run.rollout, run.controller)
        assert floor is not None
        late = run.rollout.t > 2.0  # the start has decayed to 1e-9
        measured = run.rollout["null_space_norm"][late]
        # The norms pass through zero: there their ratio is of no use.
        far = floor[late] > 0.1 * floor[late].max()
        ratio = (measured / floor[late])[far]
        assert (ratio.min(), ratio.max()) == pytest.approx((1.0, 1.0), abs=0.25)
        assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
        sizes.append(np.sqrt(np.mean(measured**2)))
    np.testing.assert_allclose(np.divide(sizes, sizes[0]), [1.0, 2.0, 5.0], rtol=0.05)


def test_a_matrix_gain_has_its_own_floor() -> None:
    gain = "null_space.gain=[[12, 3, 0], [-3, 6, 0], [0, 0, 9]]"
    run = run_of(
        gain,
        "null_space.metric={type: identity}",
        "simulation.duration=4",
        "simulation.control_period=0.002",
    )
    floor = expected_floor(run.rollout, run.controller)
    assert floor is not None
    late = run.rollout.t > 2.5
    measured = run.rollout["null_space_norm"][late]
    assert np.sqrt(np.mean(measured**2)) == pytest.approx(
        np.sqrt(np.mean(floor[late] ** 2)), rel=0.1
    )


def test_where_no_floor_is_known_none_is_drawn(
    planar: ComparedRun, held: ComparedRun
) -> None:
    assert held_period(planar.rollout) is None
    assert held_period(held.rollout) == 0.002
    assert expected_floor(planar.rollout, planar.controller) is None
    assert expected_floor(held.rollout, None) is None
    rows = slice(None, None, 40)  # 0.4 s: what decays with 10 1/s is not seen
    columns = {name: column[rows] for name, column in held.rollout.columns.items()}
    assert expected_floor(Rollout(columns, held.rollout.meta), held.controller) is None
    no_gain = {k: v for k, v in held.rollout.meta.items() if k != "null_space_gain"}
    unknown = Rollout(held.rollout.columns, no_gain)
    assert expected_floor(unknown, held.controller) is None
    anonymous = {k: v for k, v in held.rollout.meta.items() if k != "config"}
    assert held_period(Rollout(held.rollout.columns, anonymous)) is None


def test_the_plot_says_how_long_the_effort_was_held(
    planar: ComparedRun, held: ComparedRun
) -> None:
    def null_space(run: ComparedRun, controller: Any) -> tuple[str, list[str]]:
        panel = panels_of(run.rollout, controller)[1]
        return panel.note, [series.name for series in panel.series]

    predicted, actual = "predicted: exp(−10 t)", "‖e_N‖"
    floor = "held effort: expected floor"
    assert null_space(planar, planar.controller) == ("", [predicted, actual])
    note = "effort held for 2 ms"
    assert null_space(held, held.controller) == (note, [predicted, actual, floor])
    assert null_space(held, None) == (note, [predicted, actual])


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
    packed = pack_panels([PlottedRun("", log)] * 2, ArrayTable())
    (plot,) = (p for p in packed["panels"] if p["title"] == "Minimum distance")
    assert plot["edges"] == [{"value": 0.2, "name": "radius 0.2 m"}]  # once
    assert plot["low"] < 0.2
    figure = plots.diagnostics_figure(log)
    (axes,) = (a for a in figure.axes if a.get_ylabel() == "minimum distance [m]")
    drawn = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert set(drawn) == {"joint to centre of disk", "radius 0.2 m"}
    assert set(np.asarray(drawn["radius 0.2 m"])) == {0.2}
    # Between surfaces, contact is at zero; a log that does not know is taken so.
    columns = {"distance.point_distance": {"unit": "m", "meaning": ""}}
    old = Rollout(log.columns, log.meta | {"columns": log.meta["columns"] | columns})
    assert distance(old).edges == [Edge(0.0, "")]
    # A box has no radius.
    disk = log.meta["obstacles"]["disk"] | {"shape": "Box"}
    boxed = Rollout(log.columns, log.meta | {"obstacles": {"disk": disk}})
    assert distance(boxed).edges == []
    assert distance(boxed).series[0].name == "joint to centre of disk"


def test_units_are_those_of_the_joints_that_are_shown(planar: ComparedRun) -> None:
    def shown(count: int, slides: int, moving: int) -> tuple[str, list[str], int]:
        """Return unit and names of the page's panel, and a figure's number of lines."""
        robot = {"units": ["m"] * slides + ["rad"] * (count - slides)}
        robot |= {"dofs": [f"j{k}" for k in range(count)]}
        speeds = np.where(np.arange(count) < count - moving, 0.01, 1.0)
        columns = {"joint_positions": planar.rollout.t[:, None] * speeds}
        columns |= {"tau": columns["joint_positions"]}
        meta = planar.rollout.meta
        about = meta["robot"] | robot | {"joint_coordinates": None}
        log = Rollout(planar.rollout.columns | columns, meta | {"robot": about})
        panels = {panel.title: panel for panel in panels_of(log)}
        panel, efforts = panels["Joint positions"], panels["Efforts τ"]
        other = {"rad": "N·m", "m": "N", "m, rad": "N, N·m"}
        assert efforts.unit == other[panel.unit]
        axes = Figure().add_subplot()
        plots.draw_joint_positions(axes, log)
        assert axes.get_ylabel() == f"joint position [{panel.unit}]"
        drawn = sum(len(line.get_xdata()) > 0 for line in axes.lines)
        return panel.unit, [series.name for series in panel.series], drawn

    assert shown(2, 0, 2) == ("rad", ["j0", "j1"], 2)
    assert shown(2, 2, 2) == ("m", ["j0", "j1"], 2)
    assert shown(2, 1, 2) == ("m, rad", ["j0 [m]", "j1 [rad]"], 2)
    # Of many, the metres of joints that are not named are left out.
    many = [f"j{k}" for k in range(13, 20)]
    assert shown(20, 3, 7) == ("rad", many, 17)


# -- several runs ---------------------------------------------------------------------


def test_curves_of_the_same_quantity_share_a_plot(
    planar: ComparedRun, held: ComparedRun
) -> None:
    runs = [PlottedRun("short", planar.rollout), PlottedRun("long", held.rollout)]
    packed = pack_panels(runs, ArrayTable())
    assert packed["runs"] == ["short", "long"]
    assert (packed["start"], packed["end"]) == (0.0, 4.0)
    assert len(packed["damped"]) == 2
    assert len({(p["title"], p["unit"]) for p in packed["panels"]}) == 7
    for panel in packed["panels"]:
        colors: dict[str, set[str]] = {}
        for series in panel["series"]:
            colors.setdefault(series["name"], set()).add(series["color"])
        assert all(len(each) == 1 for each in colors.values())
        assert {series["run"] for series in panel["series"]} == {0, 1}
    lows = [pack_panels([run], ArrayTable())["panels"][3]["low"] for run in runs]
    assert packed["panels"][3]["low"] <= min(lows) + 1e-12


def test_the_nodes_of_runs_are_apart() -> None:
    first, second, third = run_parts(["robot", "without", "robot"])
    assert "/robot" in first
    assert second == ["/without"]
    assert third == ["/run robot"]


def test_what_cannot_be_compared_is_said(planar: ComparedRun, tmp_path: Path) -> None:
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
    assert "<title>with and without</title>" in page.read_text(encoding="utf-8")
    titled = []
    for number, log in enumerate(logs):
        rollout = Rollout.load(Path(log))
        meta = {**rollout.meta, "title": f"Case {number}"}
        titled.append(str(Rollout(rollout.columns, meta).save(Path(log))))
    assert main(["export", *titled, "--html", str(page)]) == 0
    assert "<title>Case 0 and Case 1</title>" in page.read_text(encoding="utf-8")
