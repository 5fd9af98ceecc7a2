"""A simulated robot on ROS 2: ``python -m hsp_control.companions.ros2.robot``.

It publishes its states and receives efforts like a robot with ros2_control; see
page.md.
"""

import argparse
import sys
from collections.abc import Sequence

from hsp_control.cli.live_experiment import of_a_robot, simulated_robot
from hsp_control.common.errors import HspControlError
from hsp_control.companions.ros2.installed import check_installed
from hsp_control.config.document import read_document
from hsp_control.live import OperatorRequests
from hsp_control.live.operator_requests import stop_signals
from hsp_control.live.udp import CLOSED_BY_LOOP

_NOTHING = "no effort arrived"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the robot until it has stopped; return 0, or 2 after an error or a fault."""
    parser = argparse.ArgumentParser(prog="hsp_control.companions.ros2.robot")
    parser.add_argument("config", metavar="CONFIG", help="as of `hsp live`")
    parser.add_argument("address", metavar="ros2://CONTROLLER")
    parser.add_argument(
        "--set", action="append", default=[], dest="overrides", metavar="KEY=VALUE"
    )
    parser.add_argument(
        "--lockstep",
        action="store_true",
        help="a period passes with each effort, instead of in real time",
    )
    options = parser.parse_args(arguments)
    requests = OperatorRequests()
    try:
        with stop_signals(requests, takes_over=True):
            reason = _run(options, requests)
    except KeyboardInterrupt:
        print("hsp: stopped by the user", file=sys.stderr)
        return 2
    except HspControlError as error:
        print(f"hsp: {error}", file=sys.stderr)
        return 2
    print(f"The robot: {reason}")
    return 0 if reason in (_NOTHING, CLOSED_BY_LOOP, requests.reason) else 2


def _run(options: argparse.Namespace, requests: OperatorRequests) -> str:
    check_installed()
    from hsp_control.companions.ros2.simulated import RobotTopics, serve

    document = read_document(options.config)
    for assignment in options.overrides:
        document.override(assignment)
    experiment = of_a_robot(document)
    robot = simulated_robot(experiment)
    topics = RobotTopics(options.address, experiment.robot)
    print(f"{topics.states}, {topics.commands}: ready", flush=True)
    serve(robot, topics, stop_reason=lambda: requests.reason, lockstep=options.lockstep)
    return robot.reason or _NOTHING


if __name__ == "__main__":
    sys.exit(main())
