"""Options that several commands have."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path

from hsp_control.common.resources import bundled_configs


def add_configuration(
    parser: argparse.ArgumentParser, or_else: str = "", default: str | None = None
) -> None:
    """Add the configuration that a command is about, and what changes it."""
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
    """Add what files a configuration may name."""
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


def add_import(parser: argparse.ArgumentParser) -> None:
    """Add which Python files are run first."""
    parser.add_argument(
        "--import",
        action="append",
        default=[],
        type=Path,
        dest="imports",
        metavar="FILE.py",
        help="run this Python file first, whose functions and types the configuration "
        "may name: it may do anything, so none with --strict; may be repeated",
    )


def complete(action: argparse.Action, names: Callable[[], Iterable[str]]) -> None:
    """Have shells complete an argument by names and by files."""

    def completer(prefix: str, **_: object) -> list[str]:
        from argcomplete.completers import FilesCompleter

        files = FilesCompleter(("yaml", "npz", "urdf", "xacro"))(prefix)
        return [*(name for name in names() if name.startswith(prefix)), *files]

    vars(action)["completer"] = completer
