"""``hsp freeze``: a controller for a program without Python."""

import argparse

from hsp_control.cli.consoles import out
from hsp_control.cli.live_experiment import live_period
from hsp_control.cli.loading import read
from hsp_control.common.errors import ConfigError
from hsp_control.config import Experiment
from hsp_control.config.loaded_scenario import load_scenario
from hsp_control.frozen import cmake_folder, compiler_flags
from hsp_control.frozen import freeze as write

_BUILDING = {"cmake_dir": cmake_folder, "flags": compiler_flags}


def freeze(options: argparse.Namespace) -> int:
    """Write a configuration's controller to a file, or print the library's location."""
    for name, answer in _BUILDING.items():
        if getattr(options, name):
            print(answer())
            return 0
    if not options.config:
        raise ConfigError("hsp freeze needs a configuration, such as panda_limits")
    loaded = load_scenario(read(options))
    experiment, document = Experiment.of(loaded), loaded.document
    if experiment.scenario.plan is not None:
        raise document.error(
            ("plan",),
            "a plan is Python, which a frozen controller runs without",
        )
    if experiment.scenario.estimators:
        raise document.error(
            ("estimators",),
            "estimators are Python, which a frozen controller runs without",
        )
    with document.at():
        file = write(
            experiment.controller,
            options.out / f"{experiment.name}.hsp",
            compensation=experiment.scenario.compensation,
            period=live_period(experiment),
            start=experiment.q0,
            payloads=options.payload,
            presences=options.presence,
            stop=experiment.scenario.live.stop.gains,
        )
    out.print(f"Frozen: {file}", highlight=False)
    return 0
