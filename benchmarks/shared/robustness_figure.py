"""The figure of docs/measurements.md: every plant with every compensator."""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.image import AxesImage

from hsp_control.companions.plots import new_figure, save_for_a_column, styled
from shared.marked_sections import FIGURES

FILE = FIGURES / "robustness.png"
SHOWN = {"error": "task error [mm]", "e_N": r"$\Vert e_N \Vert$ [rad/s]"}
RANGES = {"error": (3e-3, 30.0), "e_N": (1e-3, 3.0)}
ROBOTS = {"panda": "Panda", "iiwa14": "iiwa 14"}
LABEL = 6.2  # font size of rows and columns, where a figure is 84 mm wide [pt]
LETTERS = 32  # of a row's name, above which it has two lines

Cells = dict[tuple[str, ...], dict[str, float]]


def draw_figure(cells: Cells, plants: dict[str, list[str]], columns: list[str]) -> None:
    """Draw and save the figure; its numbers are in the page's tables.

    Args:
        cells: The measurements, by robot, engine, plant and compensation.
        plants: The rows, by robot.
        columns: The compensations.
    """
    with styled():
        figure = new_figure(84.0 / 25.4, 7.4)
        panels = figure.subplots(2, 2)
        for row, (robot, title) in zip(panels, ROBOTS.items(), strict=True):
            for axes, measure in zip(row, SHOWN, strict=True):
                draw(axes, cells, robot, measure, plants[robot], columns)
                axes.set_title(title)
        for axes, measure in zip(panels[1], SHOWN, strict=True):
            image = axes.images[0]
            bar = figure.colorbar(image, ax=axes, location="bottom", aspect=12.0)
            bar.set_label(SHOWN[measure], fontsize=7.0)
            bar.ax.tick_params(labelsize=LABEL)
        for axes in panels[:, 1]:
            axes.set_yticklabels([])
        for axes in panels[0]:
            axes.set_xticklabels([])
        save_for_a_column(figure, FILE)
    print(f"Wrote {FILE}")


def draw(
    axes: Axes,
    cells: Cells,
    robot: str,
    measure: str,
    rows: list[str],
    columns: list[str],
) -> AxesImage:
    """Draw one arm's measure on Pinocchio's plant, or else on MuJoCo's."""
    values = np.full((len(rows), len(columns)), np.nan)
    for i, name in enumerate(rows):
        for j, column in enumerate(columns):
            for engine in ("MuJoCo", "Pinocchio"):
                if (found := cells.get((robot, engine, name, column))) is not None:
                    values[i, j] = found[measure]
    low, high = RANGES[measure]
    image = axes.imshow(
        np.clip(values, low, high),
        cmap="Blues",  # dark is large, in grey too
        norm=LogNorm(0.3 * low, high),  # no cell as pale as the paper
        aspect="auto",
    )
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=LABEL)
    names = [textwrap.fill(name, LETTERS) for name in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=LABEL, linespacing=0.9)
    axes.grid(visible=False)
    axes.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
    axes.set_yticks(np.arange(len(rows) - 1) + 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=1.0)
    axes.tick_params(which="minor", length=0)
    return image
