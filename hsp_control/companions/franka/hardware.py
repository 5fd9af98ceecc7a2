"""A Franka arm under torque control, as hardware of the live loop."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, pi

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.companions.franka import client
from hsp_control.companions.franka.client_process import ClientProcess
from hsp_control.companions.franka.settings import FrankaSettings
from hsp_control.live.hardware import Measurement
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

EFFORT_RATE = 999.0
"""Maximum rate of the sent effort [N·m/s].

The arm accepts 1000, relative to an effort that it reports in single precision: 100
N·m are reported to 4e-6, which is 0.004 N·m/s."""
_START = 5.0
"""Longest time to start or end the torque control [s]."""
_LONGEST = 60.0
"""Longest wait for a state in lockstep [s]."""
_LAST_WORDS = 1.5
"""Time to wait for the client's message when it receives nothing for 1 s [s]."""


class FrankaHardware:
    """`Hardware`: seven joints that take tau - g(q) every millisecond.

    The second `read` starts the torque control and waits for it: the first states
    arrive without it, while the loop prepares. A reflex, the stop button and a lost
    line are raised by `read`; the arm then holds itself.

    Attributes:
        period: Time between two states [s].
        q: Configuration when it was connected, shape (7,) [rad].
        lines: Sentences on findings and settings of the connection.
        real_time: Whether its time passes as ours does: not in lockstep.
    """

    period = 0.001

    def __init__(
        self,
        robot: Robot,
        process: ClientProcess,
        settings: FrankaSettings,
        q: Array,
        lines: Sequence[str],
        gripper: ClientProcess | None = None,
    ) -> None:
        """Take over a process that is connected to the arm.

        Args:
            robot: The controller's model.
            process: The process.
            settings: The filter's settings and the lockstep are used here.
            q: Its configuration, shape (7,) [rad].
            lines: Findings and settings of the connection.
            gripper: The process that drives its gripper; the loop never waits for it.
        """
        self._robot, self._process, self._gripper = robot, process, gripper
        self.q, self.lines = q, lines
        self._reads, self._origin = 0, 0.0
        self.real_time = not settings.lockstep
        self._running = self._closed = False
        self._effort = np.zeros(7)
        self._sent_any = False
        self._applied = np.zeros(7)
        cutoff = settings.cutoff_frequency or inf
        # The filter of libfranka's own control loop (lowpass_filter.cpp).
        self._new_part = self.period / (self.period + 1.0 / (2.0 * pi * cutoff))

    def adapted(self, settings: LiveSettings) -> LiveSettings:
        """Return settings with the values that this arm prescribes.

        It adds g(q) itself, and accepts no higher rate than `EFFORT_RATE`.

        Raises:
            LiveError: If there are neither one nor seven effort rates.
        """
        rates = np.minimum(settings.rate_limits(self._robot), EFFORT_RATE)
        return replace(settings, compensates_gravity=True, effort_rate=rates.tolist())

    @property
    def fault(self) -> str | None:
        """Why the arm stopped by itself or was lost, once it is known."""
        return self._process.fault

    def read(self, timeout: float) -> Measurement | None:
        """Return the state that follows the last effort; see `Hardware.read`.

        Raises:
            HardwareError: If the arm stopped by itself, does not start or is lost, or
                a box in lockstep does not answer.
        """
        if not self._process.waiting:
            if self._running:  # the loop sent nothing: the last effort is held
                self._send(client.EFFORT)
            else:
                self._process.ask(client.READ if self._reads == 0 else client.START)
        starts = self._reads == 1
        if not self.real_time:
            timeout = _LONGEST
        answer = self._process.receive(max(timeout, _START) if starts else timeout)
        if answer is None:
            if not self.real_time:
                raise HardwareError(f"the box sent no state for {_LONGEST:g} s")
            if starts:
                raise HardwareError(f"torque control did not start in {_START:g} s")
            return None
        _, t, *numbers = client.STATE.unpack(answer)
        if not self._running:  # time is stopped while the loop prepares
            self._origin = t
        self._running = self._reads > 0
        self._reads += 1
        q, v, self._applied = np.array(numbers).reshape(3, 7)
        sequence = round((t - self._origin) / self.period)
        t = sequence * self.period
        trouble = "" if self._gripper is None else self._gripper.trouble()
        fault = f"the process that drives the gripper {trouble}" if trouble else ""
        return Measurement(sequence, t, q, v, applied=self._applied, fault=fault)

    def write(self, effort: Array) -> None:
        """Send an effort for the last state; without a new state it is too late.

        Raises:
            HardwareError: If the robot cannot be reached, or the first effort contains
                g(q).
        """
        if self._process.waiting:
            return
        largest = float(np.abs(effort - self._applied).max())
        if not self._sent_any and largest > 2.0 * EFFORT_RATE * self.period:
            raise HardwareError(
                f"the first effort jumps by {largest:.3g} N·m; a Franka adds g(q) "
                "itself: run the loop with hardware.adapted(settings)"
            )
        self._sent_any = True
        self._effort = self._applied + self._new_part * (effort - self._applied)
        self._send(client.EFFORT)

    def close(self) -> None:
        """End the torque control with the last effort; see `Hardware.close`.

        Its client may report only now why the arm did not answer: `fault`.
        """
        if self._closed:
            return
        self._closed = True
        process = self._process
        try:
            if process.waiting:
                process.receive(_LAST_WORDS)
            if self._running and not process.waiting and process.fault is None:
                self._send(client.FINISH)
                process.receive(_START)
        except HardwareError:
            pass  # stored in `fault`
        finally:
            try:
                process.close()
            finally:
                if self._gripper is not None:
                    self._gripper.close()

    def _send(self, kind: bytes) -> None:
        self._process.ask(client.REQUEST.pack(kind, *self._effort.tolist()))
