"""The experiment that a command is about."""

import argparse

from hsp_control.config import Experiment, load_experiment


def load(options: argparse.Namespace, *overrides: str) -> Experiment:
    """Return the experiment of a command's configuration, with its ``--strict``.

    Args:
        options: Of the command line.
        overrides: Values to change after those of ``--set``.
    """
    return load_experiment(
        options.config,
        *options.overrides,
        *overrides,
        strict=options.strict or bool(options.allow),
        allow=options.allow,
    )
