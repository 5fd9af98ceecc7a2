"""A robot at the other end of a UDP connection."""

import secrets
from time import monotonic

from hsp_control.common.arrays import Array
from hsp_control.live.faults import Faults
from hsp_control.live.hardware import Measurement
from hsp_control.live.link import LOOPBACK, Address, Ages, Link
from hsp_control.live.packets import Kind
from hsp_control.live.safe_stop import Phase
from hsp_control.robot import Robot

_BYES = 3
"""How often the end is said: a packet may be lost."""


class UdpHardware:
    """`Hardware` that speaks `packets` with a robot; a simulated one, for example.

    The robot sends its states to `address` with the `session`; what comes first tells
    where it is.

    Attributes:
        period: Time between two states [s].
        link: The connection, with what it counted.
        closed: Whether the end was said.
    """

    def __init__(
        self,
        robot: Robot,
        period: float,
        *,
        address: Address = (LOOPBACK, 0),
        session: int | None = None,
        faults: Faults | None = None,
    ) -> None:
        """Listen.

        Args:
            robot: The robot, for the sizes of its state.
            period: Time between two states [s].
            address: Where to listen; port 0: any that is free.
            session: A number that the robot knows; None: one that nobody guesses.
            faults: What happens to the efforts on their way.

        Raises:
            HardwareError: If the address is taken.
        """
        self.period = period
        self._nq, self._nv = robot.nq, robot.nv
        session = secrets.randbits(63) if session is None else session
        self.link = Link(session, address, faults=faults, stream=1)
        self._ages = Ages()
        self.closed = False

    @property
    def address(self) -> Address:
        """Where the robot should send its states."""
        return self.link.address

    @property
    def session(self) -> int:
        """What the robot has to know."""
        return self.link.session

    def read(self, timeout: float) -> Measurement | None:
        """Return the newest state; see `Hardware.read`."""
        states = [p for p in self.link.receive(timeout) if p.kind is Kind.STATE]
        for packet in states:
            age = self._ages.age(monotonic(), 1e-9 * packet.stamp)
        if not states:
            return None
        q, v = packet.payload[: self._nq], packet.payload[self._nq :]
        halted = packet.phase > Phase.RUNNING
        return Measurement(packet.sequence, packet.t, q, v, age, halted)

    def write(self, effort: Array) -> None:
        """Send an effort; see `Hardware.write`."""
        self.link.send(Kind.EFFORT, effort)

    def close(self) -> None:
        """Say that no more efforts will come; what still comes can be counted."""
        if not self.closed and self.link.peer is not None:
            for _ in range(_BYES):
                self.link.send(Kind.BYE)
        self.closed = True

    def drain(self) -> None:
        """Count what came after the end, and close the socket."""
        self.link.receive(0.0)
        self.link.close()
