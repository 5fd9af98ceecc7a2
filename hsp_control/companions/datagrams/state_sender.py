"""A live loop sends its state to a policy, one JSON text per datagram."""

import json
import logging
import socket
from collections.abc import Iterable
from math import isfinite
from typing import Any

import numpy as np

from hsp_control.common.errors import HardwareError
from hsp_control.common.host_names import check_host_name
from hsp_control.common.suggestions import did_you_mean
from hsp_control.companions.datagrams.targets import address_of
from hsp_control.companions.shared import Rate, name_and_options, rate_of
from hsp_control.declaration.nested import parts_within
from hsp_control.engine.rotations import quaternion_from_rotation
from hsp_control.robot import RobotState
from hsp_control.simulation.control_chain import EffortSource
from hsp_control.tasks import JointPosture
from hsp_control.trajectories.streams.followed import FollowedStream

_BYES = 3
"""Number of datagrams that report the end: one may be lost."""
_log = logging.getLogger(__name__)


def publish(address: str, source: EffortSource) -> "Teller":
    """Return the sender of a loop's state to another process; see `Teller`.

    Args:
        address: ``HOST:PORT?rate=HZ``.
        source: The source of the efforts.

    Raises:
        HardwareError: If the address is invalid or unknown.
    """
    where = f"udp://{address}"
    try:
        name, options = name_and_options(address)
    except ValueError as error:
        raise HardwareError(f"{where}: {error}") from None
    for key in options:
        if key != "rate":
            raise HardwareError(
                f"{where}: unknown option {key!r}{did_you_mean(key, ['rate'])} "
                "(known: rate)"
            )
    to = address_of(f"udp://{name}")
    if to is None or to.part:
        raise HardwareError(
            f"{where}: needs udp://HOST:PORT, for example udp://127.0.0.1:5006"
        )
    try:
        rate = rate_of(options)
    except ValueError as error:
        raise HardwareError(f"{where}: {error}") from None
    try:
        check_host_name(to.host)
        found = socket.getaddrinfo(*to[:2], socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        raise HardwareError(f"{where}: {error.strerror or error}") from None
    return Teller(found[0][4], rate, source)


class Teller:
    """Sends the state of a loop to one address; `run_loop` calls it as ``on_period``.

    It needs no listener, and never waits: a datagram that cannot be sent is dropped,
    and logged once. ``hsp_control/companions/datagrams/policies.md`` has the keys.
    """

    def __init__(self, to: Any, rate: float, source: EffortSource) -> None:
        """Open the socket.

        Args:
            to: The address of the other side, host and port.
            rate: Datagrams in a second of the controller's time [1/s].
            source: The source of the efforts.
        """
        self._to, self._rate, self._source = to, Rate(rate), source
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._number, self._said = 0, False
        robot, tasks = source.controller.robot, source.controller.tasks
        frames = [getattr(each, "frame", None) or robot.end_effector for each in tasks]
        self._frames = dict.fromkeys(frames or [robot.end_effector])
        self._measured(source.controller.state)  # bind its calls now
        self._poses(source.controller.state)
        source.log_channels()

    def __call__(self, t: float) -> None:
        """Send the state if it is due.

        Args:
            t: The controller's time [s].
        """
        if not self._rate.due(t):
            return
        self._send({"phase": "running", **self._state()})

    def ended(self, ended: str, reason: str) -> None:
        """Send how the run ended, and close the socket.

        Args:
            ended: ``completed``, ``operator`` or ``fault``.
            reason: Why.
        """
        for _ in range(_BYES):
            self._send({"phase": ended, "reason": reason})
        self._socket.close()

    def _state(self) -> dict[str, Any]:
        """Return the state for a policy, as JSON data."""
        source = self._source
        state, output, controller = source.state, source.output, source.controller
        streams: dict[str, Any] = {}
        for task in controller.tasks:
            for each in parts_within(task, FollowedStream) if task.remembers else ():
                counts = {**each.run.counts(), "reason": each.run.last_rejection}
                streams.setdefault(task.name, counts)
        logged = source.log_channels().items()
        return {
            "t": state.t,
            "joints": controller.robot.dof_names,
            "q": _numbers(controller.robot.joint_positions(state.q)),
            "v": _numbers(state.v),
            "tau": _numbers(output.tau),
            "frames": self._poses(state),
            "tasks": self._measured(state),
            "bounded": output.bounded,
            "damped": output.damped,
            "status": output.status.name.lower(),
            "streams": streams,
            "log": {name: _numbers(np.ravel(each.value)) for name, each in logged},
        }

    def _poses(self, state: RobotState) -> dict[str, list[float | None]]:
        """Return the poses of the tasks' frames, or of the hand."""
        found = {}
        for name in self._frames:
            frame = state.frame(name)
            quaternion = quaternion_from_rotation(frame.rotation)
            found[name] = _numbers([*frame.position, *quaternion])
        return found

    def _measured(self, state: RobotState) -> dict[str, dict[str, Any]]:
        """Return the measured and the desired values of the tasks."""
        found: dict[str, dict[str, Any]] = {}
        for task in self._source.controller.tasks:
            reference, actual = map(_numbers, task.measure(state))
            found[task.name] = {"actual": actual, "reference": reference}
            if isinstance(task, JointPosture):
                found[task.name]["joints"] = task.joints
        return found

    def _send(self, what: dict[str, Any]) -> None:
        self._number += 1
        text = json.dumps({"number": self._number, **what})
        try:
            self._socket.sendto(text.encode(), self._to)
        except OSError as error:
            if not self._said:
                _log.warning(
                    "udp://%s:%s: the state cannot be sent there: %s", *self._to, error
                )
            self._said = True


def _numbers(values: Iterable[Any]) -> list[float | None]:
    """Return numbers for JSON, which has neither NaN nor Infinity."""
    return [float(each) if isfinite(each) else None for each in values]
