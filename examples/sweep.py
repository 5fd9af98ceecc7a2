"""Which gain keeps the links from a disk? Run one configuration many times."""

from pathlib import Path

import hsp_control as hsp

found = hsp.sweeps.sweep(
    "paper/4_moving_obstacle",
    {"null_space.gain": "log:1:100:9"},
    overrides=["simulation.duration=2"],
    out="out/sweep.parquet",
)
columns = ("null_space.gain", "null_space_error.rms", "distance.point_distance.min")
for k, e, d in zip(*(found[name] for name in columns), strict=True):
    print(f"K_N = {k:6.2f} 1/s: |e_N| {e:.4f} rad/s rms, {d:.4f} m away")

gain, error, distance = (found[name] for name in columns)
with hsp.plots.styled():
    figure = hsp.plots.new_figure(4.6, 3.4)
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.loglog(gain, error, "o-")
    upper.set(ylabel=r"rms $\Vert e_N \Vert$ [rad/s]", title="Null-space error")
    lower.semilogx(gain, 1e3 * distance, "o-", color="C1")
    lower.set(xlabel="$K_N$ [1/s]", ylabel="distance [mm]", title="Nearest to the disk")
hsp.plots.save_for_a_column(figure, Path("out/sweep.png"))
