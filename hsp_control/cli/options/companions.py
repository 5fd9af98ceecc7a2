"""What a companion adds to the command line; entry points name it, no import does."""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hsp_control.common.entry_points import entry_points

if TYPE_CHECKING:
    from hsp_control.visualization.viewer.comparison import ComparedRun


class AddedCommand(NamedTuple):
    """A command: an entry point of ``hsp_control.commands`` with the command's name.

    Its module is imported for every help text: what is slow is imported by `run`.

    Attributes:
        help: What it does, in a line.
        add_options: Adds its options to its parser.
        run: Runs it; returns the exit status.
        own_interrupts: Whether it ends in order at Ctrl-C, instead of at once.
    """

    help: str
    add_options: Callable[[argparse.ArgumentParser], object]
    run: Callable[[argparse.Namespace], int]
    own_interrupts: bool = False


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


def added_commands() -> dict[str, AddedCommand]:
    """Return the commands that companions add, by name."""
    found = entry_points("commands")
    return {name: found[name].load() for name in sorted(found)}


def export_formats() -> list[ExportFormat]:
    """Return the formats that companions add to `hsp export`."""
    found = entry_points("exports")
    return [found[name].load() for name in sorted(found)]
