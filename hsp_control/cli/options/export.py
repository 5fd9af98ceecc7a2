"""The options of ``hsp export``."""

import argparse
from pathlib import Path

from hsp_control.cli.options.companions import export_formats
from hsp_control.cli.options.shared import add_strict


def add_export(export: argparse.ArgumentParser) -> None:
    """Add all options of `hsp export`."""
    export.add_argument(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help="written by hsp run; several logs make one page with a switch",
    )
    add_strict(export)
    export.add_argument(
        "--html",
        type=Path,
        metavar="FILE",
        help="a page that plays offline, with the plots",
    )
    for added in export_formats():
        for ending, text in added.files.items():
            export.add_argument(f"--{ending}", type=Path, metavar="FILE", help=text)
        added.add_options(export)
