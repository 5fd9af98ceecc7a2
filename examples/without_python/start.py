"""Close the loop of a simulated arm with a controller that runs without Python.

    python start.py [CONFIG] [--duration S] [--out DIR] [--set KEY=VALUE]
        [--lockstep]

It freezes a configuration, compiles `live.cpp`, starts the simulated robot of
``hsp live`` in one process and the C++ loop in another, and waits. Python is needed to
freeze, and for the simulated robot; the loop has none.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import hsp_control as hsp
from hsp_control.cli.live_experiment import live_period
from hsp_control.cli.robot_process import RobotProcess
from hsp_control.frozen import compiler_flags

HERE = Path(__file__).parent


def compiled(source: Path, folder: Path) -> Path:
    """Return the program that a C++ file becomes."""
    found = next(filter(shutil.which, ("c++", "g++", "clang++")), None)
    compiler = shlex.split(os.environ.get("CXX") or found or "")
    if not compiler:
        sys.exit("start.py: no C++ compiler is there: install one, or name it in CXX")
    program = folder / source.stem
    flags = ["-std=c++20", "-O2", *shlex.split(compiler_flags())]
    command = [*compiler, str(source), *flags, "-o", str(program)]
    subprocess.run(command, check=True)
    return program


def main() -> int:
    """Run both processes; return 0 if the loop ran to its end, and the arm stopped."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("config", nargs="?", default="panda_limits")
    parser.add_argument("--duration", type=float, default=10.0, metavar="S")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--out", type=Path, default=Path("out"), metavar="DIR")
    parser.add_argument("--lockstep", action="store_true", help="not in real time")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    experiment = hsp.load_experiment(options.config, *options.set)
    frozen = hsp.freeze(
        experiment.controller,
        options.out / f"{experiment.name}.hsp",
        compensation=experiment.scenario.compensation,
        period=live_period(experiment),
    )
    program = compiled(HERE / "live.cpp", options.out)
    log = options.out / f"{experiment.name}-robot.journal"
    robot = RobotProcess(experiment, log=log, lockstep=options.lockstep)
    (_, port), session = robot.hardware.address, robot.hardware.session
    robot.hardware.link.close()  # the loop listens there instead
    command = [str(each) for each in (program, frozen, port, session, options.duration)]
    with subprocess.Popen(command) as loop:
        try:
            with robot:
                status = loop.wait(options.duration + 60.0)
                report = robot.wait() or {}
        finally:
            loop.kill()
    print(f"The robot: {report.get('reason', 'it does not answer')}; its log: {log}")
    return status


if __name__ == "__main__":
    sys.exit(main())
