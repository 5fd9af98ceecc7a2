"""Parse the command line, run one command, and turn every error into one message."""

import argparse
import os
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from hsp_control.cli.franka_box_options import add_box_options
from hsp_control.cli.franka_model_options import add_model_options
from hsp_control.cli.startup import end_quietly, is_command
from hsp_control.common.exceptions import HspControlError
from hsp_control.common.resources import bundled_configs, bundled_robots
from hsp_control.common.version import __version__

_OWN_INTERRUPTS = {"bench", "export", "play", "sweep", "view"}
"""Commands that must close processes and pages, or save rows, at Ctrl-C."""
FAILURE = 2
"""Exit status after any error."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``hsp`` and return its exit status: 0, or 2 after one clear message."""
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:  # a shell asks what may come next
        import argcomplete

        argcomplete.autocomplete(parser)
    options = parser.parse_args(arguments)
    if options.command is None:
        parser.print_help()
        return 0
    # For one state it is faster to run kernels as Python than to load machine code.
    plain = (
        options.command == "check"
        and is_command()
        and "NUMBA_DISABLE_JIT" not in os.environ
    )
    if plain:
        os.environ["NUMBA_DISABLE_JIT"] = "1"
    # Commands are imported only when needed, so that `hsp --help` answers at once.
    from hsp_control.cli import commands, consoles
    from hsp_control.cli.compiling import compiling_shown

    try:
        # With other commands Ctrl-C ends the process at once, as during start-up: there
        # is nothing to save, and an exception may get lost in callbacks of libraries.
        if (
            options.command in _OWN_INTERRUPTS or getattr(options, "view", False)
        ) and signal.getsignal(signal.SIGINT) is end_quietly:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        with compiling_shown(consoles.errors):
            command = options.command.replace("-", "_")
            return int(getattr(commands, command)(options))
    except HspControlError as error:
        print(f"hsp: {consoles.message_of(error)}", file=sys.stderr)
    except ArithmeticError:
        if not plain:
            raise
        # Python divides by zero where compiled kernels go on with inf: once more, so.
        command = [sys.executable, *sys.orig_argv[1:]]
        os.execve(command[0], command, {**os.environ, "NUMBA_DISABLE_JIT": "0"})
    except BrokenPipeError:  # `hsp schema | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        print(f"hsp: {where}{error.strerror or error}", file=sys.stderr)
    except MemoryError:
        print("hsp: not enough memory for what was asked", file=sys.stderr)
    except KeyboardInterrupt:
        print("hsp: stopped by the user", file=sys.stderr)
    return FAILURE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="hsp",
        description="Torque control of redundant robots with a null space that "
        "provably converges.",
        epilog='completion in bash and zsh: eval "$(register-python-argcomplete hsp)"',
    )
    parser.add_argument("--version", action="version", version=f"hsp {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")

    run = _command(commands, "run", "simulate a configuration and write its log")
    _add_configuration(run)
    run.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    run.add_argument(
        "--view",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="show the run in a browser, while it is computed and after",
    )
    _add_page(run)

    check = _command(commands, "check", "check a configuration without running it")
    _add_configuration(check)

    play = _command(commands, "play", "touch a simulated robot in a browser")
    _add_configuration(play, "a robot's name, or ")
    play.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    _add_host(play)
    _add_page(play)

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
    _add_page(view)
    _add_strict(view)

    plot = _command(commands, "plot", "draw the figures of a log or a sweep")
    plot.add_argument(
        "log", type=Path, metavar="LOG", help="written by hsp run (.npz) or hsp sweep"
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

    salvage = _command(
        commands, "salvage", "recover the complete rows of a truncated log"
    )
    salvage.add_argument("log", type=Path, metavar="LOG", help="a truncated log")
    salvage.add_argument(
        "--out", type=Path, metavar="FILE", help="default: LOG's name, -salvaged.npz"
    )

    _add_export(_command(commands, "export", "write logs as a page, or one as a film"))
    _add_sweep(_command(commands, "sweep", "run a configuration many times"))
    _add_bench(_command(commands, "bench", "measure a control loop on this machine"))
    _add_live(
        _command(commands, "live", "control a simulated robot in another process")
    )

    box = _command(
        commands, "franka-box", "serve libfranka's research interface, without a robot"
    )
    _add_configuration(box, "the arm: a robot's name, its URDF, ", "panda")
    add_box_options(box)

    model = _command(commands, "franka-model", "save a Franka arm's model as a URDF")
    _complete(add_model_options(model), bundled_robots)

    robots = _command(
        commands, "robots", "list the robots that can be loaded, or describe one"
    )
    which = robots.add_mutually_exclusive_group()
    name = which.add_argument(
        "name", nargs="?", metavar="ROBOT", help="a name or a URDF"
    )
    _complete(name, bundled_robots)
    which.add_argument("--markdown", action="store_true", help="print docs/robots.md")

    _add_inspect(_command(commands, "inspect", "say what is odd about a robot's URDF"))
    _command(commands, "schema", "print the JSON Schema of a configuration")
    return parser


def _command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    name: str,
    text: str,
) -> argparse.ArgumentParser:
    return commands.add_parser(name, help=text, description=text.capitalize() + ".")


def _add_inspect(inspect: argparse.ArgumentParser) -> None:
    robot = inspect.add_argument(
        "robot", metavar="ROBOT", help="a name, a URDF or a xacro file"
    )
    _complete(robot, bundled_robots)
    inspect.add_argument(
        "args", nargs="*", metavar="NAME:=VALUE", help="arguments of a xacro file"
    )
    inspect.add_argument(
        "--fix",
        type=Path,
        metavar="FILE",
        help="write a URDF whose inertias are the nearest that a body can have",
    )
    inspect.add_argument(
        "--html",
        type=Path,
        metavar="FILE",
        help="write a page: a picture of the robot, and beside it what is odd",
    )
    inspect.add_argument("--json", action="store_true", help="print JSON")
    _add_strict(inspect)


def _add_export(export: argparse.ArgumentParser) -> None:
    export.add_argument(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help="written by hsp run; several logs make one page with a switch",
    )
    _add_strict(export)
    files = {
        "html": "a page that plays offline, with the plots",
        "mp4": "a film",
        "gif": "an animated GIF",
        "webp": "an animated WebP: smaller than a GIF, in all its colours",
        "rrd": "a file for Rerun's viewer; needs the extra rerun",
    }
    for name, text in files.items():
        export.add_argument(f"--{name}", type=Path, metavar="FILE", help=text)
    export.add_argument(
        "--size",
        type=_picture_size,
        metavar="WxH",
        help="of films [pixels]; default: 1280x720, of GIF and WebP 800x450",
    )
    export.add_argument(
        "--fps",
        type=float,
        metavar="N",
        help="frames per second of films; default: 30, of GIF and WebP 20",
    )
    export.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="playback speed of films, 1 is real time; default: 1",
    )
    for name, which in (("from", "first"), ("to", "last")):
        export.add_argument(
            f"--{name}",
            type=float,
            dest=which,
            metavar="T",
            help=f"the {which} moment of films [s]; default: the run's",
        )
    for name in ("plots", "caption"):
        export.add_argument(
            f"--{name}",
            action=argparse.BooleanOptionalAction,
            default=True,
            help=f"show the {name} in films; default: yes",
        )


def _picture_size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, as 1280x720")
    return int(width), int(height)


def _add_host(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="the address of this computer at which another one, or a phone, opens the "
        "page; default: only this computer may",
    )


def _add_page(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--port",
        type=int,
        metavar="N",
        help="the page's port on this machine; default: the first free one from 7000",
    )
    parser.add_argument(
        "--browser",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="open the page in a browser; its address is printed in any case",
    )


def _add_sweep(sweep: argparse.ArgumentParser) -> None:
    _add_configuration(sweep)
    sweep.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="what is varied: a,b,c or LOW:HIGH:COUNT or log:LOW:HIGH:COUNT, or (with "
        "--samples) uniform:LOW:HIGH, loguniform:LOW:HIGH, normal:MEAN:DEVIATION, "
        "integers:LOW:HIGH; may be repeated",
    )
    sweep.add_argument(
        "--samples", type=int, metavar="N", help="runs; default: every combination"
    )
    sweep.add_argument(
        "--design",
        metavar="DESIGN",
        help="grid, random, latin_hypercube or sobol; default: grid without --samples, "
        "latin_hypercube with them",
    )
    sweep.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    sweep.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="a Parquet file; what is in it already is not computed again; default: "
        "out/NAME-sweep.parquet",
    )
    sweep.add_argument(
        "--fresh", action="store_true", help="ignore what the file holds already"
    )
    sweep.add_argument(
        "--time-limit",
        type=float,
        metavar="SECONDS",
        help="the longest computation of a run; default: any",
    )
    sweep.add_argument(
        "--workers", type=int, metavar="N", help="processes; default: one per core"
    )
    sweep.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="use the workers of this Dask scheduler, such as tcp://host:8786",
    )
    sweep.add_argument(
        "--plot", action="store_true", help="draw what was found, beside the file"
    )


def _add_bench(bench: argparse.ArgumentParser) -> None:
    bench.add_argument(
        "--latency",
        action="store_true",
        required=True,
        help="a real-time loop, and an empty one to compare with",
    )
    bench.add_argument(
        "config",
        nargs="?",
        default="panda_obstacle",
        metavar="CONFIG",
        help="as for hsp run; default: panda_obstacle",
    )
    _add_overrides(bench)
    _add_strict(bench)
    bench.add_argument(
        "--seconds", type=float, default=60.0, metavar="S", help="default: 60"
    )
    bench.add_argument(
        "--rate", type=float, default=1000.0, metavar="HZ", help="default: 1000"
    )
    bench.add_argument(
        "--priority",
        type=int,
        metavar="LEVEL",
        help="real-time priority (SCHED_FIFO), 1 to 99; needs the right to it",
    )
    bench.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the distributions (.png, ...)"
    )


def _add_live(live: argparse.ArgumentParser) -> None:
    _add_configuration(live)
    live.add_argument(
        "--robot",
        metavar="NAME://ADDRESS",
        help="franka://ADDRESS, or another robot that an installed package can reach; "
        "default: a simulated one",
    )
    live.add_argument("--publish", metavar="ros2://NAME", help="topics for watchers")
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
        "--kill",
        metavar="WHO=S",
        help="kill the process of the robot or of the controller after so long",
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
    _add_host(live)
    _add_page(live)


def _add_configuration(
    parser: argparse.ArgumentParser, or_else: str = "", default: str | None = None
) -> None:
    config = parser.add_argument(
        "config",
        nargs=None if default is None else "?",
        default=default,
        metavar="CONFIG",
        help=f"{or_else}a bundled name such as paper/4_moving_obstacle, a YAML file, "
        "or a log",
    )
    _complete(config, bundled_configs)
    _add_overrides(parser)
    _add_strict(parser)


def _complete(action: argparse.Action, names: Callable[[], Iterable[str]]) -> None:
    """Have shells complete an argument by names and by files."""

    def completer(prefix: str, **_: object) -> list[str]:
        from argcomplete.completers import FilesCompleter

        files = FilesCompleter(("yaml", "npz", "urdf", "xacro"))(prefix)
        return [*(name for name in names() if name.startswith(prefix)), *files]

    vars(action)["completer"] = completer


def _add_strict(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--strict",
        action="store_true",
        help="for untrusted files: read only files beside them and bundled ones, and "
        "admit only our own types",
    )
    parser.add_argument(
        "--allow",
        action="append",
        default=[],
        type=Path,
        metavar="DIR|PACKAGE",
        help="another folder to read from, or a package to admit types of; means "
        "--strict; may be repeated",
    )


def _add_overrides(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="overrides",
        metavar="KEY=VALUE",
        help="override a value, such as simulation.duration=2; may be repeated",
    )
