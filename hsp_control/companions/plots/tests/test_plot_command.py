"""`hsp plot`: names, order, one file, the floor, the decay, and narrow figures."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from drawn_logs import legend_texts, planar
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

import hsp_control as hsp
import hsp_control.companions.plots as plots
from hsp_control.cli import main
from hsp_control.companions.plots import palette


@pytest.fixture(scope="module")
def logs() -> dict[str, hsp.Rollout]:
    return {"rest": planar(2)}


def plotted(*options: str) -> list[str]:
    """The names of the runs in the order in which `hsp plot` draws them."""
    drawn: list[Figure] = []

    def keep(figure: Figure, stem: Path, formats: list[str]) -> list[Path]:
        drawn.append(figure)
        return []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "save_figure", keep, raising=False)
        assert main(["plot", *options]) == 0
    (figure,) = drawn
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.fixture
def gains(tmp_path: Path, logs: dict[str, hsp.Rollout]) -> list[str]:
    """Logs as a shell lists them: 16, 2, 8."""
    files = [tmp_path / f"mine-null_space.gain={k}.npz" for k in (16, 2, 8)]
    return [str(logs["rest"].save(file)) for file in files]


@pytest.mark.slow
def test_logs_of_a_pattern_are_drawn_in_the_order_of_their_numbers(
    gains: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    numbered = [f"null_space.gain={k}" for k in (2, 8, 16)]
    assert plotted(*gains) == numbered
    given = [gains[2], gains[0], gains[1]]
    assert plotted(*given) == [numbered[1], numbered[2], numbered[0]]
    named = plotted(*gains, "--names", "$K_N$ = 16, a_b$, $K_N$")
    assert named == ["$K_N$ = 16", r"a_b\$", "$K_N$"]
    assert f"a_b$: {gains[1]}" in capsys.readouterr().out.replace("\n", "")


@pytest.mark.slow
def test_logs_whose_names_are_not_utf8_are_compared(
    logs: dict[str, hsp.Rollout], tmp_path: Path
) -> None:
    names = [b"caf\xe9".decode(errors="surrogateescape"), "b"]
    files = [str(logs["rest"].save(tmp_path / f"{name}.npz")) for name in names]
    assert plotted(*files) == ["caf\\udce9", "b"]
    assert main(["plot", *files, "-o", str(tmp_path / "a.png")]) == 0


@pytest.mark.slow
def test_one_figure_goes_into_the_file_that_is_named(
    tmp_path: Path, gains: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a" / "gains.svg"
    assert main(["plot", *gains, "-o", str(file), "--panels", "null_space"]) == 0
    assert file.read_text(encoding="utf-8").lstrip().startswith("<?xml")
    assert main(["plot", gains[0], "--panels", "decay,null_space"]) == 0
    names = {path.name for path in tmp_path.glob("*.png")}
    assert names == {"mine-null_space.gain=16-decay-null_space.png"}
    assert main(["plot", *gains, "--names", "one,two"]) == 2
    assert "--names has 2 names for 3 logs" in capsys.readouterr().err
    assert main(["plot", gains[0], "-o", "x.png", "--format", "pdf"]) == 2
    assert "-o names the file and its format" in capsys.readouterr().err


@pytest.mark.slow
def test_the_floor_of_a_held_effort_is_drawn_where_the_exponential_is() -> None:
    gain, short = "null_space.gain=10", "simulation.duration=0.5"
    run = hsp.load_experiment("panda_obstacle", gain, short).run()
    figure = plots.diagnostics_figure(run, panels=["null_space"])
    words = legend_texts(figure.axes[0])
    assert "expected floor of the held effort" in words
    run.meta["config"]["simulation"]["control_period"] = None
    other = hsp.Rollout(run.columns, run.meta)
    figure = plots.diagnostics_figure(other, panels=["null_space"])
    words = legend_texts(figure.axes[0])
    assert "expected floor of the held effort" not in words


@pytest.mark.slow
def test_the_fall_of_V_is_that_of_the_law() -> None:
    """In a run without sampling V' = -e_NᵀW K_N e_N: the two curves are one."""
    run = hsp.load_experiment("paper/3_equal_angles", "simulation.duration=1").run()
    figure = plots.diagnostics_figure(run, panels=["decay"])
    law, actual = (np.asarray(x.get_ydata()) for x in figure.axes[0].lines[:2])
    rows = slice(1, 50)  # before rounding; the first difference is one-sided
    np.testing.assert_allclose(actual[rows], law[rows], rtol=1e-4)


def test_colours_of_runs_are_none_of_joints() -> None:
    assert not set(palette.RUNS) & set(palette.SERIES)
    assert len(set(palette.RUNS)) == len(palette.RUNS)


@pytest.mark.slow
def test_a_narrow_figure_has_its_panels_one_below_the_other(
    logs: dict[str, hsp.Rollout],
) -> None:
    figure = plots.paper_figure(logs["rest"], width="84mm", times=[0.0, 0.1])
    assert figure.get_figwidth() == pytest.approx(84.0 / 25.4)
    assert figure.get_figheight() > 2.0 * figure.get_figwidth()
    assert not figure.texts  # heading and foot are the paper's


@pytest.mark.slow
def test_text_of_two_columns_has_6_pt_where_it_is_printed_84_mm_wide(
    logs: dict[str, hsp.Rollout], tmp_path: Path
) -> None:
    figure = plots.paper_figure(logs["rest"], width="117mm")
    plots.save_for_a_column(figure, tmp_path / "figure.png")
    height, width = imread(tmp_path / "figure.png").shape[:2]
    assert width == 992
    assert height < 2.0 * width
    shown = [text for text in figure.findobj(Text) if text.get_text()]
    assert len(shown) > 50
    assert min(text.get_fontsize() for text in shown) * 84.0 / 117.0 > 6.0


@pytest.mark.slow
def test_numbers_of_frames_do_not_overlap(logs: dict[str, hsp.Rollout]) -> None:
    end = float(logs["rest"].t[-1])
    close = [0.05 * end * (1.0 + k) for k in range(8)]
    figure = plots.paper_figure(logs["rest"], width="117mm", times=close)
    figure.canvas.draw()
    (upper,) = figure.axes[1].child_axes
    texts = [label.get_text() for label in upper.get_xticklabels()]
    boxes = [label.get_window_extent() for label in upper.get_xticklabels()]
    shown = [box for box, text in zip(boxes, texts, strict=True) if text]
    assert (texts[0], texts[-1]) == ("1", "8")
    assert 2 < len(shown) < 8
    assert all(a.x1 < b.x0 for a, b in itertools.pairwise(shown))
