"""Which gain keeps the links from a disk? Run one configuration many times."""

from matplotlib.figure import Figure

import hsp_control as hsp

found = hsp.sweeps.sweep(
    "paper/4_moving_obstacle",
    {"null_space.gain": "log:1:100:9"},
    overrides=["simulation.duration=2"],
    out="out/sweep.parquet",
)
columns = ("null_space.gain", "null_space_error.rms", "distance.point_distance.min")
for gain, error, distance in zip(*(found[name] for name in columns), strict=True):
    print(f"K_N = {gain:6.2f} 1/s: |e_N| {error:.4f} rad/s rms, {distance:.4f} m away")

figure = Figure(figsize=(4.8, 3.2), layout="constrained")
axes = figure.subplots()
axes.loglog(found["null_space.gain"], found["null_space_error.rms"], "o-")
axes.set(xlabel="K_N [1/s]", ylabel="rms of |e_N| [rad/s]")
figure.savefig("out/sweep.png")
