"""How much of the house a step runs: functions, classes and files, from a trace.

    .venv/bin/python tools/functions_of_a_step.py [--names]

Of a Panda's position task with joint centering: the first step, which places the parts
and binds the calls, and a later one. What the engine computes is one call.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import hsp_control as hsp

HOUSE = str(Path(hsp.__file__).parent)


def traced(act: Callable[[], object]) -> tuple[set[tuple[str, str]], set[str]]:
    """Return the functions, with their files, and the classes of an act."""
    functions, classes = set[tuple[str, str]](), set[str]()

    def look(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(HOUSE):
            return
        if code.co_name.startswith("<"):  # modules, comprehensions
            return
        functions.add((code.co_filename.removeprefix(HOUSE), code.co_qualname))
        if "self" in frame.f_locals:
            classes.add(type(frame.f_locals["self"]).__name__)

    sys.setprofile(look)
    try:
        act()
    finally:
        sys.setprofile(None)
    return functions, classes


def main() -> None:
    """Print the numbers, and with ``--names`` what a later step runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--names", action="store_true", help="list the functions")
    options = parser.parse_args()
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition(name="hand")
    controller = hsp.Controller(robot, [hand], hsp.JointCentering())
    q, v = robot.home(), np.zeros(robot.nv)
    for k, name in enumerate(("first step", "later step")):
        functions, classes = traced(lambda k=k: controller.compute(0.001 * k, q, v))
        files = {file for file, _ in functions}
        print(
            f"{name}: {len(functions)} functions, {len(classes)} classes, "
            f"{len(files)} files"
        )
        if options.names:
            for file, function in sorted(functions):
                print(f"  {file}: {function}")


if __name__ == "__main__":
    main()
