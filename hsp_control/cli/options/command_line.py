"""All commands and their options; nothing slow is imported: help comes at once."""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from hsp_control.cli.options.companions import added_commands, export_formats
from hsp_control.cli.options.shared import (
    add_configuration,
    add_host,
    add_import,
    add_page,
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
    run.add_argument(
        "--view",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="show the run in a browser, while it is computed and after",
    )
    run.add_argument("--json", action="store_true", help="print the summary as JSON")
    add_page(run)

    check = _command(commands, "check", "check a configuration without running it")
    add_configuration(check)
    add_import(check)
    check.add_argument("--json", action="store_true", help="print the summary as JSON")

    play = _command(commands, "play", "touch a simulated robot in a browser")
    add_configuration(play, "a robot's name, or ")
    add_import(play)
    play.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    add_host(play)
    add_page(play)

    view = _command(commands, "view", "play logs in a browser, one or several together")
    view.add_argument(
        "logs", nargs="+", type=Path, metavar="LOG", help="a log written by hsp run"
    )
    where = view.add_mutually_exclusive_group()
    where.add_argument(
        "--beside",
        action="store_true",
        default=None,
        help="show several side by side; the default where their robots differ",
    )
    where.add_argument(
        "--overlay",
        action="store_false",
        dest="beside",
        help="show several over each other, all but the first as ghosts",
    )
    view.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help="playback speed, 1 is real time; default: as the log says",
    )
    view.add_argument(
        "--loop",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="repeat the run; default: as the log says",
    )
    add_page(view)
    add_strict(view)

    plot = _command(commands, "plot", "draw the figures of a log, or several together")
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

    add_export(_command(commands, "export", "write logs as a page, or one as a film"))
    add_live(_command(commands, "live", "control a simulated robot in another process"))

    for called, added in added_commands().items():
        command = _command(commands, called, added.help)
        command.set_defaults(added=added)
        added.add_options(command)

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
    live.add_argument(
        "--steer",
        nargs="?",
        choices=("simulated", "hardware"),
        const="simulated",
        help="show a page that steers: drag targets and obstacles, turn settings; with "
        "hardware, the robot moves only while a key is held on the page",
    )
    add_host(live)
    add_page(live)
