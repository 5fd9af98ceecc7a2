"""Loads the experiment or the robot of a command."""

import argparse
from pathlib import Path

from hsp_control.common.errors import AccessError
from hsp_control.config import Experiment
from hsp_control.config.document import Document, read_document
from hsp_control.config.experiment import build
from hsp_control.config.own_code import add_imports
from hsp_control.declaration.imported import import_code
from hsp_control.robot.description.access import ANYWHERE, Access, only_within
from hsp_control.robot.description.sources import is_path


def load(options: argparse.Namespace, *overrides: str) -> Experiment:
    """Return the experiment of a command's configuration, with its ``--strict``."""
    return build(read(options, *overrides))


def read(options: argparse.Namespace, *overrides: str) -> Document:
    """Return a command's configuration; for the arguments see `load`."""
    strict = options.strict or bool(options.allow)
    imports = own_code(options)
    document = read_document(options.config, strict=strict, allow=options.allow)
    add_imports(document, imports)
    for assignment in (*options.overrides, *overrides):
        document.override(assignment)
    return document


def own_code(options: argparse.Namespace) -> list[str]:
    """Return the code named by ``--import``, which strict reading does not accept."""
    for name in options.imports:
        if options.strict or options.allow:
            raise AccessError(
                f"--import {name} runs code, which --strict and --allow do not admit"
            )
    return list(options.imports)


def run_imports(options: argparse.Namespace) -> None:
    """Import the code of ``--import``, for a command without a configuration."""
    for name in own_code(options):
        import_code(name)


def robot_access(name: str, options: argparse.Namespace) -> Access:
    """Return which files a command with a robot, not a configuration, may read.

    Strict reading reads beside the robot's file; a name allows no folder.
    """
    if not (options.strict or options.allow):
        return ANYWHERE
    beside = [Path(name).parent] if is_path(name) else []
    return only_within([*beside, *options.allow])
