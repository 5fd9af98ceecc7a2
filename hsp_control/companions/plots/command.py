"""``hsp plot`` and its options; what is slow is imported when it runs."""

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
        help="written by hsp run; several are drawn in the same panels",
    )
    plot.add_argument("--out", type=Path, metavar="DIR", help="default: beside the log")
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
        "--relative",
        action="store_true",
        help="draw joint angles, not absolute ones, where the robot has both",
    )
    add_import(plot)
    plot.set_defaults(strict=False, allow=[])


def _plot(options: argparse.Namespace) -> int:
    """Draw the figures of logs, or of a file whose ending a companion knows."""
    from hsp_control.cli.commands import file_name
    from hsp_control.cli.consoles import out, working
    from hsp_control.cli.loading import run_imports
    from hsp_control.common.entry_points import entry_points
    from hsp_control.companions import plots
    from hsp_control.simulation import Rollout

    run_imports(options)
    first = options.logs[0]
    others = entry_points("plots")
    if other := others.get(first.suffix.removeprefix(".")):
        return int(other.load()(options))
    runs = [Rollout.load(log) for log in options.logs]
    folder, formats = options.out or first.parent, options.formats or ["png"]
    names = [log.stem for log in options.logs]
    panels, absolute = re.findall(r"[^,\s]+", options.panels), not options.relative
    with working("Drawing"):
        if runs[1:] or panels or options.width:
            figure = plots.diagnostics_figure(
                *runs,
                names=names,
                panels=panels,
                width=options.width,
                absolute=absolute,
            )
            stem = f"{'+'.join(names)}-{'-'.join(panels) or 'diagnostics'}"
            files = plots.save_figure(figure, folder / file_name(stem), formats)
        else:
            files = plots.save_figures(
                runs[0], folder, names[0], formats, absolute=absolute
            )
    for file in files:
        out.print(f"Figure: {file}")
    return 0


PLOT = AddedCommand(
    help="draw the figures of a log, or several together",
    add_options=_add_options,
    run=_plot,
    place=-2,
)
