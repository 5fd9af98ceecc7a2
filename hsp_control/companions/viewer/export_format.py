"""What other companions add to ``hsp export``; entry points name it."""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hsp_control.cli.options import loaded

if TYPE_CHECKING:
    from hsp_control.companions.viewer.comparison import ComparedRun


class ExportFormat(NamedTuple):
    """Formats of ``hsp export`` for one run: an entry point of ``hsp_control.exports``.

    Attributes:
        what: What such a file is called in a message, as in "a film".
        files: The endings, which are the names of options, and what each is.
        add_options: Adds the other options to the parser of `hsp export`.
        write: Writes a file and returns its path, given the run, the path, the options
            and what takes the share that is done.
    """

    what: str
    files: Mapping[str, str]
    add_options: Callable[[argparse.ArgumentParser], object]
    write: Callable[
        ["ComparedRun", Path, argparse.Namespace, Callable[[float], None]], Path
    ]


def export_formats() -> list[ExportFormat]:
    """Return the formats that companions and other packages add to `hsp export`."""
    return [each for _, each in loaded("exports")]
