"""What a companion adds to the command line; entry points name it, no import does."""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hsp_control.common.entry_points import entry_points

if TYPE_CHECKING:
    from hsp_control.companions.viewer.comparison import ComparedRun


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
    """Return the commands that companions and other packages add, by name."""
    return dict(_loaded("commands"))


def export_formats() -> list[ExportFormat]:
    """Return the formats that companions and other packages add to `hsp export`."""
    return [each for _, each in _loaded("exports")]


def _loaded(group: str) -> Iterator[tuple[str, Any]]:
    """Yield what can be imported; what cannot is told, and stops no other command."""
    for name, entry in sorted(entry_points(group).items()):
        try:
            yield name, entry.load()
        except (ImportError, AttributeError) as error:
            told = f"hsp: {name!r} cannot be imported from {entry.value}: {error}"
            print(told, file=sys.stderr)
