"""What a companion adds to the command line; entry points name it, no import does."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NamedTuple

from hsp_control.common.entry_points import entry_points


class AddedCommand(NamedTuple):
    """A command: an entry point of ``hsp_control.commands`` with the command's name.

    Its module is imported for every help text: what is slow is imported by `run`.

    Attributes:
        help: What it does, in a line.
        add_options: Adds its options to its parser.
        run: Runs it; returns the exit status.
        own_interrupts: Whether it ends in order at Ctrl-C, instead of at once.
        place: Where the help lists it: below zero before `hsp live`, smaller first.
    """

    help: str
    add_options: Callable[[argparse.ArgumentParser], object]
    run: Callable[[argparse.Namespace], int]
    own_interrupts: bool = False
    place: int = 0


class CommandPage(NamedTuple):
    """A page that shows what `hsp run` or `hsp live` does.

    It is an entry point of ``hsp_control.pages`` with the command's name, and imported
    as an `AddedCommand` is.

    Attributes:
        add_options: Adds its options to the command's parser.
        open: Opens it, given the options and what the command is about: a context with
            what the command tells, or None if the options ask for no page.
    """

    add_options: Callable[[argparse.ArgumentParser], object]
    open: Callable[..., AbstractContextManager[Any]]


def added_commands() -> list[tuple[str, AddedCommand]]:
    """Return the commands that companions and other packages add, in their order."""
    return sorted(loaded("commands"), key=lambda each: each[1].place)


def add_page(command: str, parser: argparse.ArgumentParser) -> None:
    """Add the options of a command's page, if a companion has one."""
    page: CommandPage | None = dict(loaded("pages")).get(command)
    if page is not None:
        page.add_options(parser)
    parser.set_defaults(open_page=page.open if page else lambda *_: nullcontext())


def loaded(group: str) -> Iterator[tuple[str, Any]]:
    """Yield what can be imported; what cannot is told, and stops no other command."""
    for name, entry in sorted(entry_points(group).items()):
        try:
            yield name, entry.load()
        except (ImportError, AttributeError) as error:
            told = f"hsp: {name!r} cannot be imported from {entry.value}: {error}"
            print(told, file=sys.stderr)
