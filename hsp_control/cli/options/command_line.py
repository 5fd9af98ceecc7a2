"""All commands and their options; nothing slow is imported: help comes at once."""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from hsp_control.cli.options.companions import (
    AddedCommand,
    add_page,
    added_commands,
)
from hsp_control.cli.options.shared import (
    add_configuration,
    add_import,
    add_strict,
    complete,
)
from hsp_control.common.resources import bundled_robots
from hsp_control.common.suggestions import did_you_mean
from hsp_control.common.version import __version__


class Parser(argparse.ArgumentParser):
    """An `argparse.ArgumentParser` for commands and for their options."""

    def __init__(self, *args: Any, **options: Any) -> None:
        # By their full names: ``--st`` is no ``--strict``.
        super().__init__(*args, **{"allow_abbrev": False, **options})

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Parse, and refuse here what a command does not know."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            options = [name for name in unknown if name.startswith("-")]
            if not options:
                self.error(f"{unknown[0]!r} is one argument too many")
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
    _add([each for each in added if each[1].place < 0], commands)
    add_live(_command(commands, "live", "control a simulated robot in another process"))

    _add([each for each in added if each[1].place >= 0], commands)

    robots = _command(
        commands, "robots", "list the robots that can be loaded, or describe one"
    )
    which = robots.add_mutually_exclusive_group()
    name = which.add_argument(
        "name", nargs="?", metavar="ROBOT", help="a name or a URDF"
    )
    complete(name, bundled_robots)
    which.add_argument("--json", action="store_true", help="print JSON")

    add_inspect(
        _command(commands, "inspect", "say what is odd about a robot's URDF or MJCF")
    )
    doctor = _command(commands, "doctor", "say what this machine lacks")
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
    added: Sequence[tuple[str, AddedCommand]],
    commands: "argparse._SubParsersAction[Parser]",
) -> None:
    """Add commands of companions."""
    for name, each in added:
        command = _command(commands, name, each.help)
        command.set_defaults(added=each)
        each.add_options(command)


def add_inspect(inspect: argparse.ArgumentParser) -> None:
    """Add all options of `hsp inspect`."""
    robot = inspect.add_argument(
        "robot", metavar="ROBOT", help="a name, a URDF, a xacro file or an MJCF"
    )
    complete(robot, bundled_robots)
    inspect.add_argument(
        "args", nargs="*", metavar="NAME:=VALUE", help="arguments of a xacro file"
    )
    inspect.add_argument(
        "--fix",
        type=Path,
        metavar="FILE",
        help="write a URDF whose inertias are the nearest that a body can have",
    )
    inspect.add_argument("--json", action="store_true", help="print JSON")
    add_strict(inspect)


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
        help="tell the state: udp://HOST:PORT to a policy, ros2://NAME to watchers",
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
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    live.add_argument(
        "--priority",
        type=int,
        metavar="LEVEL",
        help="real-time priority of the loop (SCHED_FIFO), 1 to 99",
    )
    add_page("live", live)
