"""``hsp plot`` and its options; slow modules are imported when it runs."""

import argparse
import re
from pathlib import Path

from hsp_control.cli.options import AddedCommand, add_import


def _add_options(plot: argparse.ArgumentParser) -> None:
    plot.add_argument(
        "logs",
        nargs="+",
        type=Path,
        metavar="LOG",
        help="a log of any run; several are drawn in the same panels",
    )
    plot.add_argument("--out", type=Path, metavar="DIR", help="default: beside the log")
    plot.add_argument(
        "-o",
        dest="file",
        type=Path,
        metavar="FILE",
        help="draw one figure into this file; the format follows from its ending",
    )
    plot.add_argument(
        "--names",
        default="",
        metavar="NAME,...",
        help="names of the logs, in their order; $K_N$ is mathematics",
    )
    plot.add_argument(
        "--format",
        action="append",
        choices=["png", "pdf", "svg"],
        dest="formats",
        help="may be given more than once; default: png",
    )
    plot.add_argument(
        "--panels",
        default="",
        metavar="NAME,...",
        help="draw these only, such as errors,null_space; another name lists all",
    )
    plot.add_argument(
        "--width", metavar="84mm", help="for a paper, without heading and foot"
    )
    plot.add_argument(
        "--times",
        type=_times,
        metavar="T,...",
        help="of the frames in the first figure [s]; default: eight, evenly",
    )
    plot.add_argument(
        "--relative",
        action="store_true",
        help="draw joint angles, not absolute ones, where the robot has both",
    )
    add_import(plot)
    plot.set_defaults(strict=False, allow=[])


def _plot(options: argparse.Namespace) -> int:
    """Draw the figures of logs, or of a file whose ending a companion supports."""
    from hsp_control.cli.commands import file_name
    from hsp_control.cli.consoles import out, working
    from hsp_control.cli.loading import run_imports
    from hsp_control.common.entry_points import entry_points
    from hsp_control.common.errors import PlotError
    from hsp_control.companions import plots
    from hsp_control.simulation import Rollout

    run_imports(options)
    first = options.logs[0]
    others = entry_points("plots")
    if other := others.get(first.suffix.removeprefix(".")):
        return int(other.load()(options))
    file, logs = options.file, options.logs
    if file is not None and (options.out or options.formats):
        raise PlotError("-o names the file and its format; leave out --out, --format")
    names = [name.strip() for name in options.names.split(",") if name.strip()]
    if names and len(names) != len(logs):
        plural = "" if len(logs) == 1 else "s"
        raise PlotError(f"--names has {len(names)} names for {len(logs)} log{plural}")
    if not names and logs == sorted(logs):  # as a shell expands *: 16, 2, 8
        logs = sorted(logs, key=_numerically)
    runs = [Rollout.load(log) for log in logs]
    folder, formats = options.out or first.parent, options.formats or ["png"]
    stems = plots.differing([log.stem for log in logs])
    panels, absolute = re.findall(r"[^,\s]+", options.panels), not options.relative
    with working("Drawing"):
        if runs[1:] or panels or file:
            figure = plots.diagnostics_figure(
                *runs,
                names=names or stems,
                panels=panels,
                width=options.width,
                absolute=absolute,
            )
            stem = "-".join([logs[0].stem, *stems[1:], *(panels or ["diagnostics"])])
            where = folder / file_name(stem)
            if file is not None:
                where, formats = file.with_suffix(""), [file.suffix.removeprefix(".")]
            files = plots.save_figure(figure, where, formats)
        else:
            files = plots.save_figures(
                *(runs[0], folder, logs[0].stem, formats),
                absolute=absolute,
                width=options.width,
                times=options.times,
            )
    for file in files:
        out.print(f"Figure: {file}")
    for name, log in zip(names, logs, strict=False):  # a shell chose the order
        out.print(f"{name}: {log}", markup=False)
    return 0


def _times(text: str) -> list[float]:
    """Return the times of frames [s]; the parser refuses text that is not a number."""
    return [float(part) for part in text.split(",")]


def _numerically(log: Path) -> list[tuple[bool, float, str]]:
    """Return a key that orders names by the numbers in them: 2, 8, 16."""
    parts = re.split(r"(\d+(?:\.\d+)?)", str(log.with_suffix("")))
    return [(k % 2 == 0, float(x) if k % 2 else 0.0, x) for k, x in enumerate(parts)]


PLOT = AddedCommand(
    help="draw the figures of a log, or several together",
    add_options=_add_options,
    run=_plot,
    place=-2,
)
