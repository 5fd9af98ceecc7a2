"""A robot that is connected by UDP."""

import secrets
from time import monotonic

from hsp_control.common.arrays import Array
from hsp_control.live.faults import Faults
from hsp_control.live.hardware import Measurement
from hsp_control.live.link import LOOPBACK, Address, AgeEstimator, Link
from hsp_control.live.packets import Kind
from hsp_control.live.safe_stop import Phase
from hsp_control.live.sensor_layout import SensorLayout
from hsp_control.robot import Robot

_BYES = 3
"""Number of BYE packets that are sent: one may be lost."""


class UdpHardware:
    """`Hardware` that exchanges `packets` with a robot, for example a simulated one.

    The robot sends its states to `address` with the number `session`; its own address
    is taken from its first packet.

    Attributes:
        period: Time between two states [s].
        link: The connection, with its counts of packets.
        closed: Whether `close` was called.
    """

    def __init__(
        self,
        robot: Robot,
        period: float,
        *,
        address: Address = (LOOPBACK, 0),
        session: int | None = None,
        faults: Faults | None = None,
        sensors: SensorLayout | None = None,
    ) -> None:
        """Open the socket.

        Args:
            robot: The model; gives the sizes nq and nv.
            period: Time between two states [s].
            address: Where to listen; port 0: any free port.
            session: A number that the robot knows; None: a random one.
            faults: Faults to inject into the efforts sent.
            sensors: What the robot measures besides q and v; None: nothing.

        Raises:
            HardwareError: If the address does not exist or is in use.
        """
        self.period = period
        self._robot = robot
        self._sensors = SensorLayout() if sensors is None else sensors
        session = secrets.randbits(63) if session is None else session
        self.link = Link(session, address, faults=faults, stream=1)
        self._age_estimator = AgeEstimator()
        self.closed = False

    @property
    def address(self) -> Address:
        """The address to which the robot must send its states."""
        return self.link.address

    @property
    def session(self) -> int:
        """The number of the session, which the robot must know."""
        return self.link.session

    def read(self, timeout: float) -> Measurement | None:
        """Return the newest state; see `Hardware.read`."""
        states = [p for p in self.link.receive(timeout) if p.kind is Kind.STATE]
        for packet in states:
            age = self._age_estimator.age(monotonic(), 1e-9 * packet.stamp)
        if not states:
            return None
        measured = self._sensors.unpack(packet.payload, self._robot)
        return measured._replace(
            sequence=packet.sequence,
            t=packet.t,
            age=age,
            halted=packet.phase > Phase.RUNNING,
        )

    def write(self, effort: Array) -> None:
        """Send an effort; see `Hardware.write`."""
        self.link.send(Kind.EFFORT, effort)

    def close(self) -> None:
        """Send the end of the session; packets that still arrive can be counted."""
        if not self.closed and self.link.peer is not None:
            for _ in range(_BYES):
                self.link.send(Kind.BYE)
        self.closed = True

    def drain(self) -> None:
        """Count the packets that arrived after `close`, and close the socket."""
        self.link.receive(0.0)
        self.link.close()
