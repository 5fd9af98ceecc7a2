"""Parse the command line, run one command, and turn every error into one message."""

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from hsp_control.cli.interrupts import INTERRUPTED, end_in_order
from hsp_control.cli.options import AddedCommand, command_line
from hsp_control.cli.streams import lost_text, make_usable
from hsp_control.common.errors import HspControlError

_OWN_FILES = {"check", "doctor", "freeze", "live"}
"""Commands with their own file; `commands` has the others."""
_PACKAGES = {"libgomp.so.1": "libgomp1 (Debian, Ubuntu) or libgomp (Fedora)"}
"""The system package of a library that the wheels of our dependencies expect."""
FAILURE = 2
"""Exit status after any error."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``hsp``: status 0, 2 after one clear message, 130 after Ctrl-C."""
    make_usable()
    parser = command_line()
    if "_ARGCOMPLETE" in os.environ:  # a shell requests completions
        import argcomplete

        argcomplete.autocomplete(parser)
    try:
        options = parser.parse_args(arguments)
    except SystemExit as ended:  # after --help or --version, or a mistake
        if ended.code or not _told_lost_text():
            raise
        return FAILURE
    if options.command is None:
        parser.print_help()
        return FAILURE if _told_lost_text() else 0
    try:
        # Commands are imported only when needed, so that `hsp --help` answers at once.
        from hsp_control.cli import consoles

        # Otherwise Ctrl-C ends the process at once, as during start-up: there is
        # nothing to save, and an exception may be lost in callbacks of libraries.
        added: AddedCommand | None = getattr(options, "added", None)
        if added is not None and added.own_interrupts:
            end_in_order()
        run = _function_of(options.command) if added is None else added.run
        from hsp_control.declaration.language import in_yaml

        with in_yaml(), consoles.warnings_printed():
            status = int(run(options))
        return FAILURE if _told_lost_text() else status
    except HspControlError as error:
        print(f"hsp: {consoles.message_of(error)}", file=sys.stderr)
    except (
        ImportError
    ) as error:  # Pinocchio's wheel links libraries that slim systems lack
        library, _, reason = str(error).partition(": ")
        if "shared object file" not in reason:
            raise
        advice = _PACKAGES.get(library, "the package of your system that has it")
        missing = f"hsp: {library} is missing on this system: install {advice}"
        print(missing, file=sys.stderr)
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename!s:.200}: "
        print(f"hsp: {where}{error.strerror or error}", file=sys.stderr)
    except MemoryError:
        print("hsp: not enough memory", file=sys.stderr)
    except KeyboardInterrupt:
        print("hsp: stopped by the user", file=sys.stderr)
        return INTERRUPTED
    except SystemExit as error:  # of user code; its status may be 0
        print(f"hsp: ended early by SystemExit({error.code!r})", file=sys.stderr)
    return FAILURE


def _told_lost_text() -> bool:
    """Report why standard output has lost text; return whether it has."""
    why = lost_text()
    if why:
        print(f"hsp: standard output: {why}", file=sys.stderr)
    return bool(why)


def _function_of(command: str) -> Any:
    """Return the function that runs a command; nothing else is imported."""
    file = command if command in _OWN_FILES else "commands"
    return getattr(import_module(f"hsp_control.cli.{file}"), command)
