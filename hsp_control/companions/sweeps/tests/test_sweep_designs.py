"""Values, designs and sensitivities of sweeps."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from places import further
from scipy import stats
from scipy.special import ndtr, ndtri

from hsp_control.common.errors import PlotError, SweepError
from hsp_control.companions import sweeps
from hsp_control.companions.plots import palette
from hsp_control.companions.sweeps import Sweep, row_files
from hsp_control.companions.sweeps.design import chosen_design, points
from hsp_control.companions.sweeps.factor import factors
from hsp_control.companions.sweeps.figure import _tint
from hsp_control.companions.sweeps.one_run import Row
from hsp_control.companions.sweeps.plan import SweepPlan
from hsp_control.companions.sweeps.row_files import RowFiles
from hsp_control.companions.sweeps.values import is_distribution, parsed, quantiles
from hsp_control.config.document import Document
from hsp_control.simulation.measures import Measure

# --- values and designs --------------------------------------------------------------


@pytest.mark.parametrize(("text", "levels"), [
    ("1,2,5", (1, 2, 5)), ("rest,flow", ("rest", "flow")), ("true", (True,)),
    ("[0, 0, 1], [0, 1, 0]", ([0, 0, 1], [0, 1, 0])), ("'a:b', c", ("a:b", "c")),
    ("{type: hold}", ({"type": "hold"},)), ("0:10:3", (0, 5, 10)),
    ("0:1:3", (0.0, 0.5, 1.0)), ("-1e-2:0.5:2", (-0.01, 0.5)),
    ("linear:1:9:5", (1, 3, 5, 7, 9)), ("log:1:100:3", (1.0, 10.0, 100.0)),
])  # fmt: skip
def test_lists_and_ranges_as_they_are_spelled(text: str, levels: tuple) -> None:
    found = parsed(text)
    assert isinstance(found, tuple)
    assert [type(value) for value in found] == [type(value) for value in levels]
    # To rounding: the ends of a range are exact, values in between need not be.
    if isinstance(levels[0], float):
        np.testing.assert_allclose(found, levels, rtol=1e-15)
        assert (found[0], found[-1]) == (levels[0], levels[-1])
    else:
        assert found == levels


@pytest.mark.parametrize(("text", "name"), [
    ("1:10", "uniform"), ("uniform:-1:1", "uniform"),
    ("loguniform:0.1:10", "loguniform"), ("normal:0:0.1", "norm"),
    ("normal:1:0.1:0:2", "truncnorm"),
])  # fmt: skip
def test_distributions_as_they_are_spelled(text: str, name: str) -> None:
    found = parsed(text)
    assert is_distribution(found)
    assert found.dist.name == name


@pytest.mark.parametrize(("text", "message"), [
    ("", "the values are missing"), ("5:1:3", "from 5 to 1"),
    ("1:5:1", "at least 2"), ("1:5:2.5", "'2.5' is not an integer"),
    ("1:5:1000000", "at most 100000"), ("1:x:3", "'x' is not a number"),
    ("1:2:3:4", "has 4 parts"), ("nan:1", "must be finite"),
    ("log:0:1:3", "must be positive"), ("loguniform:-1:1", "must be positive"),
    ("unifrom:1:2", "did you mean 'uniform'?"),
    ("uniform:1", "has 1 numbers; needs uniform:LOW:HIGH"),
    ("normal:0:0", "the deviation positive"),
    ("normal:0:1:2:1", "cut to 2 ... 1; low must be below high"),
    ("integers:3:1", "no integers from 3 to 1"),
    ("integers:0:1.5", "'1.5' is not an integer"), ("[1, 2", "not a list"),
])  # fmt: skip
def test_invalid_ranges_are_refused(text: str, message: str) -> None:
    with pytest.raises(SweepError, match=message.replace("?", r"\?")):
        parsed(text)


def test_quantiles_are_those_of_the_distribution() -> None:
    fractions = np.linspace(0.0, 1.0, 101)[:-1]
    oracles = [
        ("uniform:-1:3", lambda u: -1.0 + 4.0 * u),
        ("loguniform:0.1:50", lambda u: 0.1 * 500.0**u),
        ("normal:2:0.5", lambda u: 2.0 + 0.5 * ndtri(u)),
        # Truncated: between the probabilities of its ends.
        ("normal:2:0.5:1.8:4", lambda u: 2.0 + 0.5 * ndtri(
            ndtr(-0.4) + u * (ndtr(4.0) - ndtr(-0.4)))),
    ]  # fmt: skip
    for text, oracle in oracles:
        ours = quantiles(parsed(text), fractions)
        np.testing.assert_allclose(ours[1:], oracle(fractions[1:]), rtol=1e-10)
        assert math.isfinite(ours[0])
        assert {type(value) for value in ours} == {float}
    drawn = quantiles(parsed("integers:3:7"), fractions)
    assert np.unique(drawn, return_counts=True)[1].tolist() == [20] * 5
    assert (min(drawn), max(drawn), type(drawn[0])) == (3, 7, int)
    chosen = quantiles(parsed("a,b,c,d"), fractions)
    assert chosen == [letter for letter in "abcd" for _ in range(25)]


@pytest.mark.parametrize(("spec", "description"), [
    ("1,2", {"values": [1, 2]}), ("integers:0:9", {"integers": [0, 9]}),
    (stats.norm(0.0, scale=0.1),
     {"distribution": "norm", "numbers": {"0": "0.0", "scale": "0.1"}}),
])  # fmt: skip
def test_a_factor_is_described_in_json(spec: Any, description: dict) -> None:
    (factor,) = factors({"a": spec})
    found = json.loads(json.dumps(factor.description(), allow_nan=False))
    assert found == {"key": "a", **description}


def test_a_grid_has_every_combination_in_order() -> None:
    found = points(factors({"a": "1:3:3", "b": ["x", "y"]}), "grid", None, 0)
    assert found == [(1, "x"), (1, "y"), (2, "x"), (2, "y"), (3, "x"), (3, "y")]


def test_a_latin_hypercube_meets_every_stratum_of_every_factor_once() -> None:
    over = factors({"a": "0:1", "b": "0:10", "c": "loguniform:1:2.718281828459045"})
    found = np.array(points(over, "latin_hypercube", 40, 3))
    found[:, 1] /= 10.0
    found[:, 2] = np.log(found[:, 2])
    for column in found.T:
        assert sorted((column * 40).astype(int)) == list(range(40))


def test_sobol_covers_every_factor_evenly_and_draws_any_number() -> None:
    over = factors({"a": "0:1", "b": "0:1"})
    for samples in (1, 2, 3, 16, 17, 33):
        assert len(points(over, "sobol", samples, 3)) == samples
    for column in np.transpose(points(over, "sobol", 32, 3)):
        assert sorted((column * 32).astype(int)) == list(range(32))


def test_no_design_has_more_than_a_million_runs() -> None:
    assert chosen_design("random", 1_000_000) == "random"
    with pytest.raises(SweepError, match="1000001 samples; must be from 1 to 1000000"):
        chosen_design("random", 1_000_001)
    thousand = "1:1000:1000"
    with pytest.raises(SweepError, match="the grid has 2000000 runs; at most 1000000"):
        points(factors({"a": thousand, "b": thousand, "c": "1,2"}), "grid", None, 0)


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_a_seed_is_a_design(design: Any) -> None:
    over = factors({"a": "0:1", "b": "normal:0:1"})
    assert points(over, design, 20, 5) == points(over, design, 20, 5)
    assert points(over, design, 20, 5) != points(over, design, 20, 6)
    assert len(points(over, design, 20, 5)) == 20


def plan_of(over: dict[str, Any]) -> SweepPlan:
    varied = factors(over)
    base = Document({}, {}, "invented")
    return SweepPlan(base, varied, "grid", None, 0, points(varied, "grid", None, 0))


def test_rows_are_in_the_order_of_the_plan() -> None:
    """In any order of completion, and also if some are missing."""
    files = RowFiles(plan_of({"a": "10:30:3"}), {}, None, fresh=False)
    for k in (2, 0):
        files.add(Row(k, "completed", "", {"e": Measure(0.5 * k, "m", "error")}))
        files.write()
    found = Sweep.of_table(files.table, files.meta)
    assert found["run"].tolist() == [0, 2]
    assert found["a"].tolist() == [10, 30]
    assert found["e"].tolist() == [0.0, 1.0]
    assert not found.complete
    assert found.meta["metrics"] == {"e": {"unit": "m", "meaning": "error"}}


def test_a_file_is_in_the_order_of_the_plan(tmp_path: Path) -> None:
    """The files for other tools have the same bytes, for any order of runs."""
    for name, order in (("one", (0, 1, 2)), ("other", (2, 0, 1))):
        files = RowFiles(plan_of({"a": "10:30:3"}), {}, tmp_path / name, fresh=False)
        for k in order:
            files.add(Row(k, "completed", "", {"e": Measure(0.5 * k, "m", "error")}))
        files.close()
    one, other = (
        [file.read_bytes() for file in (tmp_path / name).iterdir()]
        for name in ("one", "other")
    )
    assert one == other


def test_only_lost_rows_are_computed_again(tmp_path: Path) -> None:
    ended = "completed", "diverged", "refused", "failed"
    plan, folder = plan_of({"a": "10:60:6"}), tmp_path / "a.parquet"
    files = RowFiles(plan, {}, folder, fresh=False)
    for k, status in enumerate((*ended, "crashed", "timed out")):
        files.add(Row(k, status))
    files.close()
    there = sorted(folder.glob("*.parquet"))
    again = RowFiles(plan, {}, folder, fresh=False)
    assert again.done == {0, 1, 2, 3}
    assert again.failures == 3
    assert again.table["status"].to_pylist() == [*ended]
    again.close()  # nothing was added, and nothing is written anew
    assert sorted(folder.glob("*.parquet")) == there


def test_a_row_that_was_computed_again_replaces_the_lost_one(tmp_path: Path) -> None:
    """Also before the sweep ends, when both are in files."""
    plan, folder = plan_of({"a": "10:30:3"}), tmp_path / "a.parquet"
    files = RowFiles(plan, {}, folder, fresh=False)
    for k, status in enumerate(("completed", "crashed", "completed")):
        files.add(Row(k, status))
    files.close()
    again = RowFiles(plan, {}, folder, fresh=False)
    again.add(Row(1, "completed", "", {"x": Measure(5.0, "m", "")}))
    again.write()
    assert len([*folder.glob("*.parquet")]) == 2
    for closed in (False, True):
        if closed:
            again.close()
        found = Sweep.load(folder)
        assert found["run"].tolist() == [0, 1, 2]
        assert found["status"].tolist() == ["completed"] * 3
        assert found["x"][1] == 5.0


def test_ctrl_c_while_a_file_is_written_leaves_no_part_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does a sweep that was killed then; its rows are written when it closes."""
    folder = tmp_path / "a.parquet"
    folder.mkdir()
    (folder / ".rows-000099.parquet.part").write_bytes(b"PAR1")
    files = RowFiles(plan_of({"a": "10:30:3"}), {}, folder, fresh=False)
    files.add(Row(1, "completed", "", {"x": Measure(1.0, "m", "")}, 0.0))

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(row_files.pq, "write_table", interrupted)
        with pytest.raises(KeyboardInterrupt):
            files.write()
    files.close()
    (file,) = (path for path in folder.iterdir() if path.name != ".lock")
    assert file.suffix == ".parquet"
    assert Sweep.load(folder)["run"].tolist() == [1]


# --- sensitivity ---------------------------------------------------------------------


def invented(runs: int = 200) -> Sweep:
    """A sweep whose dependences are known."""
    rng = np.random.default_rng(0)
    up, bowl, none = rng.uniform(-1, 1, (3, runs))
    kind = np.array(["a", "b"], dtype=object)[rng.integers(0, 2, runs)]
    status = np.array(["completed"] * runs, dtype=object)
    status[:5] = "diverged"
    columns = {
        "run": np.arange(runs),
        "status": status,
        "message": np.array([""] * runs, dtype=object),
        "wall_time": np.ones(runs),
        "up": up, "bowl": bowl, "none": none, "kind": kind,
        "tracking.x.rms": np.exp(3.0 * up),
        "manipulability.min": -np.exp(3.0 * up),
        "distance.y.min": bowl**2,
        "effort.max": np.where(kind == "a", 5.0, 1.0) + 0.1 * none,
    }  # fmt: skip
    columns["tracking.x.rms"][0] = 1e9  # it diverged: it must be excluded
    metrics = ["tracking.x.rms", "manipulability.min", "distance.y.min", "effort.max"]
    meta = {
        "format": "hsp_control sweep 2",
        "name": "invented",
        "runs": runs,
        "parameters": {
            name: {"keys": [name], "json": False}
            for name in ("up", "bowl", "none", "kind")
        },
        "metrics": {name: {"unit": "m", "meaning": name} for name in metrics},
        "identity": {
            "configuration": {"title": "Costs 5$ to 10$"},
            "factors": [], "design": "random", "seed": 0,
            "versions": {"hsp_control": "0"},
        },
    }  # fmt: skip
    return Sweep(columns, meta)


def test_sensitivities_are_those_that_were_put_in() -> None:
    found = sweeps.sensitivity(invented())
    assert found.outcomes == (
        "tracking.x.rms", "manipulability.min", "distance.y.min", "effort.max",
    )  # fmt: skip
    assert found.runs == 195
    up, bowl, none, kind = (found.correlation[k] for k in range(4))
    assert up[:2] == pytest.approx([1.0, -1.0])  # any monotone form, exactly
    assert abs(bowl[2]) < 3 * found.noise  # an optimum in the middle correlates little
    assert np.isnan(kind).all()  # texts have no order
    assert abs(none[0]) < 2 * found.noise
    share = found.share
    assert share[0, 0] > 0.97
    assert share[1, 2] > 0.9  # ... but explains nearly all
    assert share[3, 3] == pytest.approx(0.75, abs=0.05)  # two halves of the ranks
    assert max(share[2, :3]) < 0.1  # one in twenty is reported as an influence
    assert share[2, 3] > 0.2  # within each half, it orders the ranks
    # Ranks by the oracle of correlations.
    oracle = stats.spearmanr(invented()["bowl"][5:], invented()["distance.y.min"][5:])
    assert bowl[2] == pytest.approx(oracle.statistic, abs=1e-12)
    # Twelve classes of equal size: from the F of an analysis of variance.
    classes = (stats.rankdata(invented()["bowl"][5:]) - 1.0) * 12 // 195
    rank = stats.rankdata(invented()["distance.y.min"][5:])
    F = stats.f_oneway(*(rank[classes == k] for k in range(12))).statistic
    assert share[1, 2] == pytest.approx(1.0 - 194 / (11 * F + 183), abs=1e-12)


def test_chance_is_that_of_the_completed_runs() -> None:
    """One correlation in twenty of independent runs is beyond the threshold: 4000
    samples of 30 runs estimate that fraction to 0.0035."""
    half = invented(60)
    half["status"][:30] = "diverged"
    noise = sweeps.sensitivity(half).noise
    rng = np.random.default_rng(1)
    ranks = rng.permuted(np.tile(np.arange(30.0), (4000, 1)), axis=1) - 14.5
    order = np.arange(30.0) - 14.5
    correlations = ranks @ order / (order @ order)
    beyond = (np.abs(correlations) > noise).mean()
    assert beyond == pytest.approx(0.05, abs=0.015)


def test_a_configuration_is_that_of_the_run_wherever_its_row_is() -> None:
    """Rows of an incomplete sweep begin with another run."""
    whole = invented(20)
    part = Sweep({name: each[7:] for name, each in whole.columns.items()}, whole.meta)
    for run in (7, 12):
        assert part.configuration(run) == whole.configuration(run)
        assert part.configuration(run)["up"] == whole["up"][run]
    with pytest.raises(SweepError, match="has no run 3"):
        part.configuration(3)


def test_undecidable_influences_are_not_reported() -> None:
    with pytest.raises(SweepError, match="5 runs were completed"):
        sweeps.sensitivity(invented(10))
    with pytest.raises(SweepError, match=r"did you mean 'effort.max'\?"):
        sweeps.sensitivity(invented(), ["effort.mx"])
    unknown = invented()
    unknown["effort.max"][5:] = np.nan
    assert "effort.max" not in sweeps.sensitivity(unknown).outcomes
    with pytest.raises(SweepError, match="no completed run has the metric"):
        sweeps.sensitivity(unknown, ["effort.max"])
    with pytest.raises(SweepError, match="has no run 200"):
        invented().configuration(200)
    with pytest.raises(SweepError, match="has no column 'upp'; did you mean 'up'"):
        invented()["upp"]


def test_every_pair_has_its_panel_and_failures_are_shown() -> None:
    figure = sweeps.sweep_figure(invented())
    figure.canvas.draw()
    axes = figure.axes
    assert len(axes) == 16
    corner = axes[0]
    assert "+1.00" in corner.get_title(loc="left")
    points, line, failed = corner.lines
    assert len(points.get_xdata()) == 195
    assert len(failed.get_xdata()) == 5
    assert np.all(np.diff(line.get_ydata()) > 0.0)
    assert corner.get_yscale() == "log"
    assert [label.get_text() for label in axes[15].get_xticklabels()] == ["a", "b"]
    tints = [np.array(each.get_facecolor()) for each in axes]
    assert tints[0][2] > tints[0][0]  # grows: blue
    assert tints[4][0] > tints[4][2]  # falls: orange
    assert axes[2].get_title(loc="left") == "may be chance"


def test_a_narrow_figure_has_its_whole_title_and_short_labels() -> None:
    """Of one parameter, and of a result that changes by rounding alone."""
    whole = invented()
    name = next(iter(whole.meta["metrics"]))
    equal = 0.04719859279 + 1e-16 * np.arange(len(whole))
    columns = {**whole.columns, name: equal}
    title = {"title": "Simulation 4: a moving disk to keep away from, of many words"}
    identity = {**whole.meta["identity"], "configuration": title}
    meta = {**whole.meta, "identity": identity}
    figure = sweeps.sweep_figure(Sweep(columns, meta), parameters=["up"])
    figure.canvas.draw()
    assert figure._suptitle is not None
    box = figure._suptitle.get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width
    rows = [axes for axes in figure.axes if np.ptp(axes.lines[0].get_ydata()) < 1e-9]
    assert rows
    for axes in rows:
        assert max(len(label.get_text()) for label in axes.get_yticklabels()) < 8


def test_a_figure_shows_the_parameters_that_are_named_as_wide_as_a_paper_needs() -> (
    None
):
    figure = sweeps.sweep_figure(invented(), parameters=["bowl", "up"], width="117mm")
    assert figure.get_figwidth() == pytest.approx(117.0 / 25.4)
    assert len(figure.axes) == 8
    last = [each.get_xlabel() for each in figure.axes[-2:]]
    assert last == ["bowl", "up"]
    whole = invented()
    about = {"unit": "rad", "meaning": "rms error of hand orientation"}
    meta = whole.meta | {"metrics": dict.fromkeys(whole.meta["metrics"], about)}
    figure = sweeps.sweep_figure(Sweep(whole.columns, meta), parameters=["up"])
    figure.draw_without_rendering()
    labels = [axes.yaxis.label.get_window_extent() for axes in figure.axes]
    assert min(label.x0 for label in labels) > 0.0
    with pytest.raises(PlotError, match="no parameter 'upp' varies; did you mean 'up'"):
        sweeps.sweep_figure(invented(), parameters=["upp"])


@pytest.mark.parametrize("runs", [2, *further(3)])
def test_two_or_three_values_give_a_figure_too(runs: int) -> None:
    whole = invented()
    few = {name: column[5 : 5 + runs] for name, column in whole.columns.items()}
    figure = sweeps.sweep_figure(Sweep(few, whole.meta))
    figure.canvas.draw()
    first = figure.axes[0]
    points, line = first.lines
    assert len(points.get_xdata()) == len(line.get_xdata()) == runs
    assert np.all(np.diff(line.get_ydata()) > 0.0)
    # With so few runs neither an influence nor its absence is reported.
    assert not any(each.get_title(loc="left") for each in figure.axes)
    with pytest.raises(SweepError, match=f"{runs} runs were completed"):
        sweeps.sensitivity(Sweep(few, whole.meta))


@pytest.mark.parametrize(("correlation", "hue"), [
    (0.9, palette.ACTUAL), (-0.9, palette.DESIRED),
    (0.2, palette.FIELD), (-0.2, palette.FIELD), (float("nan"), palette.FIELD),
])  # fmt: skip
def test_a_tint_tells_rising_falling_and_other_influences(
    correlation: float, hue: str
) -> None:
    axes = Figure().add_subplot()
    _tint(axes, correlation, 0.8, noise=0.1)
    expected = palette.blend(palette.PAPER, hue, 0.45 * 0.8)
    assert to_hex(axes.get_facecolor()) == to_hex(expected)
