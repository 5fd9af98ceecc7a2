"""All commands and their options; nothing slow is imported: help comes at once."""

import argparse
from pathlib import Path

from hsp_control.cli.options.companions import added_commands
from hsp_control.cli.options.export import add_export
from hsp_control.cli.options.inspect import add_inspect
from hsp_control.cli.options.live import add_live
from hsp_control.cli.options.parser import Parser
from hsp_control.cli.options.shared import (
    add_configuration,
    add_host,
    add_page,
    add_strict,
    complete,
)
from hsp_control.common.resources import bundled_robots
from hsp_control.common.version import __version__


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
    check.add_argument("--json", action="store_true", help="print the summary as JSON")

    play = _command(commands, "play", "touch a simulated robot in a browser")
    add_configuration(play, "a robot's name, or ")
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

    plot = _command(commands, "plot", "draw the figures of a log")
    plot.add_argument(
        "log",
        type=Path,
        metavar="LOG",
        help="written by hsp run",
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
    which.add_argument("--markdown", action="store_true", help="print docs/robots.md")

    add_inspect(_command(commands, "inspect", "say what is odd about a robot's URDF"))
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
