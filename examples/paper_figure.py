"""A figure for a paper: the null-space error of three gains beside its theorem."""

from pathlib import Path

import hsp_control as hsp

moving = "paper/4_moving_obstacle", "simulation.duration=2"
gains = [4.0, 10.0, 25.0]
runs = [hsp.load_experiment(*moving, f"null_space.gain={k}").run() for k in gains]
figure = hsp.plots.diagnostics_figure(
    *runs,
    names=[f"$K_N = {k:g}$ 1/s" for k in gains],
    panels=["null_space", "decay"],
    width="170mm",  # two columns; of one, 84mm, the panels are one below the other
)
Path("out").mkdir(exist_ok=True)
for ending in ("pdf", "png"):
    figure.savefig(f"out/paper_figure.{ending}", dpi=200)
for gain, run in zip(gains, runs, strict=True):
    run.save(f"out/paper_figure_{gain:g}.npz")
print("Figure: out/paper_figure.pdf")
