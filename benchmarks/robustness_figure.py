"""Draw the figure of docs/measurements.md: every plant with every compensator.

.venv/bin/python benchmarks/robustness_figure.py
"""

import numpy as np
from marked_sections import FIGURES
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.image import AxesImage
from robustness import COLUMNS, ROWS, means

from hsp_control.companions.plots import new_figure, styled
from hsp_control.companions.plots.palette import INK

FILE = FIGURES / "robustness.png"
SHOWN = {"error": "task error [mm]", "e_N": "‖e_N‖ [rad/s]"}
RANGES = {"error": (3e-3, 30.0), "e_N": (1e-3, 3.0)}
ROBOTS = {"panda": "Panda", "iiwa14": "iiwa 14"}


def main() -> None:
    """Draw and save the figure."""
    cells = means()
    with styled():
        figure = new_figure(13.0, 11.5)
        panels = figure.subplots(2, 2)
        for row, (robot, title) in zip(panels, ROBOTS.items(), strict=True):
            for axes, measure in zip(row, SHOWN, strict=True):
                image = draw(axes, cells, robot, measure)
                axes.set_title(f"{title}: {SHOWN[measure]}")
                figure.colorbar(image, ax=axes, shrink=0.8)
        for axes in panels[:, 1]:
            axes.set_yticklabels([])
        for axes in panels[0]:
            axes.set_xticklabels([])
        figure.savefig(FILE, dpi=95)
    print(f"Wrote {FILE}")


def draw(
    axes: Axes,
    cells: dict[tuple[str, ...], dict[str, float]],
    robot: str,
    measure: str,
) -> AxesImage:
    """Draw one arm's measure on Pinocchio's plant, or else on MuJoCo's."""
    rows = [row.name for row in ROWS if row.robot in (None, robot)]
    values = np.full((len(rows), len(COLUMNS)), np.nan)
    for i, name in enumerate(rows):
        for j, column in enumerate(COLUMNS):
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
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            color = "white" if image.norm(value) > 0.65 else INK
            text = f"{value:.2g}".removeprefix("0")
            axes.text(j, i, text, ha="center", va="center", fontsize=9, color=color)
    axes.set_xticks(range(len(COLUMNS)), [*COLUMNS], rotation=35, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.grid(visible=False)
    axes.set_xticks(np.arange(len(COLUMNS) - 1) + 0.5, minor=True)
    axes.set_yticks(np.arange(len(rows) - 1) + 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=1.0)
    axes.tick_params(which="minor", length=0)
    return image


if __name__ == "__main__":
    main()
