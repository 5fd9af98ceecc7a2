"""One end of a UDP connection: send packets, and check those received."""

import socket
from collections import Counter
from contextlib import suppress
from select import select
from time import monotonic, monotonic_ns

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.live.faults import FaultInjector, Faults
from hsp_control.live.packets import Kind, Packet, decode, encode

Address = tuple[str, int]

LOOPBACK = "127.0.0.1"
_BUFFER = 4 << 20
"""Size of the receive buffer [bytes]: some thousand packets."""
_MAX_DATAGRAM = 65536
_NOTHING = np.zeros(0)


class Link:
    """One end of a UDP connection.

    Every received packet is one of: accepted; corrupted (incomplete or changed);
    foreign (of another session); duplicated (the newest again); stale (older than the
    newest). `receive` returns the accepted ones only.

    Attributes:
        session: Number of the session, the same at both ends.
        address: Address of this end.
        peer: Address of the other end; None until a packet arrived from it.
        newest: Sequence number of the newest accepted packet.
        counts: Number of packets of each kind above, and of packets ``sent``.
    """

    def __init__(
        self,
        session: int,
        address: Address = (LOOPBACK, 0),
        *,
        peer: Address | None = None,
        faults: Faults | None = None,
        stream: int = 0,
    ) -> None:
        """Open the socket.

        Args:
            session: A number that both ends know.
            address: Where to listen; port 0: any free port.
            peer: The other end; None: the sender of the first packet of the session.
            faults: Faults to inject into the packets sent.
            stream: Stream of the faults' random numbers.

        Raises:
            HardwareError: If the address does not exist or is in use.
        """
        self.session, self.peer = session, peer
        self._faults = FaultInjector(faults or Faults(), stream)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        with suppress(OSError):  # a smaller buffer works, too
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise HardwareError(
                f"cannot listen at {address[0]}:{address[1]}: {error.strerror or error}"
            ) from error
        self.address: Address = self._socket.getsockname()
        self.newest = self._sent = 0
        self.counts: Counter[str] = Counter(
            dict.fromkeys(
                ("sent", "accepted", "corrupted", "foreign", "duplicated", "stale"), 0
            )
        )

    @property
    def injected(self) -> dict[str, int]:
        """Number of faults of each kind that were injected into packets sent."""
        return dict(self._faults.injected)

    @property
    def lost(self) -> int:
        """Packet loss: number of packets that the other end sent and did not arrive."""
        valid = self.counts["accepted"] + self.counts["stale"]
        return max(0, self.newest - valid - self.counts["corrupted"])

    def send(
        self, kind: Kind, payload: Array = _NOTHING, *, t: float = 0.0, phase: int = 0
    ) -> None:
        """Send a packet; if the other end has closed, nothing happens.

        Args:
            kind: What the packet is.
            payload: The numbers, shape (n,).
            t: Time of the payload [s].
            phase: The robot's phase.

        Raises:
            HardwareError: If the other end's address is not known yet.
        """
        if self.peer is None:
            raise HardwareError("no packet of the robot has arrived yet")
        self._sent += 1
        self.counts["sent"] += 1
        packet = Packet(
            kind,
            phase,
            self.session,
            self._sent,
            self.newest,
            monotonic_ns(),
            t,
            payload,
        )
        # A BYE must arrive: faults are injected only into packets that repeat.
        if kind is Kind.BYE:
            sent = [*self._faults.flush(), encode(packet)]
        else:
            sent = self._faults.apply(encode(packet))
        for data in sent:
            with suppress(BlockingIOError, ConnectionRefusedError):
                self._socket.sendto(data, self.peer)

    def receive(self, timeout: float) -> list[Packet]:
        """Return the accepted packets, oldest first; none after `close`.

        Args:
            timeout: Longest time to wait if there is none [s]; 0: do not wait.
        """
        accepted = self._drain() if self._socket.fileno() >= 0 else []
        if accepted or timeout <= 0.0 or self._socket.fileno() < 0:
            return accepted
        end = monotonic() + timeout
        while not accepted and (left := end - monotonic()) > 0.0:
            ready, _, _ = select([self._socket], [], [], left)
            if ready:
                accepted = self._drain()
        return accepted

    def close(self) -> None:
        """Close the socket; a second call does nothing."""
        self._socket.close()

    def _drain(self) -> list[Packet]:
        accepted: list[Packet] = []
        while True:
            try:
                data, sender = self._socket.recvfrom(_MAX_DATAGRAM)
            except BlockingIOError:
                return accepted
            except ConnectionRefusedError:  # the other end had closed when we sent
                continue
            packet = self._classify(data, sender)
            if packet is not None:
                accepted.append(packet)

    def _classify(self, data: bytes, sender: Address) -> Packet | None:
        packet = decode(data)
        kind = "accepted"
        if packet is None:
            kind = "corrupted"
        elif packet.session != self.session:
            kind = "foreign"
        elif packet.sequence == self.newest:
            kind = "duplicated"
        elif packet.sequence < self.newest:
            kind = "stale"
        self.counts[kind] += 1
        if packet is None or kind != "accepted":
            return None
        self.newest, self.peer = packet.sequence, sender
        return packet


class AgeEstimator:
    """Estimates the age of packets without synchronised clocks.

    age = (arrival - stamp) - min over recent packets of (arrival - stamp): the packet
    with the smallest difference is taken to have had no delay. Recent: in this time
    window or the one before, because clocks drift.
    """

    def __init__(self, window: float = 10.0) -> None:
        self._window = window
        self._smallest = self._smallest_before = np.inf
        self._end = -np.inf

    def age(self, arrival: float, stamp: float) -> float:
        """Return a packet's age [s]."""
        if arrival > self._end:
            self._smallest_before, self._smallest = self._smallest, np.inf
            self._end = arrival + self._window
        self._smallest = min(self._smallest, arrival - stamp)
        return arrival - stamp - min(self._smallest, self._smallest_before)
