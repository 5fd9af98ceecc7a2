"""All commands and their options; nothing slow is imported, for instant help.

Additions of companions are found by entry points, not by imports.
"""

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from hsp_control.common.entry_points import entry_points
from hsp_control.common.resources import bundled_configs, bundled_robots
from hsp_control.common.suggestions import did_you_mean
from hsp_control.common.version import __version__


class Parser(argparse.ArgumentParser):
    """An `argparse.ArgumentParser` for commands and for their options."""

    def __init__(self, *args: Any, **options: Any) -> None:
        # By their full names: ``--st`` is not ``--strict``.
        super().__init__(*args, **{"allow_abbrev": False, **options})

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Parse, and refuse here unknown arguments."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            options = [name for name in unknown if name.startswith("-")]
            if not options:
                known = self._option_string_actions
                name = next((x for x in ("--over", "--set") if x in known), None)
                hint = f"; did you mean {name} {unknown[0]}?" if name else ""
                hint = hint if "=" in unknown[0] else ""
                self.error(f"{unknown[0]!r} is one argument too many{hint}")
            hint = did_you_mean(options[0].split("=")[0], self._option_string_actions)
            self.error(f"there is no {options[0]!r} here{hint}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Print the message and exit with 2; a mistyped command is guessed."""
        mistyped = re.search(r"argument COMMAND: invalid choice: '(.*?)'", message)
        if mistyped is not None:
            commands = next(
                action.choices
                for action in self._actions
                if isinstance(action, argparse._SubParsersAction)
            )
            name = mistyped[1]
            message = (
                f"there is no command {name!r}{did_you_mean(name, commands)} "
                "(hsp --help lists all)"
            )
        super().error(message)


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = Parser(
        prog="hsp",
        description="Torque control of redundant robots with a null space that "
        "provably converges.",
        epilog='completion in bash and zsh: eval "$(register-python-argcomplete hsp)"; '
        "in fish: register-python-argcomplete --shell fish hsp | source",
    )
    parser.add_argument("--version", action="version", version=f"hsp {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")

    run = _command(commands, "run", "simulate a configuration and write its log")
    add_configuration(run)
    add_import(run)
    run.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    run.add_argument("--json", action="store_true", help="print the summary as JSON")
    add_page("run", run)

    check = _command(commands, "check", "check a configuration without running it")
    add_configuration(check)
    add_import(check)
    check.add_argument("--json", action="store_true", help="print the summary as JSON")

    added = added_commands()
    _add(commands, added, -1)
    add_live(_command(commands, "live", "control a simulated robot in another process"))

    _add(commands, added, 0)

    add_freeze(
        _command(commands, "freeze", "write a controller for a program without Python")
    )

    robots = _command(
        commands, "robots", "list the robots that can be loaded, or describe one"
    )
    which = robots.add_mutually_exclusive_group()
    name = which.add_argument(
        "name", nargs="?", metavar="ROBOT", help="a name or a URDF"
    )
    complete(name, bundled_robots)
    which.add_argument("--json", action="store_true", help="print JSON")

    _add(commands, added, 1)
    doctor = _command(commands, "doctor", "check this machine and installation")
    doctor.add_argument("--json", action="store_true", help="print JSON")
    _command(commands, "schema", "print the JSON Schema of a configuration")
    return parser


def _command(
    commands: "argparse._SubParsersAction[Parser]", name: str, text: str
) -> Parser:
    return commands.add_parser(
        name, help=text, description=text[:1].upper() + text[1:] + "."
    )


def _add(
    commands: "argparse._SubParsersAction[Parser]",
    added: "Sequence[tuple[str, AddedCommand]]",
    side: int,
) -> None:
    """Add the commands of companions whose place is on a side of zero."""
    for name, each in added:
        if (each.place > 0) - (each.place < 0) == side:
            command = _command(commands, name, each.help)
            command.set_defaults(added=each)
            each.add_options(command)


def add_live(live: argparse.ArgumentParser) -> None:
    """Add all options of `hsp live`."""
    add_configuration(live)
    add_import(live)
    live.add_argument(
        "--robot",
        metavar="NAME://ADDRESS",
        help="franka://ADDRESS, or another robot that an installed package can reach; "
        "default: a simulated one",
    )
    live.add_argument(
        "--publish",
        metavar="NAME://ADDRESS",
        help="publish the state: udp://HOST:PORT to a policy, ros2://NAME to ROS 2",
    )
    live.add_argument(
        "--cameras",
        metavar="NAME://ADDRESS",
        help="show a MuJoCo scene's cameras: http://HOST:PORT has pictures /CAMERA.jpg",
    )
    live.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help="default: the configuration's; inf: until Ctrl-C",
    )
    live.add_argument(
        "--faults",
        default="",
        metavar="KIND=P,...",
        help="probabilities of late, lost, duplicated and corrupted packets, in both "
        "directions; delay=PACKETS of late ones, and seed=N",
    )
    live.add_argument(
        "--lockstep",
        action="store_true",
        help="loop and robot wait for each other: on a busy computer, in a debugger",
    )
    live.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    live.add_argument(
        "--priority",
        type=int,
        metavar="LEVEL",
        help="real-time priority of the loop (SCHED_FIFO), 1 to 99",
    )
    add_page("live", live)


def add_freeze(freeze: argparse.ArgumentParser) -> None:
    """Add all options of `hsp freeze`."""
    add_configuration(freeze, default="")
    add_import(freeze)
    freeze.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    freeze.add_argument(
        "--payload",
        action="append",
        metavar="FRAME",
        help="a frame that may carry a payload; default: those of the tasks",
    )
    freeze.add_argument(
        "--presence",
        action="append",
        default=[],
        metavar="TASK",
        help="a task that comes and goes, by an input",
    )
    where = freeze.add_mutually_exclusive_group()
    for name, what in (
        ("--cmake-dir", "the folder that CMake's find_package(hsp_step) needs"),
        ("--flags", "the flags of cc for hsp_step.h and its library"),
    ):
        where.add_argument(name, action="store_true", help=f"print {what}, and end")


# --- common options -------------------------------------------------------


def add_configuration(
    parser: argparse.ArgumentParser, or_else: str = "", default: str | None = None
) -> None:
    """Add a command's configuration, and the options that change it."""
    config = parser.add_argument(
        "config",
        nargs=None if default is None else "?",
        default=default,
        metavar="CONFIG",
        help=f"{or_else}a bundled name such as paper/4_moving_obstacle, a YAML file, "
        "or a log",
    )
    complete(config, bundled_configs)
    add_overrides(parser)
    add_strict(parser)


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """Add `--set`."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="overrides",
        metavar="KEY=VALUE",
        help="override a value, such as simulation.duration=2; may be repeated",
    )


def add_strict(parser: argparse.ArgumentParser) -> None:
    """Add the options of the files that a configuration may name."""
    parser.add_argument(
        "--strict",
        action="store_true",
        help="for untrusted files: read only files beside them and bundled ones, and "
        "accept only types of this package",
    )
    parser.add_argument(
        "--allow",
        action="append",
        default=[],
        type=Path,
        metavar="DIR|PACKAGE",
        help="another folder to read from, or a package whose types are accepted; "
        "implies --strict; may be repeated",
    )


def add_import(parser: argparse.ArgumentParser) -> None:
    """Add the option for Python code to import first."""
    parser.add_argument(
        "--import",
        action="append",
        default=[],
        dest="imports",
        metavar="FILE.py|MODULE",
        help="import this Python code first, whose functions and types a "
        "configuration may name: it may do anything, so not with --strict; may "
        "be repeated",
    )


def complete(action: argparse.Action, names: Callable[[], Iterable[str]]) -> None:
    """Have shells complete an argument by names and by files."""

    def completer(prefix: str, **_: object) -> list[str]:
        from argcomplete.completers import FilesCompleter

        files = FilesCompleter(("yaml", "npz", "urdf", "xacro"))(prefix)
        return [*(name for name in names() if name.startswith(prefix)), *files]

    vars(action)["completer"] = completer


# --- additions of companions
# --------------------------------------------------------------


class AddedCommand(NamedTuple):
    """A command: an entry point of ``hsp_control.commands`` with the command's name.

    Its module is imported for every help text: slow modules are imported by `run`.

    Attributes:
        help: Its description, in a line.
        add_options: Adds its options to its parser.
        run: Runs it; returns the exit status.
        own_interrupts: Whether it ends in order at Ctrl-C, instead of at once.
        place: Its position in the help, smaller first: below zero before `hsp live`,
            above zero after `hsp robots`.
    """

    help: str
    add_options: Callable[[argparse.ArgumentParser], object]
    run: Callable[[argparse.Namespace], int]
    own_interrupts: bool = False
    place: int = 0


class CommandPage(NamedTuple):
    """A page that shows a run of `hsp run` or `hsp live`.

    It is an entry point of ``hsp_control.pages`` with the command's name, and imported
    as an `AddedCommand` is.

    Attributes:
        add_options: Adds its options to the command's parser.
        open: Opens it, given the options and the command's subject: a context with the
        command's outputs, or None if the options open no page.
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
    """Yield importable entry points; failures are reported and stop no other."""
    for name, entry in sorted(entry_points(group).items()):
        try:
            yield name, entry.load()
        except (ImportError, AttributeError) as error:
            message = f"hsp: {name!r} cannot be imported from {entry.value}: {error}"
            print(message, file=sys.stderr)
